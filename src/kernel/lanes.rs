//! Several doubles at once: the few operations kernels are written in.
//!
//! A kernel is one generic function over [`Lanes`]. [`dispatch`] compiles it once per
//! instruction set and runs the one asked for, so no build needs to know the processor
//! it will run on.

use std::ops::{Add, Mul, Sub};

#[cfg(not(target_arch = "aarch64"))]
use super::portable::Portable;
use super::portable::TARGET_FUSES;
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
/// which [`dispatch`] makes sure of.
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

/// An instruction set kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// Whatever the target always has (SSE2, NEON).
    Portable,
    /// 256-bit vectors with fused multiply-add.
    Avx2,
    /// 512-bit vectors.
    Avx512,
}

impl InstructionSet {
    /// The name used in paths.
    pub fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        let mut all = [Self::Portable, Self::Avx2, Self::Avx512].into_iter();
        all.find(|set| set.name() == name)
    }

    /// True when this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// True when it rounds a product and sum once.
    pub fn fuses(self) -> bool {
        self != Self::Portable || TARGET_FUSES
    }

    /// The fastest that this processor has.
    pub fn best() -> Self {
        [Self::Avx512, Self::Avx2]
            .into_iter()
            .find(|set| set.is_available())
            .unwrap_or(Self::Portable)
    }
}

/// Work that is written over any [`Lanes`].
pub trait Kernel {
    /// Does it. Implementations are `#[inline(always)]`, so that they are compiled within
    /// the function that enables the instruction set.
    fn run<L: Lanes>(self);
}

/// Runs a kernel on an instruction set, or on the portable one where that is not there.
pub fn dispatch<K: Kernel>(set: InstructionSet, kernel: K) {
    #[cfg(target_arch = "x86_64")]
    {
        use super::x86::{F64x4, F64x8};

        #[target_feature(enable = "avx512f,avx512dq,avx512vl,avx2,fma")]
        fn avx512<K: Kernel>(kernel: K) {
            kernel.run::<F64x8>();
        }

        #[target_feature(enable = "avx2,fma")]
        fn avx2<K: Kernel>(kernel: K) {
            kernel.run::<F64x4>();
        }

        // SAFETY: the processor has what the called function enables.
        match set {
            InstructionSet::Avx512 if set.is_available() => return unsafe { avx512(kernel) },
            InstructionSet::Avx2 if set.is_available() => return unsafe { avx2(kernel) },
            _ => {}
        }
    }
    let _ = set;
    // aarch64 always has NEON: there it is the portable set.
    #[cfg(target_arch = "aarch64")]
    kernel.run::<super::neon::F64x4>();
    #[cfg(not(target_arch = "aarch64"))]
    kernel.run::<Portable<4, TARGET_FUSES>>();
}
