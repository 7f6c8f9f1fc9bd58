//! Piecewise polynomials over one turn: the cost of a sample does not depend on the series.

use std::sync::Arc;

use super::segments::Segments;
use super::sweep::{Map, Sweep};
use super::{Batch, Real, Sample};
use crate::angle::Period;
use crate::simd::{InstructionSet, Lanes, MOST_LANES, Row, dispatch};
use crate::simd::{Portable, TARGET_FUSES};

/// Degree of the polynomials: a row of coefficients fills a cache line.
pub const DEGREE: usize = 7;

/// Most segments: 8 MiB of rows, beyond which memory would be slower than the exact path.
pub const MOST_SEGMENTS: usize = 1 << 17;

/// A periodic function, as polynomials in `u`, which runs from -1 to 1 over a segment.
#[derive(Clone, Debug)]
pub struct Table {
    rows: Vec<Row>,
    segments: Segments,
    bound: f64,
}

/// One sample at a time, on the processor that [`Table::scalar_subtract`] found.
pub type Scalar = unsafe fn(&Table, f64) -> f64;

/// A sample of each of several tables, likewise.
pub type Together = unsafe fn(&[Arc<Table>], &mut [f64]);

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
        Self {
            segments: Segments::new(rows.len(), period),
            rows,
            bound,
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
        self.segments.period()
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

    /// The function that does what `values` does, to the last bit, to one sample. It may be
    /// called on this processor.
    pub fn scalar_value(set: InstructionSet) -> Scalar {
        Self::scalar::<false>(set)
    }

    /// Likewise for `subtract`.
    pub fn scalar_subtract(set: InstructionSet) -> Scalar {
        Self::scalar::<true>(set)
    }

    /// Likewise of a sample of each of several tables, which do not wait for each other.
    pub fn each_subtract(set: InstructionSet) -> Together {
        #[inline(always)]
        fn each<const FUSED: bool>(tables: &[Arc<Table>], samples: &mut [f64]) {
            for (table, sample) in tables.iter().zip(samples) {
                *sample = one::<true, FUSED>(table, *sample);
            }
        }

        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "fma")]
            fn fused(tables: &[Arc<Table>], samples: &mut [f64]) {
                each::<true>(tables, samples);
            }
            if set.is_available() && set.fuses() {
                return fused;
            }
        }
        let _ = set;
        each::<TARGET_FUSES>
    }

    fn scalar<const SUBTRACT: bool>(set: InstructionSet) -> Scalar {
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "fma")]
            fn fused<const SUBTRACT: bool>(table: &Table, x: f64) -> f64 {
                one::<SUBTRACT, true>(table, x)
            }
            if set.is_available() && set.fuses() {
                return fused::<SUBTRACT>;
            }
        }
        let _ = set;
        one::<SUBTRACT, TARGET_FUSES>
    }

    /// Value and derivative at `offset` from the centre of `segment`: for building the
    /// inverse, whose angles must be known better than a double around `period` is.
    pub fn at(&self, segment: usize, offset: f64) -> (f64, f64) {
        let (place, u) = self.segments.at(segment, offset);
        let row = &self.rows[place].0;
        let (mut value, mut slope) = (row[DEGREE], 0.0);
        for &c in row[..DEGREE].iter().rev() {
            slope = u * slope + value;
            value = u * value + c;
        }
        (value, slope * self.segments.per_half())
    }
}

#[inline(always)]
fn one<const SUBTRACT: bool, const FUSED: bool>(table: &Table, x: f64) -> f64 {
    let [lane] = Lookup::<SUBTRACT>(table).map([Portable::<1, FUSED>::splat(x)]);
    let mut values = [0.0; MOST_LANES];
    lane.to_array(&mut values);
    values[0]
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
            let value = self.0.value(x);
            *result = if SUBTRACT { x - value } else { value };
        }
        results
    }
}

impl Table {
    #[inline(always)]
    fn value<L: Lanes>(&self, x: L) -> L {
        let (place, u) = self.segments.locate(x);
        let (square, mask) = (u * u, self.segments.mask());
        // SAFETY: the mask is the number of rows less one.
        let [c0, c1, c2, c3] =
            unsafe { L::fold_rows(place, mask, self.rows.as_ptr(), square * square) };
        c3.mul_add(u, c2).mul_add(square, c1.mul_add(u, c0))
    }
}
