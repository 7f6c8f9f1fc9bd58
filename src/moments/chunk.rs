//! Some readings made ready: their places, and their errors from the centre.

use super::place::{Around, Frame};
use super::row::{ONES, Row};
use super::segment::{LANES, Segment};
use crate::simd::Lanes;

/// Readings prepared at a time: no more than a row holds.
pub(super) const CHUNK: usize = 128;

/// Readings in one segment from which lanes save more than their sums cost at the end.
const RUN: usize = 24;

/// Readings made ready for their segments.
#[repr(C, align(64))]
pub(super) struct Chunk {
    /// Place in the segment, from -1 to 1.
    pub(super) place: [f64; CHUNK],
    pub(super) error: [f64; CHUNK],
    pub(super) weight: [f64; CHUNK],
    pub(super) segment: [u32; CHUNK],
}

impl Chunk {
    pub(super) fn new() -> Self {
        Self {
            place: [0.0; CHUNK],
            error: [0.0; CHUNK],
            weight: [1.0; CHUNK],
            segment: [0; CHUNK],
        }
    }

    /// Makes readings ready, whose weights are there; adds the weighted squares of their errors.
    #[inline(always)]
    pub(super) fn prepare<const DIFFERENCE: bool>(
        &mut self,
        frame: &Frame,
        around: &Around,
        angle: &[f64; CHUNK],
        error: &[f64; CHUNK],
        reference: &[f64; CHUNK],
        squares: &mut [f64; LANES],
    ) {
        for i in 0..CHUNK {
            let (segment, place) = frame.place(angle[i]);
            self.segment[i] = segment;
            self.place[i] = place;
            let reference = if DIFFERENCE { reference[i] } else { 0.0 };
            self.error[i] = around.difference(error[i], reference);
        }
        let weights = self.weight.as_chunks::<LANES>().0;
        for (w, y) in weights.iter().zip(self.error.as_chunks::<LANES>().0) {
            for lane in 0..LANES {
                squares[lane] += w[lane] * y[lane] * y[lane];
            }
        }
    }

    /// Whether as many readings from `i` as fill a vector are in one segment.
    #[inline(always)]
    pub(super) fn is_one_segment(&self, i: usize) -> bool {
        let mut other = 0;
        for found in &self.segment[i..i + LANES] {
            other |= found ^ self.segment[i];
        }
        other == 0
    }

    /// Notes the extremes of the first `len` readings in their segments.
    pub(super) fn note(&self, len: usize, table: &mut [Segment]) {
        for i in 0..len {
            let (u, y) = (self.place[i], self.error[i]);
            table[self.segment[i] as usize].widen([u, -u, y, -y]);
        }
    }

    /// Adds the first `len` readings to their segments: those of a sweep side by side, others
    /// one by one.
    #[inline(always)]
    pub(super) fn add_all<L: Lanes>(&self, len: usize, table: &mut [Segment]) {
        let mut start = 0;
        while start < len {
            let segment = self.segment[start];
            let moments = &mut table[segment as usize];
            let beyond = self.segment[start..len].iter().position(|s| *s != segment);
            let run = beyond.unwrap_or(len - start);
            if run >= RUN {
                let (mut row, mut weights) = (Row::EMPTY, ONES);
                weights[..run].copy_from_slice(&self.weight[start..start + run]);
                for i in 0..run {
                    self.put::<1>(start + i, &mut row, i);
                }
                row.add_some::<L>(run, &mut weights, moments);
            } else {
                for i in start..start + run {
                    self.add::<L>(i, moments);
                }
            }
            start += run;
        }
    }

    /// Puts `LEN` readings, from the `i`-th, into a row at `at`.
    #[inline(always)]
    pub(super) fn put<const LEN: usize>(&self, i: usize, row: &mut Row, at: usize) {
        for k in 0..LEN {
            row.place[at + k] = self.place[i + k];
            row.error[at + k] = self.error[i + k];
        }
    }

    /// Adds reading `i` to its segment.
    #[inline(always)]
    fn add<L: Lanes>(&self, i: usize, segment: &mut Segment) {
        let (weight, error, t1) = (self.weight[i], self.error[i], self.place[i]);
        let t2 = fused::<L>(t1 + t1, t1, -1.0);
        let t4 = fused::<L>(t2 + t2, t2, -1.0);
        let t8 = fused::<L>(t4 + t4, t4, -1.0);
        let t16 = fused::<L>(t8 + t8, t8, -1.0);
        let mut low = [0.0; LANES];
        for first in (0..LANES).step_by(L::N) {
            let product = factor::<L>(first, 0, t1) * factor::<L>(first, 1, t2);
            let product = L::splat(weight) * (product * factor::<L>(first, 2, t4));
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

/// `a * b + c`, in one instruction where the processor has it (a slow call elsewhere).
#[inline(always)]
fn fused<L: Lanes>(a: f64, b: f64, c: f64) -> f64 {
    if L::FUSED { a.mul_add(b, c) } else { a * b + c }
}
