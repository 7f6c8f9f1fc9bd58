//! Piecewise cubics in single precision: angles and results are f32.
//!
//! The place within a turn is found in double precision, so that neither a distant angle
//! nor a high order costs accuracy; what is looked up is a quarter of a [`Table`]'s row,
//! and twice as many samples fit into a vector.

use super::Batch;
use super::segments::Segments;
use super::table::{MOST_SEGMENTS, Table};
use crate::chebyshev;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, Quad, dispatch};

/// Degree of the polynomials.
pub const DEGREE: usize = 3;

/// Unit of rounding, `2^-24`: half of what 1 and the next number differ by.
pub const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;

/// Values beyond this leave too little room below the greatest f32.
const MOST: f64 = 1e30;

/// A periodic function, as cubics in `u`, which runs from -1 to 1 over a segment.
#[derive(Clone, Debug)]
pub struct Cubics {
    rows: Vec<Quad>,
    segments: Segments,
    bound: f64,
}

impl Cubics {
    /// Cubics through a table's values, in the fewest segments whose `interpolation(count)`,
    /// the greatest difference between the function and its cubic, is within `tolerance`;
    /// `None` where those are too many, or the values no numbers for an f32.
    pub fn new(
        table: &Table,
        tolerance: f64,
        interpolation: impl Fn(usize) -> f64,
    ) -> Option<Self> {
        let mut count = 8;
        while interpolation(count) > tolerance {
            count *= 2;
            if count > MOST_SEGMENTS {
                return None;
            }
        }
        let segments = Segments::new(count, table.period());
        let transform = chebyshev::transform();
        let points: [f64; DEGREE + 1] = chebyshev::points();
        let (half, fine) = (0.5 * segments.step(), table.segments());
        // A segment's centre in the segments of the table, and what is left over.
        let rest = table.period().value() / fine as f64 / count as f64;
        let (mut greatest, mut steepest) = (0.0f64, 0.0f64);
        let rows = (0..count).map(|n| {
            let (segment, over) = (n * fine / count, (n * fine % count) as f64 * rest);
            let values = points.map(|u| table.at(segment, over + u * half).0);
            let a = chebyshev::apply(&transform, &values);
            let c = [a[0] - a[2], a[1] - 3.0 * a[3], 2.0 * a[2], 4.0 * a[3]];
            let [c0, c1, c2, c3] = c.map(f64::abs);
            greatest = greatest.max(c0 + c1 + c2 + c3);
            steepest = steepest.max(c1 + 2.0 * c2 + 3.0 * c3);
            Quad(c.map(|c| c as f32))
        });
        let rows = rows.collect();
        // Rounded to f32: every coefficient and the result (`greatest`), `u`, the sums
        // within the rule of Horner and, without fused multiply-add, its products (each at
        // most `steepest`). Below the least normal number rounding is by that number's ulp.
        let rounding = 1.02 * ROUNDING * (2.0 * greatest + 3.0 * steepest)
            + 8.0 * f64::from(f32::MIN_POSITIVE) * f64::from(f32::EPSILON);
        (greatest <= MOST).then(|| Self {
            rows,
            bound: interpolation(count) + table.bound() + rounding,
            segments,
        })
    }

    /// What values may differ by from the function, rounding included.
    pub fn bound(&self) -> f64 {
        self.bound
    }

    /// Number of cubics.
    pub fn segments(&self) -> usize {
        self.segments.count()
    }

    /// Values of the function.
    pub fn values(&self, set: InstructionSet, batch: Batch<'_, f32, f32>) {
        dispatch(
            set,
            Sweep::<false> {
                cubics: self,
                batch,
            },
        );
    }

    /// Samples less the values of the function.
    pub fn subtract(&self, set: InstructionSet, batch: Batch<'_, f32, f32>) {
        dispatch(
            set,
            Sweep::<true> {
                cubics: self,
                batch,
            },
        );
    }
}

/// A batch through the cubics; subtracts from the samples where `SUBTRACT`.
struct Sweep<'c, 'b, const SUBTRACT: bool> {
    cubics: &'c Cubics,
    batch: Batch<'b, f32, f32>,
}

impl<const SUBTRACT: bool> Kernel for Sweep<'_, '_, SUBTRACT> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let (x, out, len) = (self.batch.input(), self.batch.output(), self.batch.len());
        let width = 2 * L::N;
        let mut start = 0;
        while start + width <= len {
            // SAFETY: `width` samples from `start` lie within the batch.
            unsafe { self.block::<L>(x.add(start), out.add(start), width) };
            start += width;
        }
        if start < len {
            // SAFETY: as many as are left.
            unsafe { self.block::<L>(x.add(start), out.add(start), len - start) };
        }
    }
}

impl<const SUBTRACT: bool> Sweep<'_, '_, SUBTRACT> {
    /// The first `some` of a block; the other samples are zero.
    #[inline(always)]
    unsafe fn block<L: Lanes>(&self, x: *const f32, out: *mut f32, some: usize) {
        let Cubics { rows, segments, .. } = self.cubics;
        let mut samples = [0.0f32; 2 * MOST_LANES];
        for i in 0..some {
            // SAFETY: the caller has `some` samples there.
            samples[i] = unsafe { x.add(i).read() };
        }
        let (mut low, mut high) = ([0.0; MOST_LANES], [0.0; MOST_LANES]);
        for i in 0..L::N {
            low[i] = f64::from(samples[i]);
            high[i] = f64::from(samples[L::N + i]);
        }
        let (low_place, low_u) = segments.locate(L::from_array(&low));
        let (high_place, high_u) = segments.locate(L::from_array(&high));
        let (places, u) = ([low_place, high_place], [low_u, high_u]);
        // SAFETY: the mask is the number of rows less one.
        let mut values = unsafe { L::cubics(places, u, segments.mask(), rows.as_ptr()) };
        if SUBTRACT {
            for i in 0..2 * L::N {
                values[i] = samples[i] - values[i];
            }
        }
        for i in 0..some {
            // SAFETY: the caller has `some` places there.
            unsafe { out.add(i).write(values[i]) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::table;
    use super::*;
    use crate::angle::Period;

    /// A function that is this cubic in every segment, and no table's error.
    fn cubics(c: [f64; DEGREE + 1]) -> Option<Cubics> {
        let mut expansion = [0.0; table::DEGREE + 1];
        expansion[0] = c[0] + 0.5 * c[2];
        expansion[1] = c[1] + 0.75 * c[3];
        expansion[2] = 0.5 * c[2];
        expansion[3] = 0.25 * c[3];
        let period = Period::new(8.0).unwrap();
        let table = Table::new((0..8).map(|_| expansion), 0.0, period, 0.0);
        Cubics::new(&table, 0.0, |_| 0.0)
    }

    /// A coefficient of a power k is rounded itself and in the result, and within the rule of
    /// Horner k times in each of three ways; whatever the signs are, they may all add up.
    #[test]
    fn the_bound_counts_the_roundings_of_every_coefficient() {
        let counted = |c: [f64; DEGREE + 1]| {
            let parts = c.iter().zip([2.0, 5.0, 8.0, 11.0]);
            parts.map(|(c, times)| c.abs() * times).sum::<f64>() * ROUNDING
        };
        for number in 0..81 {
            let c = [1, 3, 9, 27].map(|power| f64::from(number / power % 3 - 1));
            let (bound, least) = (cubics(c).unwrap().bound(), counted(c));
            // Below the least normal number rounding is by that number's ulp.
            assert!(
                bound >= least && bound < 1.03 * least + 1e-40,
                "{c:?} {bound}"
            );
        }
    }

    /// The greatest value that may come out decides, whichever coefficients it is of.
    #[test]
    fn values_beyond_single_precision_have_no_cubics() {
        for k in 0..=DEGREE {
            let mut c = [0.0; DEGREE + 1];
            for (size, is_there) in [(0.99 * MOST, true), (1.01 * MOST, false)] {
                c[k] = size;
                assert_eq!(cubics(c).is_some(), is_there, "{c:?}");
            }
        }
    }
}
