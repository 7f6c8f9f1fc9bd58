//! The inner loop: every reading is added to the moments of its segment.
//!
//! A reading at `u` in its segment, `-1 <= u <= 1`, adds `w phi_j(u)` and `w y phi_j(u)`,
//! where `phi_j` is the product of the Chebyshev polynomials `T_1, T_2, T_4, T_8, T_16`
//! that the binary digits of `j` name. The products span the same polynomials as
//! `T_0, T_1, ...`, never exceed 1, and eight of them cost two vector multiplications.

use super::readings::Readings;
use super::segment::{LANES, Segment};
use crate::angle::Period;
use crate::kernel::lanes::{InstructionSet, Kernel, Lanes, dispatch};

/// Readings prepared at a time; their places and polynomials stay in the first cache.
const CHUNK: usize = 64;

/// Adding it to a whole number below 2^52 leaves that number in the low bits.
const WHOLE: f64 = (1u64 << 52) as f64;

/// Division of a turn into `2 half` equal segments.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    turn: Wrap,
    half: f64,
    scale: f64,
    scale_low: f64,
}

/// Reduction by whole turns; the products are exact thanks to fused multiply-adds.
#[derive(Clone, Copy, Debug)]
struct Wrap {
    inverse: f64,
    high: f64,
    low: f64,
}

impl Wrap {
    fn new(period: Period) -> Self {
        Self {
            inverse: 1.0 / period.value(),
            high: period.value(),
            low: period.low(),
        }
    }

    /// `x` minus the whole turns nearest to `near`.
    #[inline(always)]
    fn reduce(&self, x: f64, near: f64) -> f64 {
        let turns = (near * self.inverse).round_ties_even();
        (-turns).mul_add(self.low, (-turns).mul_add(self.high, x))
    }
}

impl Frame {
    /// `segments` (an even number) over one turn of `period`.
    pub fn new(period: Period, segments: usize) -> Self {
        let count = segments as f64;
        let scale = count / period.value();
        let rest = (-scale).mul_add(period.value(), count) - scale * period.low();
        Self {
            turn: Wrap::new(period),
            half: 0.5 * count,
            scale,
            scale_low: rest / period.value(),
        }
    }

    /// Segment of `x` and the place in it, from -1 to 1.
    #[inline(always)]
    fn place(&self, x: f64) -> (u32, f64) {
        let rest = self.turn.reduce(x, x);
        let floor = clamp((rest * self.scale).floor(), -self.half, self.half - 1.0);
        let part = rest.mul_add(self.scale, -floor) + rest * self.scale_low;
        let segment = (floor + self.half + WHOLE).to_bits() as u32;
        (segment, clamp(part.mul_add(2.0, -1.0), -1.0, 1.0))
    }
}

/// `x` between two bounds, the lower one for NaN: no angle can leave the table.
#[inline(always)]
fn clamp(x: f64, low: f64, high: f64) -> f64 {
    let x = if x >= low { x } else { low };
    if x <= high { x } else { high }
}

/// Errors are taken around a centre, modulo their own turn.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    turn: Wrap,
    centre: f64,
}

impl Around {
    /// Errors in `(-period/2, period/2]` around `centre`.
    pub fn new(period: Period, centre: f64) -> Self {
        Self {
            turn: Wrap::new(period),
            centre,
        }
    }

    /// `indicated - reference - centre` without whole turns.
    #[inline(always)]
    fn difference(&self, indicated: f64, reference: f64) -> f64 {
        let (difference, carry) = crate::angle::two_sum(indicated, -reference);
        let rest = self.turn.reduce(difference, difference - self.centre);
        (rest - self.centre) + carry
    }
}

/// One call of the inner loop.
struct Call<'a, 'b> {
    frame: &'a Frame,
    around: &'a Around,
    readings: Readings<'a>,
    table: &'b mut [Segment],
    squares: &'b mut f64,
}

/// Adds readings to their segments; returns the weighted sum of squared errors.
pub fn accumulate(
    frame: &Frame,
    around: &Around,
    readings: Readings<'_>,
    table: &mut [Segment],
) -> f64 {
    let mut squares = 0.0;
    let call = Call {
        frame,
        around,
        readings,
        table,
        squares: &mut squares,
    };
    dispatch(InstructionSet::best(), call);
    squares
}

impl Kernel for Call<'_, '_> {
    /// The shapes of readings, each compiled on its own.
    #[inline(always)]
    fn run<L: Lanes>(self) {
        match (self.readings.reference, self.readings.weights) {
            (None, None) => run::<L, false, false>(self),
            (None, Some(_)) => run::<L, false, true>(self),
            (Some(_), None) => run::<L, true, false>(self),
            (Some(_), Some(_)) => run::<L, true, true>(self),
        }
    }
}

#[inline(always)]
fn run<L: Lanes, const DIFFERENCE: bool, const WEIGHTED: bool>(call: Call<'_, '_>) {
    let Call {
        frame,
        around,
        readings,
        table,
        squares: sum,
    } = call;
    let mut chunk = Chunk::new();
    let mut squares = [0.0; LANES];
    for start in (0..readings.angle.len()).step_by(CHUNK) {
        let len = CHUNK.min(readings.angle.len() - start);
        let angle = load(readings.angle, start, len);
        let error = load(readings.error, start, len);
        let reference = match readings.reference {
            Some(values) if DIFFERENCE => load(values, start, len),
            _ => [0.0; CHUNK],
        };
        chunk.weight = match readings.weights {
            Some(values) if WEIGHTED => load(values, start, len),
            _ => [1.0; CHUNK],
        };
        // What stands in for readings beyond the last does not count.
        chunk.weight[len..].fill(0.0);
        chunk.prepare(frame, around, &angle, &error, &reference);
        chunk.square(&mut squares);
        for i in 0..CHUNK {
            chunk.add::<L>(i, &mut table[chunk.segment[i] as usize]);
        }
    }
    *sum = squares.iter().sum();
}

/// `CHUNK` values from `start`, the last repeated where there are only `len`.
#[inline(always)]
fn load(values: &[f64], start: usize, len: usize) -> [f64; CHUNK] {
    if let Some(full) = values[start..].first_chunk() {
        return *full;
    }
    std::array::from_fn(|i| values[start + i.min(len - 1)])
}

/// Readings made ready for their segments.
struct Chunk {
    segment: [u32; CHUNK],
    /// `1` and `T` for `T_1, T_2, T_4`: eight products of them are two multiplications.
    pairs: [[[f64; 2]; CHUNK]; 3],
    /// `T_8` and `T_16`.
    high: [[f64; CHUNK]; 2],
    weight: [f64; CHUNK],
    error: [f64; CHUNK],
}

impl Chunk {
    fn new() -> Self {
        Self {
            segment: [0; CHUNK],
            pairs: [[[1.0; 2]; CHUNK]; 3],
            high: [[0.0; CHUNK]; 2],
            weight: [0.0; CHUNK],
            error: [0.0; CHUNK],
        }
    }

    #[inline(always)]
    fn prepare(
        &mut self,
        frame: &Frame,
        around: &Around,
        angle: &[f64; CHUNK],
        error: &[f64; CHUNK],
        reference: &[f64; CHUNK],
    ) {
        for i in 0..CHUNK {
            let (segment, u) = frame.place(angle[i]);
            let double = |t: f64| (t + t).mul_add(t, -1.0);
            let (t2, t4) = (double(u), double(double(u)));
            self.segment[i] = segment;
            self.pairs[0][i] = [1.0, u];
            self.pairs[1][i] = [1.0, t2];
            self.pairs[2][i] = [1.0, t4];
            self.high[0][i] = double(t4);
            self.high[1][i] = double(double(t4));
            self.error[i] = around.difference(error[i], reference[i]);
        }
    }

    /// Adds the weighted squares of the errors, lane by lane.
    #[inline(always)]
    fn square(&self, squares: &mut [f64; LANES]) {
        let weights = self.weight.as_chunks::<LANES>().0;
        let errors = self.error.as_chunks::<LANES>().0;
        for (w, y) in weights.iter().zip(errors) {
            for lane in 0..LANES {
                squares[lane] += w[lane] * y[lane] * y[lane];
            }
        }
    }

    /// Adds reading `i` to its segment.
    #[inline(always)]
    fn add<L: Lanes>(&self, i: usize, segment: &mut Segment) {
        let pairs = [self.pairs[0][i], self.pairs[1][i], self.pairs[2][i]];
        let (t8, t16) = (self.high[0][i], self.high[1][i]);
        let (weight, error) = (self.weight[i], self.error[i]);
        let mut low = [0.0; LANES];
        for (j, value) in low.iter_mut().enumerate() {
            *value = weight * (pairs[0][j & 1] * pairs[1][j >> 1 & 1] * pairs[2][j >> 2]);
        }
        for (j, &low) in low.iter().enumerate() {
            let [first, second, third] = [j, LANES + j, 2 * LANES + j];
            segment.weight[first] += low;
            segment.weight[second] = fused::<L>(low, t8, segment.weight[second]);
            segment.weight[third] = fused::<L>(low, t16, segment.weight[third]);
            segment.error[first] = fused::<L>(low, error, segment.error[first]);
        }
        for (value, &low) in segment.error[LANES..].iter_mut().zip(&low) {
            *value = fused::<L>(low, t8 * error, *value);
        }
    }
}

/// `a * b + c`, in one instruction where the processor has it (a slow call elsewhere).
#[inline(always)]
fn fused<L: Lanes>(a: f64, b: f64, c: f64) -> f64 {
    if L::FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of sums of 1000 terms up to 1.
    const ROUNDING: f64 = 1e-12;

    /// Every set of instructions and every shape of readings gives the same sums.
    #[test]
    fn instruction_sets_agree() {
        let sets = [
            InstructionSet::Avx512,
            InstructionSet::Avx2,
            InstructionSet::Portable,
        ];
        let sets: Vec<_> = sets.into_iter().filter(|set| set.is_available()).collect();
        let period = Period::new(360.0).unwrap();
        let frame = Frame::new(period, 34);
        let around = Around::new(period, 2.0);
        let angle: Vec<f64> = (0..1003)
            .map(|i| 700.0 * (f64::from(i) * 0.618).sin())
            .collect();
        let error: Vec<f64> = angle.iter().map(|x| 1.5 + (0.1 * x).sin()).collect();
        let indicated: Vec<f64> = angle
            .iter()
            .zip(&error)
            .map(|(x, e)| x + e - 720.0)
            .collect();
        let ones = vec![1.0; angle.len()];
        let sums = |set, readings| {
            let (mut squares, mut table) = (0.0, vec![Segment::EMPTY; 34]);
            let call = Call {
                frame: &frame,
                around: &around,
                readings,
                table: &mut table,
                squares: &mut squares,
            };
            dispatch(set, call);
            (squares, table)
        };
        let plain = Readings {
            angle: &angle,
            error: &error,
            reference: None,
            weights: None,
        };
        let (squares, table) = sums(sets[0], plain);
        for set in sets {
            for (error, reference) in [(&error, None), (&indicated, Some(&angle[..]))] {
                for weights in [None, Some(&ones[..])] {
                    let readings = Readings {
                        angle: &angle,
                        error,
                        reference,
                        weights,
                    };
                    let found = sums(set, readings);
                    assert!((found.0 - squares).abs() < ROUNDING, "{set:?}");
                    for (a, b) in found.1.iter().zip(&table) {
                        for (a, b) in a.values().zip(b.values()) {
                            assert!((a - b).abs() < ROUNDING, "{set:?}: {a} {b}");
                        }
                    }
                }
            }
        }
    }
}
