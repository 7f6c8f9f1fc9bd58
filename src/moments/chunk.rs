//! Some readings made ready, and added to their segments one by one or side by side.

use super::place::{Around, Frame};
use super::segment::{LANES, Segment};
use crate::simd::Lanes;

/// Readings prepared at a time; their places and polynomials stay in the first cache.
pub(super) const CHUNK: usize = 128;

/// Readings in one segment from which lanes save more than their sums cost at the end.
const RUN: usize = 24;

/// Readings made ready for their segments.
pub(super) struct Chunk {
    segment: [u32; CHUNK],
    /// `T_1, T_2, T_4, T_8, T_16`.
    polynomials: [[f64; CHUNK]; 5],
    pub(super) weight: [f64; CHUNK],
    error: [f64; CHUNK],
}

impl Chunk {
    pub(super) fn new() -> Self {
        Self {
            segment: [0; CHUNK],
            polynomials: [[0.0; CHUNK]; 5],
            weight: [0.0; CHUNK],
            error: [0.0; CHUNK],
        }
    }

    #[inline(always)]
    pub(super) fn prepare(
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
    pub(super) fn square(&self, squares: &mut [f64; LANES]) {
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
    pub(super) fn add_all<L: Lanes>(&self, table: &mut [Segment]) {
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
