//! Lanes in plain Rust, for processors without a vector path of their own.
//!
//! Fused multiply-add is used where the target always has it (aarch64); elsewhere it
//! would be a slow library call, and products are kept exact by Dekker's splitting.

use std::ops::{Add, Mul, Sub};

use super::lanes::{Lanes, MOST_LANES, Row};

const N: usize = 4;
const FUSED: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

/// Four doubles.
#[derive(Clone, Copy)]
pub struct Portable([f64; N]);

impl Portable {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut result = self.0;
        for (a, b) in result.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(result)
    }
}

impl Add for Portable {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl Sub for Portable {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl Mul for Portable {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl Lanes for Portable {
    const N: usize = N;
    const FUSED: bool = FUSED;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn from_array(values: &[f64; MOST_LANES]) -> Self {
        Self(std::array::from_fn(|i| values[i]))
    }

    #[inline(always)]
    fn to_array(self, values: &mut [f64; MOST_LANES]) {
        values[..N].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        if FUSED {
            Self(std::array::from_fn(|i| self.0[i].mul_add(b.0[i], c.0[i])))
        } else {
            self * b + c
        }
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        if FUSED {
            Self(std::array::from_fn(|i| {
                (-self.0[i]).mul_add(b.0[i], c.0[i])
            }))
        } else {
            c - self * b
        }
    }

    #[inline(always)]
    fn product_rest(self, b: Self, product: Self) -> Self {
        if FUSED {
            return Self(std::array::from_fn(|i| {
                self.0[i].mul_add(b.0[i], -product.0[i])
            }));
        }
        let (a_high, a_low) = split(self);
        let (b_high, b_low) = split(b);
        a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    }

    #[inline(always)]
    fn any_beyond(self, limit: f64) -> bool {
        self.0.iter().any(|v| v.abs() > limit)
    }

    #[inline(always)]
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4] {
        let mut columns = [Self::splat(0.0); 4];
        for lane in 0..N {
            // SAFETY: the index is at most `mask`.
            let row = unsafe { &(*rows.add((whole.0[lane].to_bits() & mask) as usize)).0 };
            for (j, column) in columns.iter_mut().enumerate() {
                let (low, high) = (row[j], high.0[lane] * row[j + 4]);
                column.0[lane] = low + high;
            }
        }
        columns
    }
}

/// Halves of 26 bits whose products are exact (Veltkamp).
#[inline(always)]
fn split(a: Portable) -> (Portable, Portable) {
    let scaled = a * Portable::splat(134_217_729.0);
    let high = scaled - (scaled - a);
    (high, a - high)
}
