//! The inner loop: every reading is added to the moments of its segment.
//!
//! A reading at `u` in its segment, `-1 <= u <= 1`, adds `w phi_j(u)` and `w y phi_j(u)`,
//! where `phi_j` is the product of the Chebyshev polynomials `T_1, T_2, T_4, T_8, T_16`
//! that the binary digits of `j` name. The products span the same polynomials as
//! `T_0, T_1, ...`, never exceed 1, and eight of them cost two vector multiplications.
//!
//! Readings that follow each other in one segment, as those of a joint that moves slowly,
//! are taken side by side in the lanes of vectors; others one by one.

use super::frame::{Around, Frame};
use super::readings::Readings;
use super::segment::{LANES, Segment};
use crate::kernel::lanes::{InstructionSet, Kernel, Lanes, dispatch};

/// Readings prepared at a time; their places and polynomials stay in the first cache.
const CHUNK: usize = 128;

/// Readings in one segment from which lanes save more than their sums cost at the end.
const RUN: usize = 24;

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
        chunk.add_all::<L>(table);
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
    /// `T_1, T_2, T_4, T_8, T_16`.
    polynomials: [[f64; CHUNK]; 5],
    weight: [f64; CHUNK],
    error: [f64; CHUNK],
}

impl Chunk {
    fn new() -> Self {
        Self {
            segment: [0; CHUNK],
            polynomials: [[0.0; CHUNK]; 5],
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
            self.polynomials[0][i] = u;
            self.polynomials[1][i] = t2;
            self.polynomials[2][i] = t4;
            self.polynomials[3][i] = double(t4);
            self.polynomials[4][i] = double(double(t4));
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

    /// Adds all readings to their segments.
    #[inline(always)]
    fn add_all<L: Lanes>(&self, table: &mut [Segment]) {
        let mut start = 0;
        while start < CHUNK {
            let segment = self.segment[start];
            let mut end = start;
            while end < CHUNK && self.is_within::<L>(end, segment) {
                end += L::N;
            }
            let moments = &mut table[segment as usize];
            if end - start >= RUN {
                self.add_run::<L, 0>(start, end, moments);
                self.add_run::<L, 1>(start, end, moments);
                self.add_run::<L, 2>(start, end, moments);
                self.add_run::<L, 3>(start, end, moments);
            } else {
                end = end.max(start + L::N);
                for i in start..end {
                    self.add::<L>(i, &mut table[self.segment[i] as usize]);
                }
            }
            start = end;
        }
    }

    /// Whether as many readings from `i` as there are lanes are in the segment.
    #[inline(always)]
    fn is_within<L: Lanes>(&self, i: usize, segment: u32) -> bool {
        let mut other = 0;
        for found in &self.segment[i..i + L::N] {
            other |= found ^ segment;
        }
        other == 0
    }

    /// Adds readings `start..end`, all of one segment, to its moments `2 PASS` and `2 PASS + 1`
    /// and those above by 8 and 16: as many as there are registers for.
    #[inline(always)]
    fn add_run<L: Lanes, const PASS: usize>(
        &self,
        start: usize,
        end: usize,
        segment: &mut Segment,
    ) {
        let [t1, t2, t4, t8, t16] = &self.polynomials;
        let mut sums = [[L::splat(0.0); 5]; 2];
        for i in (start..end).step_by(L::N) {
            let (weight, error) = (lanes::<L>(&self.weight, i), lanes::<L>(&self.error, i));
            let (t8, t16) = (lanes::<L>(t8, i), lanes::<L>(t16, i));
            let even = match PASS {
                0 => weight,
                1 => weight * lanes::<L>(t2, i),
                2 => weight * lanes::<L>(t4, i),
                _ => weight * (lanes::<L>(t2, i) * lanes::<L>(t4, i)),
            };
            let low = [even, even * lanes::<L>(t1, i)];
            for k in 0..2 {
                sums[k][0] = sums[k][0] + low[k];
                sums[k][1] = low[k].mul_add(t8, sums[k][1]);
                sums[k][2] = low[k].mul_add(t16, sums[k][2]);
                sums[k][3] = low[k].mul_add(error, sums[k][3]);
                if PASS < 2 {
                    sums[k][4] = low[k].mul_add(t8 * error, sums[k][4]);
                }
            }
        }
        for (j, sums) in (2 * PASS..).zip(sums) {
            segment.weight[j] += total(sums[0]);
            segment.weight[LANES + j] += total(sums[1]);
            segment.weight[2 * LANES + j] += total(sums[2]);
            segment.error[j] += total(sums[3]);
            if PASS < 2 {
                segment.error[LANES + j] += total(sums[4]);
            }
        }
    }

    /// Adds reading `i` to its segment.
    #[inline(always)]
    fn add<L: Lanes>(&self, i: usize, segment: &mut Segment) {
        let [t1, t2, t4, t8, t16] = &self.polynomials;
        let (t8, t16) = (t8[i], t16[i]);
        let (weight, error) = (self.weight[i], self.error[i]);
        let mut low = [0.0; LANES];
        for first in (0..LANES).step_by(L::N) {
            let product = factor::<L>(first, 0, t1[i]) * factor::<L>(first, 1, t2[i]);
            let product = L::splat(weight) * (product * factor::<L>(first, 2, t4[i]));
            let mut values = [0.0; LANES];
            product.to_array(&mut values);
            low[first..first + L::N].copy_from_slice(&values[..L::N]);
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

/// Values from the `i`-th, one to a lane.
#[inline(always)]
fn lanes<L: Lanes>(values: &[f64; CHUNK], i: usize) -> L {
    let mut array = [0.0; LANES];
    array[..L::N].copy_from_slice(&values[i..i + L::N]);
    L::from_array(&array)
}

/// 1 at the numbers that have the bit, by bit; the second half repeats the first.
const HAS_BIT: [[f64; 2 * LANES]; 3] = {
    let mut table = [[0.0; 2 * LANES]; 3];
    let mut place = 0;
    while place < 6 * LANES {
        let (bit, number) = (place / (2 * LANES), place % (2 * LANES));
        table[bit][number] = (number >> bit & 1) as f64;
        place += 1;
    }
    table
};

/// In the lanes `first, first + 1, ...` the polynomial `t` where the lane's number has the
/// bit, else 1.
#[inline(always)]
fn factor<L: Lanes>(first: usize, bit: usize, t: f64) -> L {
    let (mut with, mut without) = ([0.0; LANES], [0.0; LANES]);
    for lane in 0..LANES {
        with[lane] = HAS_BIT[bit][first + lane];
        without[lane] = 1.0 - with[lane];
    }
    L::splat(t).mul_add(L::from_array(&with), L::from_array(&without))
}

/// Sum of all lanes.
#[inline(always)]
fn total<L: Lanes>(lanes: L) -> f64 {
    let mut v = [0.0; LANES];
    lanes.to_array(&mut v);
    ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
}

/// `a * b + c`, in one instruction where the processor has it (a slow call elsewhere).
#[inline(always)]
fn fused<L: Lanes>(a: f64, b: f64, c: f64) -> f64 {
    if L::FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Period;

    /// Of sums of 1000 terms up to 1.
    const ROUNDING: f64 = 1e-12;

    fn sets() -> impl Iterator<Item = InstructionSet> {
        use InstructionSet::{Avx2, Avx512, Portable};
        [Avx512, Avx2, Portable]
            .into_iter()
            .filter(|set| set.is_available())
    }

    /// Readings in order of angle, of which many follow each other in a segment, give the
    /// sums of the same readings in disorder, with every set of instructions.
    #[test]
    fn readings_side_by_side_give_the_sums_of_single_ones() {
        let period = Period::new(360.0).unwrap();
        let (frame, around) = (Frame::new(period, 34), Around::new(period, 0.0));
        let of = |order: &dyn Fn(usize) -> usize, set| {
            let angle: Vec<f64> = (0..1009).map(|i| 0.1 * order(i) as f64 - 50.0).collect();
            let error: Vec<f64> = angle.iter().map(|x| (0.1 * x).sin()).collect();
            let weights: Vec<f64> = angle.iter().map(|x| 2.0 + (3.0 * x).cos()).collect();
            let (mut squares, mut table) = (0.0, vec![Segment::EMPTY; 34]);
            let readings = Readings {
                angle: &angle,
                error: &error,
                reference: None,
                weights: Some(&weights),
            };
            let call = Call {
                frame: &frame,
                around: &around,
                readings,
                table: &mut table,
                squares: &mut squares,
            };
            dispatch(set, call);
            table
        };
        for set in sets() {
            // 397 and the prime 1009: neighbours are far apart.
            let (sweep, disorder) = (of(&|i| i, set), of(&|i| i * 397 % 1009, set));
            for (a, b) in sweep.iter().zip(&disorder) {
                for (a, b) in a.values().zip(b.values()) {
                    assert!((a - b).abs() < ROUNDING, "{set:?}: {a} {b}");
                }
            }
        }
    }

    /// Every set of instructions and every shape of readings gives the same sums.
    #[test]
    fn instruction_sets_agree() {
        let sets: Vec<_> = sets().collect();
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
