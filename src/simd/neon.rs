//! Lanes of NEON, which every aarch64 processor has: two registers side by side.

use std::arch::aarch64::*;
use std::ops::{Add, Mul, Sub};

use super::lanes::{Lanes, MOST_LANES, Quad, Row};

/// Four doubles.
#[derive(Clone, Copy)]
pub struct F64x4(float64x2_t, float64x2_t);

// SAFETY of every intrinsic below: NEON belongs to the target.
macro_rules! operators {
    ($($trait:ident $method:ident $intrinsic:ident),*) => {$(
        impl $trait for F64x4 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                unsafe { Self($intrinsic(self.0, other.0), $intrinsic(self.1, other.1)) }
            }
        }
    )*};
}
operators!(Add add vaddq_f64, Sub sub vsubq_f64, Mul mul vmulq_f64);

impl Lanes for F64x4 {
    const N: usize = 4;
    const FUSED: bool = true;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe { Self(vdupq_n_f64(value), vdupq_n_f64(value)) }
    }

    #[inline(always)]
    fn from_array(values: &[f64; MOST_LANES]) -> Self {
        let start = values.as_ptr();
        unsafe { Self(vld1q_f64(start), vld1q_f64(start.add(2))) }
    }

    #[inline(always)]
    fn to_array(self, values: &mut [f64; MOST_LANES]) {
        let start = values.as_mut_ptr();
        unsafe {
            vst1q_f64(start, self.0);
            vst1q_f64(start.add(2), self.1);
        }
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(vfmaq_f64(c.0, self.0, b.0), vfmaq_f64(c.1, self.1, b.1)) }
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(vfmsq_f64(c.0, self.0, b.0), vfmsq_f64(c.1, self.1, b.1)) }
    }

    #[inline(always)]
    fn product_rest(self, b: Self, product: Self) -> Self {
        self.mul_add(b, Self::splat(0.0) - product)
    }

    #[inline(always)]
    fn any_beyond(self, limit: f64) -> bool {
        unsafe {
            let limit = vdupq_n_f64(limit);
            let beyond = vorrq_u64(vcagtq_f64(self.0, limit), vcagtq_f64(self.1, limit));
            vmaxvq_u32(vreinterpretq_u32_u64(beyond)) != 0
        }
    }

    /// Pairs of columns of two rows, folded while still rows, are transposed.
    #[inline(always)]
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4] {
        unsafe {
            let place = places(whole, mask);
            let [a0, a2] = fold_row::<0>(rows, place[0], high.0);
            let [b0, b2] = fold_row::<1>(rows, place[1], high.0);
            let [c0, c2] = fold_row::<0>(rows, place[2], high.1);
            let [d0, d2] = fold_row::<1>(rows, place[3], high.1);
            [
                Self(vzip1q_f64(a0, b0), vzip1q_f64(c0, d0)),
                Self(vzip2q_f64(a0, b0), vzip2q_f64(c0, d0)),
                Self(vzip1q_f64(a2, b2), vzip1q_f64(c2, d2)),
                Self(vzip2q_f64(a2, b2), vzip2q_f64(c2, d2)),
            ]
        }
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
            unsafe {
                let place = places(whole[i], mask);
                let r0 = quad(rows, place[0]);
                let r1 = quad(rows, place[1]);
                let r2 = quad(rows, place[2]);
                let r3 = quad(rows, place[3]);
                let even_01 = vreinterpretq_f64_f32(vtrn1q_f32(r0, r1));
                let odd_01 = vreinterpretq_f64_f32(vtrn2q_f32(r0, r1));
                let even_23 = vreinterpretq_f64_f32(vtrn1q_f32(r2, r3));
                let odd_23 = vreinterpretq_f64_f32(vtrn2q_f32(r2, r3));
                let c0 = vreinterpretq_f32_f64(vzip1q_f64(even_01, even_23));
                let c1 = vreinterpretq_f32_f64(vzip1q_f64(odd_01, odd_23));
                let c2 = vreinterpretq_f32_f64(vzip2q_f64(even_01, even_23));
                let c3 = vreinterpretq_f32_f64(vzip2q_f64(odd_01, odd_23));
                let u = vcvt_high_f32_f64(vcvt_f32_f64(u[i].0), u[i].1);
                let value = vfmaq_f32(c1, vfmaq_f32(c2, c3, u), u);
                vst1q_f32(values.as_mut_ptr().add(4 * i), vfmaq_f32(c0, value, u));
            }
        }
        values
    }
}

/// The segment of each lane.
#[inline(always)]
unsafe fn places(whole: F64x4, mask: u64) -> [usize; 4] {
    unsafe {
        let mask = vdupq_n_u64(mask);
        let low = vandq_u64(vreinterpretq_u64_f64(whole.0), mask);
        let high = vandq_u64(vreinterpretq_u64_f64(whole.1), mask);
        [
            vgetq_lane_u64::<0>(low) as usize,
            vgetq_lane_u64::<1>(low) as usize,
            vgetq_lane_u64::<0>(high) as usize,
            vgetq_lane_u64::<1>(high) as usize,
        ]
    }
}

/// The upper half of a row times lane `LANE` of `high`, on top of its lower half.
#[inline(always)]
unsafe fn fold_row<const LANE: i32>(
    rows: *const Row,
    place: usize,
    high: float64x2_t,
) -> [float64x2_t; 2] {
    unsafe {
        let row: *const f64 = rows.add(place).cast();
        [
            vfmaq_laneq_f64::<LANE>(vld1q_f64(row), vld1q_f64(row.add(4)), high),
            vfmaq_laneq_f64::<LANE>(vld1q_f64(row.add(2)), vld1q_f64(row.add(6)), high),
        ]
    }
}

#[inline(always)]
unsafe fn quad(rows: *const Quad, place: usize) -> float32x4_t {
    unsafe { vld1q_f32(rows.add(place).cast()) }
}
