//! Lanes of AVX2 with FMA, and of AVX-512.

use std::arch::x86_64::*;
use std::ops::{Add, Mul, Sub};

use super::lanes::{Lanes, MOST_LANES, Quad, Row};

/// Four doubles.
#[derive(Clone, Copy)]
pub struct F64x4(__m256d);

/// Eight doubles.
#[derive(Clone, Copy)]
pub struct F64x8(__m512d);

// SAFETY of every intrinsic below: `dispatch` runs kernels over these types only on
// processors that have the instruction set.
macro_rules! operators {
    ($lanes:ident, $add:ident, $sub:ident, $mul:ident) => {
        impl Add for $lanes {
            type Output = Self;
            #[inline(always)]
            fn add(self, other: Self) -> Self {
                unsafe { Self($add(self.0, other.0)) }
            }
        }
        impl Sub for $lanes {
            type Output = Self;
            #[inline(always)]
            fn sub(self, other: Self) -> Self {
                unsafe { Self($sub(self.0, other.0)) }
            }
        }
        impl Mul for $lanes {
            type Output = Self;
            #[inline(always)]
            fn mul(self, other: Self) -> Self {
                unsafe { Self($mul(self.0, other.0)) }
            }
        }
    };
}
operators!(F64x4, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd);
operators!(F64x8, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd);

impl Lanes for F64x4 {
    const N: usize = 4;
    const FUSED: bool = true;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe { Self(_mm256_set1_pd(value)) }
    }

    #[inline(always)]
    fn from_array(values: &[f64; MOST_LANES]) -> Self {
        unsafe { Self(_mm256_loadu_pd(values.as_ptr())) }
    }

    #[inline(always)]
    fn to_array(self, values: &mut [f64; MOST_LANES]) {
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(_mm256_fmadd_pd(self.0, b.0, c.0)) }
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(_mm256_fnmadd_pd(self.0, b.0, c.0)) }
    }

    #[inline(always)]
    fn product_rest(self, b: Self, product: Self) -> Self {
        unsafe { Self(_mm256_fmsub_pd(self.0, b.0, product.0)) }
    }

    #[inline(always)]
    fn totals(vectors: [Self; 4]) -> [f64; 4] {
        let [a, b, c, d] = vectors;
        unsafe { totals(a.0, b.0, c.0, d.0) }
    }

    #[inline(always)]
    fn any_beyond(self, limit: f64) -> bool {
        unsafe {
            let magnitude = _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0);
            let beyond = _mm256_cmp_pd::<_CMP_GT_OQ>(magnitude, _mm256_set1_pd(limit));
            _mm256_movemask_pd(beyond) != 0
        }
    }

    /// Each row is loaded as two halves, the upper one folded onto the lower while still
    /// a row, and only four columns are transposed: half the shuffles.
    #[inline(always)]
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4] {
        unsafe {
            let index = _mm256_and_si256(
                _mm256_castpd_si256(whole.0),
                _mm256_set1_epi64x(mask as i64),
            );
            let mut place = [0u64; 4];
            _mm256_storeu_si256(place.as_mut_ptr().cast(), index);
            let r0 = fold_row(
                rows,
                place[0],
                _mm256_permute4x64_pd::<0b00_00_00_00>(high.0),
            );
            let r1 = fold_row(
                rows,
                place[1],
                _mm256_permute4x64_pd::<0b01_01_01_01>(high.0),
            );
            let r2 = fold_row(
                rows,
                place[2],
                _mm256_permute4x64_pd::<0b10_10_10_10>(high.0),
            );
            let r3 = fold_row(
                rows,
                place[3],
                _mm256_permute4x64_pd::<0b11_11_11_11>(high.0),
            );
            let (even_01, odd_01) = (_mm256_unpacklo_pd(r0, r1), _mm256_unpackhi_pd(r0, r1));
            let (even_23, odd_23) = (_mm256_unpacklo_pd(r2, r3), _mm256_unpackhi_pd(r2, r3));
            [
                Self(_mm256_permute2f128_pd::<0x20>(even_01, even_23)),
                Self(_mm256_permute2f128_pd::<0x20>(odd_01, odd_23)),
                Self(_mm256_permute2f128_pd::<0x31>(even_01, even_23)),
                Self(_mm256_permute2f128_pd::<0x31>(odd_01, odd_23)),
            ]
        }
    }

    /// Rows `i` and `i + 4` side by side; blocks of four are transposed.
    #[inline(always)]
    unsafe fn cubics(
        whole: [Self; 2],
        u: [Self; 2],
        mask: u64,
        rows: *const Quad,
    ) -> [f32; 2 * MOST_LANES] {
        unsafe {
            let mask = _mm256_set1_epi64x(mask as i64);
            let mut place = [0u64; 8];
            for i in 0..2 {
                let index = _mm256_and_si256(_mm256_castpd_si256(whole[i].0), mask);
                _mm256_storeu_si256(place.as_mut_ptr().add(4 * i).cast(), index);
            }
            let r0 = two_quads(rows, place[0], place[4]);
            let r1 = two_quads(rows, place[1], place[5]);
            let r2 = two_quads(rows, place[2], place[6]);
            let r3 = two_quads(rows, place[3], place[7]);
            let low_01 = _mm256_castps_pd(_mm256_unpacklo_ps(r0, r1));
            let high_01 = _mm256_castps_pd(_mm256_unpackhi_ps(r0, r1));
            let low_23 = _mm256_castps_pd(_mm256_unpacklo_ps(r2, r3));
            let high_23 = _mm256_castps_pd(_mm256_unpackhi_ps(r2, r3));
            let c0 = _mm256_castpd_ps(_mm256_unpacklo_pd(low_01, low_23));
            let c1 = _mm256_castpd_ps(_mm256_unpackhi_pd(low_01, low_23));
            let c2 = _mm256_castpd_ps(_mm256_unpacklo_pd(high_01, high_23));
            let c3 = _mm256_castpd_ps(_mm256_unpackhi_pd(high_01, high_23));
            let u = _mm256_set_m128(_mm256_cvtpd_ps(u[1].0), _mm256_cvtpd_ps(u[0].0));
            let value = _mm256_fmadd_ps(_mm256_fmadd_ps(c3, u, c2), u, c1);
            let value = _mm256_fmadd_ps(value, u, c0);
            let mut values = [0.0; 2 * MOST_LANES];
            _mm256_storeu_ps(values.as_mut_ptr(), value);
            values
        }
    }
}

impl Lanes for F64x8 {
    const N: usize = 8;
    const FUSED: bool = true;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        unsafe { Self(_mm512_set1_pd(value)) }
    }

    #[inline(always)]
    fn from_array(values: &[f64; MOST_LANES]) -> Self {
        unsafe { Self(_mm512_loadu_pd(values.as_ptr())) }
    }

    #[inline(always)]
    fn to_array(self, values: &mut [f64; MOST_LANES]) {
        unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(_mm512_fmadd_pd(self.0, b.0, c.0)) }
    }

    #[inline(always)]
    fn neg_mul_add(self, b: Self, c: Self) -> Self {
        unsafe { Self(_mm512_fnmadd_pd(self.0, b.0, c.0)) }
    }

    #[inline(always)]
    fn product_rest(self, b: Self, product: Self) -> Self {
        unsafe { Self(_mm512_fmsub_pd(self.0, b.0, product.0)) }
    }

    #[inline(always)]
    fn totals(vectors: [Self; 4]) -> [f64; 4] {
        unsafe {
            let [a, b, c, d] = vectors;
            totals(halves(a.0), halves(b.0), halves(c.0), halves(d.0))
        }
    }

    #[inline(always)]
    fn any_beyond(self, limit: f64) -> bool {
        unsafe {
            let magnitude = _mm512_abs_pd(self.0);
            _mm512_cmp_pd_mask::<_CMP_GT_OQ>(magnitude, _mm512_set1_pd(limit)) != 0
        }
    }

    /// As for four lanes, with rows `i` and `i + 4` side by side in one register.
    #[inline(always)]
    unsafe fn fold_rows(whole: Self, mask: u64, rows: *const Row, high: Self) -> [Self; 4] {
        unsafe {
            let index =
                _mm512_and_si512(_mm512_castpd_si512(whole.0), _mm512_set1_epi64(mask as i64));
            let mut place = [0u64; 8];
            _mm512_storeu_si512(place.as_mut_ptr().cast(), index);
            let r0 = fold_pair(rows, place[0], place[4], 0, high.0);
            let r1 = fold_pair(rows, place[1], place[5], 1, high.0);
            let r2 = fold_pair(rows, place[2], place[6], 2, high.0);
            let r3 = fold_pair(rows, place[3], place[7], 3, high.0);
            let (even_01, odd_01) = (_mm512_unpacklo_pd(r0, r1), _mm512_unpackhi_pd(r0, r1));
            let (even_23, odd_23) = (_mm512_unpacklo_pd(r2, r3), _mm512_unpackhi_pd(r2, r3));
            let lower = _mm512_setr_epi64(0, 1, 8, 9, 4, 5, 12, 13);
            let upper = _mm512_setr_epi64(2, 3, 10, 11, 6, 7, 14, 15);
            [
                Self(_mm512_permutex2var_pd(even_01, lower, even_23)),
                Self(_mm512_permutex2var_pd(odd_01, lower, odd_23)),
                Self(_mm512_permutex2var_pd(even_01, upper, even_23)),
                Self(_mm512_permutex2var_pd(odd_01, upper, odd_23)),
            ]
        }
    }

    /// As for four lanes, with four rows side by side.
    #[inline(always)]
    unsafe fn cubics(
        whole: [Self; 2],
        u: [Self; 2],
        mask: u64,
        rows: *const Quad,
    ) -> [f32; 2 * MOST_LANES] {
        unsafe {
            let mask = _mm512_set1_epi64(mask as i64);
            let mut place = [0u64; 16];
            for i in 0..2 {
                let index = _mm512_and_si512(_mm512_castpd_si512(whole[i].0), mask);
                _mm512_storeu_si512(place.as_mut_ptr().add(8 * i).cast(), index);
            }
            let r0 = four_quads(rows, [place[0], place[4], place[8], place[12]]);
            let r1 = four_quads(rows, [place[1], place[5], place[9], place[13]]);
            let r2 = four_quads(rows, [place[2], place[6], place[10], place[14]]);
            let r3 = four_quads(rows, [place[3], place[7], place[11], place[15]]);
            let low_01 = _mm512_castps_pd(_mm512_unpacklo_ps(r0, r1));
            let high_01 = _mm512_castps_pd(_mm512_unpackhi_ps(r0, r1));
            let low_23 = _mm512_castps_pd(_mm512_unpacklo_ps(r2, r3));
            let high_23 = _mm512_castps_pd(_mm512_unpackhi_ps(r2, r3));
            let c0 = _mm512_castpd_ps(_mm512_unpacklo_pd(low_01, low_23));
            let c1 = _mm512_castpd_ps(_mm512_unpackhi_pd(low_01, low_23));
            let c2 = _mm512_castpd_ps(_mm512_unpacklo_pd(high_01, high_23));
            let c3 = _mm512_castpd_ps(_mm512_unpackhi_pd(high_01, high_23));
            let low_u = _mm512_castps256_ps512(_mm512_cvtpd_ps(u[0].0));
            let u = _mm512_insertf32x8::<1>(low_u, _mm512_cvtpd_ps(u[1].0));
            let value = _mm512_fmadd_ps(_mm512_fmadd_ps(c3, u, c2), u, c1);
            let value = _mm512_fmadd_ps(value, u, c0);
            let mut values = [0.0; 2 * MOST_LANES];
            _mm512_storeu_ps(values.as_mut_ptr(), value);
            values
        }
    }
}

/// The sum of each of four vectors.
#[inline(always)]
unsafe fn totals(a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [f64; 4] {
    unsafe {
        let (ab, cd) = (_mm256_hadd_pd(a, b), _mm256_hadd_pd(c, d));
        let low = _mm256_permute2f128_pd::<0x20>(ab, cd);
        let high = _mm256_permute2f128_pd::<0x31>(ab, cd);
        let mut sums = [0.0; 4];
        _mm256_storeu_pd(sums.as_mut_ptr(), _mm256_add_pd(low, high));
        sums
    }
}

/// The sum of both halves of a vector.
#[inline(always)]
unsafe fn halves(vector: __m512d) -> __m256d {
    unsafe {
        let low = _mm512_castpd512_pd256(vector);
        _mm256_add_pd(low, _mm512_extractf64x4_pd::<1>(vector))
    }
}

/// The upper half of a row times `high`, on top of its lower half.
#[inline(always)]
unsafe fn fold_row(rows: *const Row, place: u64, high: __m256d) -> __m256d {
    unsafe {
        let row: *const f64 = rows.add(place as usize).cast();
        _mm256_fmadd_pd(high, _mm256_load_pd(row.add(4)), _mm256_load_pd(row))
    }
}

/// The same of two rows side by side, by lanes `lane` and `lane + 4` of `high`.
#[inline(always)]
unsafe fn fold_pair(
    rows: *const Row,
    first: u64,
    second: u64,
    lane: i64,
    high: __m512d,
) -> __m512d {
    unsafe {
        let first: *const f64 = rows.add(first as usize).cast();
        let second: *const f64 = rows.add(second as usize).cast();
        let (a, b) = (lane, lane + 4);
        _mm512_fmadd_pd(
            _mm512_permutexvar_pd(_mm512_setr_epi64(a, a, a, a, b, b, b, b), high),
            side_by_side(first.add(4), second.add(4)),
            side_by_side(first, second),
        )
    }
}

#[inline(always)]
unsafe fn side_by_side(first: *const f64, second: *const f64) -> __m512d {
    unsafe {
        let first = _mm512_castpd256_pd512(_mm256_load_pd(first));
        _mm512_insertf64x4::<1>(first, _mm256_load_pd(second))
    }
}

#[inline(always)]
unsafe fn quad(rows: *const Quad, place: u64) -> __m128 {
    unsafe { _mm_load_ps(rows.add(place as usize).cast()) }
}

#[inline(always)]
unsafe fn two_quads(rows: *const Quad, first: u64, second: u64) -> __m256 {
    unsafe {
        let first = _mm256_castps128_ps256(quad(rows, first));
        _mm256_insertf128_ps::<1>(first, quad(rows, second))
    }
}

#[inline(always)]
unsafe fn four_quads(rows: *const Quad, places: [u64; 4]) -> __m512 {
    unsafe {
        let all = _mm512_castps128_ps512(quad(rows, places[0]));
        let all = _mm512_insertf32x4::<1>(all, quad(rows, places[1]));
        let all = _mm512_insertf32x4::<2>(all, quad(rows, places[2]));
        _mm512_insertf32x4::<3>(all, quad(rows, places[3]))
    }
}
