//! A turn divided into equal segments, and the place of an angle among them.

use crate::angle::Period;
use crate::simd::{Lanes, ROUNDER};

/// Segments an angle may be away from zero: its place within a segment is exact, and `u`
/// exceeds 1 by at most `FAR_SEGMENTS * 2^-52`, which `OVERSHOOT` allows for.
const FAR_SEGMENTS: f64 = (1u64 << 40) as f64;

/// Growth of `T_8(u)` from `|u| = 1` to `1 + 2^-12`: `cosh(8 acosh(1 + 2^-12)) < 1.016`.
pub const OVERSHOOT: f64 = 1.016;

/// Segment `n` of a power of two of them is centred on `n * period / count`.
#[derive(Clone, Debug)]
pub struct Segments {
    count: usize,
    period: Period,
    /// Width of a segment, and what the double misses of it.
    step: f64,
    step_low: f64,
    /// Segments per unit of the angle, and half segments.
    per_unit: f64,
    per_half: f64,
    /// Angles beyond this are moved into one turn first.
    far: f64,
}

impl Segments {
    /// So many segments, a power of two.
    pub fn new(count: usize, period: Period) -> Self {
        assert!(count.is_power_of_two());
        let segments = count as f64;
        let step = period.value() / segments;
        Self {
            count,
            period,
            step,
            step_low: period.low() / segments,
            per_unit: segments / period.value(),
            per_half: 2.0 / step,
            far: FAR_SEGMENTS * step,
        }
    }

    /// Number of segments.
    #[inline(always)]
    pub fn count(&self) -> usize {
        self.count
    }

    /// One turn in the unit of the angles.
    pub fn period(&self) -> Period {
        self.period
    }

    /// Width of a segment.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// What takes the segment out of the low bits of a place.
    #[inline(always)]
    pub fn mask(&self) -> u64 {
        self.count as u64 - 1
    }

    /// The place of each angle: a number whose low bits hold the segment, as
    /// [`Lanes::fold_rows`] takes it, and `u`, which runs from -1 to 1 over the segment.
    #[inline(always)]
    pub fn locate<L: Lanes>(&self, x: L) -> (L, L) {
        let x = if x.any_beyond(self.far) {
            x.wrap_beyond(self.far, self.period)
        } else {
            x
        };
        let whole = x.mul_add(L::splat(self.per_unit), L::splat(ROUNDER));
        let n = whole - L::splat(ROUNDER);
        let rest = x.remainder(n, L::splat(self.step));
        let rest = n.neg_mul_add(L::splat(self.step_low), rest);
        (whole, rest * L::splat(self.per_half))
    }

    /// The segment and `u` at `offset` from the centre of `segment`.
    pub fn at(&self, segment: usize, offset: f64) -> (usize, f64) {
        let away = (offset * self.per_unit).round_ties_even();
        let place = (segment as i64 + away as i64).rem_euclid(self.count as i64);
        let u = away.mul_add(-self.step, offset) * self.per_half;
        (place as usize, u)
    }

    /// What a derivative by `u` is multiplied by to be one by the angle.
    pub fn per_half(&self) -> f64 {
        self.per_half
    }
}
