//! Errors held against what is expected of them, while they are summed.
//!
//! In a segment of the circle a series is a polynomial, over the products of Chebyshev
//! polynomials that the moments are taken over. Readings that wait for others of their segment
//! share it: how far the farthest is off costs them a dozen operations in registers.

use std::f64::consts::PI;

use super::row::{Row, RowWeights};
use super::segment::{LANES, fold};
use crate::chebyshev::jacobi_anger;
use crate::simd::Lanes;

/// Terms of a polynomial: of the highest order they miss less than a part in 1e9.
pub(super) const TERMS: usize = 8;

/// Terms of a series that are looked at for what the polynomials miss.
const ALL_TERMS: usize = 16;

/// A series of the angle, segment by segment.
#[derive(Clone, Debug)]
pub struct Expected {
    polynomials: Vec<[f64; TERMS]>,
    missed: f64,
}

impl Expected {
    /// `constant + sum of A cos(k x) + B sin(k x)` over so many segments of the turn of `x`;
    /// `A, B` of each of `orders` in turn.
    pub fn new(segments: usize, constant: f64, orders: &[u32], coefficients: &[f64]) -> Self {
        let half_width = PI / segments as f64;
        let mut polynomials = vec![[0.0; TERMS]; segments];
        let mut missed = 0.0;
        // The segment i is centred at (2 i + 1) half_width - pi, the same place in another turn.
        let centres: Vec<_> = (0..2 * segments)
            .map(|i| (half_width * i as f64).sin_cos())
            .collect();
        for (&order, pair) in orders.iter().zip(coefficients.chunks_exact(2)) {
            let order = order as usize;
            let terms: [f64; ALL_TERMS] = jacobi_anger(half_width * order as f64);
            let rest: f64 = terms[TERMS..].iter().map(|term| term.abs()).sum();
            missed += rest * pair[0].hypot(pair[1]);
            let sign = if order.is_multiple_of(2) { 1.0 } else { -1.0 };
            for (i, polynomial) in polynomials.iter_mut().enumerate() {
                let (s, c) = centres[order * (2 * i + 1) % (2 * segments)];
                // The series at the centre, and a quarter of a turn of its order on.
                let here = sign * (pair[0] * c + pair[1] * s);
                let on = sign * (pair[1] * c - pair[0] * s);
                let signs = [here, on, -here, -on];
                for (j, value) in polynomial.iter_mut().enumerate() {
                    *value += signs[j % 4] * terms[j];
                }
            }
        }
        for polynomial in &mut polynomials {
            polynomial[0] += constant;
            fold(polynomial);
        }
        Self {
            polynomials,
            missed,
        }
    }

    /// What the polynomials miss of the series, at most.
    pub fn missed(&self) -> f64 {
        self.missed
    }
}

/// How far readings are off what is expected of them.
#[derive(Default)]
pub(super) struct Watch<'a> {
    /// What is expected; None where nobody asks.
    pub(super) expected: Option<&'a Expected>,
    /// How far the farthest reading of positive weight is off.
    pub(super) farthest: f64,
}

impl Watch<'_> {
    /// Looks at the first `len` readings of a row of this segment, whole vectors of them.
    #[inline(always)]
    pub(super) fn look<L: Lanes>(
        &mut self,
        segment: usize,
        row: &Row,
        len: usize,
        weights: &RowWeights,
    ) {
        let Some(expected) = self.expected else {
            return;
        };
        let c = &expected.polynomials[segment];
        let one = L::splat(-1.0);
        for i in (0..len).step_by(L::N) {
            let (t1, y) = row.lanes::<L>(i);
            let t2 = (t1 + t1).mul_add(t1, one);
            let t4 = (t2 + t2).mul_add(t2, one);
            let low = quarter::<L>(c, 2, t1).mul_add(t2, quarter::<L>(c, 0, t1));
            let high = quarter::<L>(c, 6, t1).mul_add(t2, quarter::<L>(c, 4, t1));
            let off = y - high.mul_add(t4, low);
            if off.any_beyond(self.farthest) {
                self.note(off, &weights[i..i + L::N]);
            }
        }
    }

    /// Some reading is farther off than all before it.
    #[cold]
    #[inline(never)]
    fn note<L: Lanes>(&mut self, off: L, weights: &[f64]) {
        let mut values = [0.0; LANES];
        off.to_array(&mut values);
        for (off, weight) in values.iter().zip(weights) {
            if *weight > 0.0 {
                self.farthest = self.farthest.max(off.abs());
            }
        }
    }
}

/// Two terms of a polynomial, from the `j`-th.
#[inline(always)]
fn quarter<L: Lanes>(c: &[f64; TERMS], j: usize, t1: L) -> L {
    L::splat(c[j + 1]).mul_add(t1, L::splat(c[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Polynomials are the series to what they say they miss.
    #[test]
    fn polynomials_are_the_series() {
        /// Rounding of sums of a dozen numbers around 1.
        const ROUNDING: f64 = 1e-14;
        let (orders, coefficients) = ([1, 2, 17], [0.3, -0.7, 0.0, 0.2, 0.4, 0.1]);
        let segments = 112;
        let expected = Expected::new(segments, 0.25, &orders, &coefficients);
        assert!(expected.missed() > 0.0 && expected.missed() < 1e-9);
        for i in 0..segments {
            for u in [-1.0, -0.4, 0.0, 0.7, 1.0f64] {
                let x = (2.0 * i as f64 + 1.0 + u) * PI / segments as f64 - PI;
                let series = orders.iter().zip(coefficients.chunks_exact(2));
                let series: f64 = series
                    .map(|(&k, pair)| {
                        let (s, c) = (f64::from(k) * x).sin_cos();
                        pair[0] * c + pair[1] * s
                    })
                    .sum();
                let powers = [u, 2.0 * u * u - 1.0, 8.0 * u.powi(4) - 8.0 * u * u + 1.0];
                let product = |j: usize| -> f64 {
                    let bits = (0..3).filter(|bit| j >> bit & 1 == 1);
                    bits.map(|bit| powers[bit]).product()
                };
                let terms = expected.polynomials[i].iter().enumerate();
                let found: f64 = terms.map(|(j, c)| c * product(j)).sum();
                let off = (found - 0.25 - series).abs();
                assert!(off < expected.missed() + ROUNDING, "{i} {u}: {off}");
            }
        }
    }
}
