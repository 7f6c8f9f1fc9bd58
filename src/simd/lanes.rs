//! Several doubles at once: the few operations kernels are written in.

use std::ops::{Add, Mul, Sub};

use crate::angle::Period;

/// Adding this to a double below 2^51 rounds it to an integer, held in the low bits.
pub const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// Most lanes of any instruction set.
pub const MOST_LANES: usize = 8;

/// Coefficients of one polynomial of degree 7, a cache line.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(64))]
pub struct Row(pub [f64; 8]);

/// Coefficients of a cubic in single precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(16))]
pub struct Quad(pub [f32; 4]);

/// A vector of doubles. Methods are safe in a function compiled for the instruction set,
/// which [`super::dispatch`] makes sure of.
pub trait Lanes: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Number of doubles.
    const N: usize;

    /// True when `mul_add` rounds once.
    const FUSED: bool;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;

    /// The first `N` of an array.
    fn from_array(values: &[f64; MOST_LANES]) -> Self;

    /// Into the first `N` of an array.
    fn to_array(self, values: &mut [f64; MOST_LANES]);

    /// `self * b + c`, rounded once where the processor can.
    fn mul_add(self, b: Self, c: Self) -> Self;

    /// `c - self * b`, rounded once where the processor can.
    fn neg_mul_add(self, b: Self, c: Self) -> Self;

    /// `self * b - product` for `product` the rounded `self * b`: exact everywhere.
    fn product_rest(self, b: Self, product: Self) -> Self;

    /// The sum over the lanes of each of four vectors.
    #[inline(always)]
    fn totals(vectors: [Self; 4]) -> [f64; 4] {
        let mut sums = [0.0; 4];
        for (sum, vector) in sums.iter_mut().zip(vectors) {
            let mut values = [0.0; MOST_LANES];
            vector.to_array(&mut values);
            *sum = (values[0] + values[2]) + (values[1] + values[3]);
            *sum += (values[4] + values[6]) + (values[5] + values[7]);
        }
        sums
    }

    /// True if any lane is beyond `limit` in magnitude (NaN is not).
    fn any_beyond(self, limit: f64) -> bool;

    /// With `i = whole & mask` of each lane, where `whole` is a value that [`ROUNDER`] was
    /// added to: `rows[i][j] + high * rows[i][j + 4]` for j = 0..4.
    ///
    /// # Safety
    /// `rows` points to `mask + 1` rows.
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4];

    /// Cubics at `u` of each lane of two vectors, in single precision: row `whole & mask`,
    /// as in [`Lanes::fold_rows`]. The first `2 N` of the array are set.
    ///
    /// # Safety
    /// `rows` points to `mask + 1` rows.
    unsafe fn cubics(
        whole: [Self; 2],
        u: [Self; 2],
        mask: u64,
        rows: *const Quad,
    ) -> [f32; 2 * MOST_LANES];

    /// Lanes beyond `limit` moved into one turn.
    #[cold]
    #[inline(never)]
    fn wrap_beyond(self, limit: f64, period: Period) -> Self {
        let mut values = [0.0; MOST_LANES];
        self.to_array(&mut values);
        for value in &mut values {
            if value.abs() > limit {
                *value = period.wrap(*value);
            }
        }
        Self::from_array(&values)
    }

    /// `self - whole * step`, exact where the result is at most a few steps.
    #[inline(always)]
    fn remainder(self, whole: Self, step: Self) -> Self {
        if Self::FUSED {
            return whole.neg_mul_add(step, self);
        }
        let product = whole * step;
        (self - product) - whole.product_rest(step, product)
    }

    /// The integer nearest to each lane, below 2^51.
    #[inline(always)]
    fn round(self) -> Self {
        (self + Self::splat(ROUNDER)) - Self::splat(ROUNDER)
    }
}
