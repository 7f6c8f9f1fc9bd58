//! The inner loop: every reading is added to the moments of its segment.
//!
//! A reading at `u` in its segment, `-1 <= u <= 1`, adds `w phi_j(u)` and `w y phi_j(u)`,
//! where `phi_j` is the product of the Chebyshev polynomials `T_1, T_2, T_4, T_8, T_16`
//! that the binary digits of `j` name. The products span the same polynomials as
//! `T_0, T_1, ...`, never exceed 1, and eight of them cost two vector multiplications.

use super::readings::Readings;
use super::segment::{LANES, Segment};
use crate::angle::Period;

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
}

/// Adds readings to their segments; returns the weighted sum of squared errors.
pub fn accumulate(
    frame: &Frame,
    around: &Around,
    readings: Readings<'_>,
    table: &mut [Segment],
) -> f64 {
    let call = Call {
        frame,
        around,
        readings,
        table,
    };
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512f")
            && is_x86_feature_detected!("avx512dq")
            && is_x86_feature_detected!("avx512vl")
        {
            // SAFETY: the processor has what the function was compiled for.
            return unsafe { avx512(call) };
        }
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: as above.
            return unsafe { avx2(call) };
        }
    }
    specialise::<{ cfg!(target_feature = "fma") || cfg!(target_arch = "aarch64") }>(call)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl,fma")]
fn avx512(call: Call<'_, '_>) -> f64 {
    specialise::<true>(call)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(call: Call<'_, '_>) -> f64 {
    specialise::<true>(call)
}

/// The shapes of readings, each compiled on its own.
#[inline(always)]
fn specialise<const FUSED: bool>(call: Call<'_, '_>) -> f64 {
    match (call.readings.reference, call.readings.weights) {
        (None, None) => run::<FUSED, false, false>(call),
        (None, Some(_)) => run::<FUSED, false, true>(call),
        (Some(_), None) => run::<FUSED, true, false>(call),
        (Some(_), Some(_)) => run::<FUSED, true, true>(call),
    }
}

#[inline(always)]
fn run<const FUSED: bool, const DIFFERENCE: bool, const WEIGHTED: bool>(call: Call<'_, '_>) -> f64 {
    let Call {
        frame,
        around,
        readings,
        table,
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
            chunk.add::<FUSED>(i, &mut table[chunk.segment[i] as usize]);
        }
    }
    squares.iter().sum()
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
    fn add<const FUSED: bool>(&self, i: usize, segment: &mut Segment) {
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
            segment.weight[second] = fused::<FUSED>(low, t8, segment.weight[second]);
            segment.weight[third] = fused::<FUSED>(low, t16, segment.weight[third]);
            segment.error[first] = fused::<FUSED>(low, error, segment.error[first]);
        }
        for (value, &low) in segment.error[LANES..].iter_mut().zip(&low) {
            *value = fused::<FUSED>(low, t8 * error, *value);
        }
    }
}

/// `a * b + c`, in one instruction where the processor has it (a slow call elsewhere).
#[inline(always)]
fn fused<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}
