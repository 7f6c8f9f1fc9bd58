//! Piecewise polynomials over one turn: the cost of a sample does not depend on the series.

use super::lanes::{InstructionSet, Lanes, MOST_LANES, ROUNDER, Row, dispatch};
use super::portable::{Portable, TARGET_FUSES};
use super::sweep::{Map, Sweep};
use super::{Batch, Real, Sample};
use crate::angle::Period;

/// Degree of the polynomials: a row of coefficients fills a cache line.
pub const DEGREE: usize = 7;

/// Most segments: 8 MiB of rows, beyond which memory would be slower than the exact path.
pub const MOST_SEGMENTS: usize = 1 << 17;

/// Segments an angle may be away from zero: its place within a segment is exact, and `u`
/// exceeds 1 by at most `FAR_SEGMENTS * 2^-52`, which `OVERSHOOT` allows for.
const FAR_SEGMENTS: f64 = (1u64 << 40) as f64;

/// Growth of `T_8(u)` from `|u| = 1` to `1 + 2^-12`: `cosh(8 acosh(1 + 2^-12)) < 1.016`.
pub const OVERSHOOT: f64 = 1.016;

/// A periodic function, as polynomials in `u`, which runs from -1 to 1 over a segment.
/// Segment `n` is centred on `n * period / segments`.
#[derive(Clone, Debug)]
pub struct Table {
    rows: Vec<Row>,
    period: Period,
    bound: f64,
    /// Width of a segment, and what the double misses of it.
    step: f64,
    step_low: f64,
    /// Segments per unit of the angle, and half segments.
    per_unit: f64,
    per_half: f64,
    /// Angles beyond this are moved into one turn first.
    far: f64,
}

/// One sample at a time, on the processor that [`Table::scalar_subtract`] found.
pub type Scalar = unsafe fn(&Table, f64) -> f64;

impl Table {
    /// `constant` plus the Chebyshev expansion of each of a power of two of segments, which
    /// differs from the function by at most `bound`.
    pub fn new(
        expansions: impl Iterator<Item = [f64; DEGREE + 1]>,
        constant: f64,
        period: Period,
        bound: f64,
    ) -> Self {
        let rows: Vec<Row> = expansions.map(|a| by_powers(a, constant)).collect();
        assert!(rows.len().is_power_of_two());
        let segments = rows.len() as f64;
        let step = period.value() / segments;
        Self {
            rows,
            period,
            bound,
            step,
            step_low: period.low() / segments,
            per_unit: segments / period.value(),
            per_half: 2.0 / step,
            far: FAR_SEGMENTS * step,
        }
    }

    /// Number of polynomials.
    pub fn segments(&self) -> usize {
        self.rows.len()
    }

    /// What the polynomials may differ by from the function, rounding aside.
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// One turn in the unit of the angles.
    pub fn period(&self) -> Period {
        self.period
    }

    /// Values of the function.
    pub fn values<X: Sample, Y: Real>(&self, set: InstructionSet, batch: Batch<'_, X, Y>) {
        let map = Lookup::<false>(self);
        dispatch(set, Sweep { map, batch });
    }

    /// Samples less the values of the function.
    pub fn subtract<X: Sample, Y: Real>(&self, set: InstructionSet, batch: Batch<'_, X, Y>) {
        let map = Lookup::<true>(self);
        dispatch(set, Sweep { map, batch });
    }

    /// The function that does the same, to the last bit, to one sample. It may be called
    /// on this processor.
    pub fn scalar_subtract(set: InstructionSet) -> Scalar {
        #[inline(always)]
        fn subtract<const FUSED: bool>(table: &Table, x: f64) -> f64 {
            let [lane] = Lookup::<true>(table).map([Portable::<1, FUSED>::splat(x)]);
            let mut values = [0.0; MOST_LANES];
            lane.to_array(&mut values);
            values[0]
        }

        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "fma")]
            fn fused(table: &Table, x: f64) -> f64 {
                subtract::<true>(table, x)
            }
            if set.is_available() && set.fuses() {
                return fused;
            }
        }
        let _ = set;
        subtract::<TARGET_FUSES>
    }

    /// Value and derivative at `offset` from the centre of `segment`: for building the
    /// inverse, whose angles must be known better than a double around `period` is.
    pub fn at(&self, segment: usize, offset: f64) -> (f64, f64) {
        let away = (offset * self.per_unit).round_ties_even();
        let place = (segment as i64 + away as i64).rem_euclid(self.rows.len() as i64);
        let u = away.mul_add(-self.step, offset) * self.per_half;
        let row = &self.rows[place as usize].0;
        let (mut value, mut slope) = (row[DEGREE], 0.0);
        for &c in row[..DEGREE].iter().rev() {
            slope = u * slope + value;
            value = u * value + c;
        }
        (value, slope * self.per_half)
    }
}

/// `constant` plus a Chebyshev expansion, by powers of `u`.
fn by_powers(a: [f64; DEGREE + 1], constant: f64) -> Row {
    Row([
        a[0] - a[2] + a[4] - a[6] + constant,
        a[1] - 3.0 * a[3] + 5.0 * a[5] - 7.0 * a[7],
        2.0 * a[2] - 8.0 * a[4] + 18.0 * a[6],
        4.0 * a[3] - 20.0 * a[5] + 56.0 * a[7],
        8.0 * a[4] - 48.0 * a[6],
        16.0 * a[5] - 112.0 * a[7],
        32.0 * a[6],
        64.0 * a[7],
    ])
}

/// Looks samples up, and subtracts what it finds from them where `SUBTRACT`.
struct Lookup<'t, const SUBTRACT: bool>(&'t Table);

impl<const SUBTRACT: bool> Map for Lookup<'_, SUBTRACT> {
    const SIDE_BY_SIDE: bool = false;

    #[inline(always)]
    fn map<L: Lanes, const W: usize>(&self, x: [L; W]) -> [L; W] {
        let mut results = x;
        for result in &mut results {
            let x = *result;
            let near = if x.any_beyond(self.0.far) {
                x.wrap_beyond(self.0.far, self.0.period)
            } else {
                x
            };
            let value = self.0.value(near);
            *result = if SUBTRACT { x - value } else { value };
        }
        results
    }
}

impl Table {
    #[inline(always)]
    fn value<L: Lanes>(&self, x: L) -> L {
        let whole = x.mul_add(L::splat(self.per_unit), L::splat(ROUNDER));
        let n = whole - L::splat(ROUNDER);
        let rest = x.remainder(n, L::splat(self.step));
        let rest = n.neg_mul_add(L::splat(self.step_low), rest);
        let u = rest * L::splat(self.per_half);
        let square = u * u;
        let mask = self.rows.len() as u64 - 1;
        // SAFETY: the mask is the number of rows less one.
        let [c0, c1, c2, c3] =
            unsafe { L::fold_rows(whole, mask, self.rows.as_ptr(), square * square) };
        c3.mul_add(u, c2).mul_add(square, c1.mul_add(u, c0))
    }
}
