//! Lanes in plain Rust, for processors without a vector path of their own.
//!
//! Fused multiply-add is used where the target always has it (aarch64); elsewhere it
//! would be a slow library call, and products are kept exact by Dekker's splitting.

use std::ops::{Add, Mul, Sub};

use super::lanes::{Lanes, MOST_LANES, Quad, Row};

/// True where the target always has fused multiply-add.
pub const TARGET_FUSES: bool = cfg!(any(target_arch = "aarch64", target_feature = "fma"));

/// `N` doubles, of a processor with or without fused multiply-add.
#[derive(Clone, Copy)]
pub struct Portable<const N: usize, const FUSED: bool>([f64; N]);

impl<const N: usize, const FUSED: bool> Portable<N, FUSED> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut result = self.0;
        for (a, b) in result.iter_mut().zip(other.0) {
            *a = f(*a, b);
        }
        Self(result)
    }
}

impl<const N: usize, const FUSED: bool> Add for Portable<N, FUSED> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.zip(other, |a, b| a + b)
    }
}

impl<const N: usize, const FUSED: bool> Sub for Portable<N, FUSED> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.zip(other, |a, b| a - b)
    }
}

impl<const N: usize, const FUSED: bool> Mul for Portable<N, FUSED> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.zip(other, |a, b| a * b)
    }
}

impl<const N: usize, const FUSED: bool> Lanes for Portable<N, FUSED> {
    const N: usize = N;
    const FUSED: bool = FUSED;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn from_array(values: &[f64; MOST_LANES]) -> Self {
        let mut lanes = [0.0; N];
        lanes.copy_from_slice(&values[..N]);
        Self(lanes)
    }

    #[inline(always)]
    fn to_array(self, values: &mut [f64; MOST_LANES]) {
        values[..N].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        let mut result = c;
        for i in 0..N {
            result.0[i] = mul_add::<FUSED>(self.0[i], b.0[i], c.0[i]);
        }
        result
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        let mut result = c;
        for i in 0..N {
            result.0[i] = mul_add::<FUSED>(-self.0[i], b.0[i], c.0[i]);
        }
        result
    }

    #[inline(always)]
    fn product_rest(self, b: Self, product: Self) -> Self {
        if FUSED {
            return self.mul_add(b, Self::splat(0.0) - product);
        }
        let (a_high, a_low) = split(self);
        let (b_high, b_low) = split(b);
        a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    }

    #[inline(always)]
    fn any_beyond(self, limit: f64) -> bool {
        let mut any = false;
        for value in self.0 {
            any |= value.abs() > limit;
        }
        any
    }

    #[inline(always)]
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4] {
        let mut columns = [Self::splat(0.0); 4];
        for lane in 0..N {
            // SAFETY: the index is at most `mask`.
            let row = unsafe { &(*rows.add((whole.0[lane].to_bits() & mask) as usize)).0 };
            for j in 0..4 {
                columns[j].0[lane] = mul_add::<FUSED>(high.0[lane], row[j + 4], row[j]);
            }
        }
        columns
    }

    #[inline(always)]
    unsafe fn cubics(
        whole: [Self; 2],
        u: [Self; 2],
        mask: u64,
        rows: *const Quad,
    ) -> [f32; 2 * MOST_LANES] {
        let mut values = [0.0; 2 * MOST_LANES];
        for i in 0..2 {
            for lane in 0..N {
                let u = u[i].0[lane] as f32;
                // SAFETY: the index is at most `mask`.
                let row = unsafe { &(*rows.add((whole[i].0[lane].to_bits() & mask) as usize)).0 };
                let mut value = row[3];
                for j in [2, 1, 0] {
                    value = if FUSED {
                        value.mul_add(u, row[j])
                    } else {
                        value * u + row[j]
                    };
                }
                values[i * N + lane] = value;
            }
        }
        values
    }
}

#[inline(always)]
fn mul_add<const FUSED: bool>(a: f64, b: f64, c: f64) -> f64 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

/// Halves of 26 bits whose products are exact (Veltkamp).
#[inline(always)]
fn split<L: Lanes>(a: L) -> (L, L) {
    let scaled = a * L::splat(134_217_729.0);
    let high = scaled - (scaled - a);
    (high, a - high)
}
