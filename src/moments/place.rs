//! Where on the circle a reading lies, and how far its error is from a centre.

use crate::angle::Period;

/// Adding it to a whole number below 2^52 leaves that number in the low bits.
const WHOLE: f64 = (1u64 << 52) as f64;

/// Division of a turn into `2 half` equal segments.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    turn: Wrap,
    half: f64,
    /// Added to a whole number from `-half` on, it leaves the number of the segment in the low bits.
    first: f64,
    scale: f64,
    scale_low: f64,
}

/// Reduction by whole turns; the products are exact thanks to fused multiply-adds.
#[derive(Clone, Copy, Debug)]
struct Wrap {
    inverse: f64,
    high: f64,
    low: f64,
}

impl Wrap {
    fn new(period: Period) -> Self {
        Self {
            inverse: 1.0 / period.value(),
            high: period.value(),
            low: period.low(),
        }
    }

    /// `x` minus the whole turns nearest to `near`.
    #[inline(always)]
    fn reduce(&self, x: f64, near: f64) -> f64 {
        let turns = (near * self.inverse).round_ties_even();
        (-turns).mul_add(self.low, (-turns).mul_add(self.high, x))
    }
}

impl Frame {
    /// `segments` (an even number) over one turn of `period`.
    pub fn new(period: Period, segments: usize) -> Self {
        let count = segments as f64;
        let scale = count / period.value();
        let rest = (-scale).mul_add(period.value(), count) - scale * period.low();
        Self {
            turn: Wrap::new(period),
            half: 0.5 * count,
            first: 0.5 * count + WHOLE,
            scale,
            scale_low: rest / period.value(),
        }
    }

    /// Segment of `x` and the place in it, from -1 to 1.
    #[inline(always)]
    pub fn place(&self, x: f64) -> (u32, f64) {
        let rest = self.turn.reduce(x, x);
        let floor = clamp((rest * self.scale).floor(), -self.half, self.half - 1.0);
        let part = rest.mul_add(self.scale, -floor) + rest * self.scale_low;
        let segment = (floor + self.first).to_bits() as u32;
        (segment, clamp(part.mul_add(2.0, -1.0), -1.0, 1.0))
    }
}

/// `x` between two bounds, the lower one for NaN: no angle can leave the table.
#[inline(always)]
fn clamp(x: f64, low: f64, high: f64) -> f64 {
    // One instruction each: of equal numbers the processor takes the second, too.
    let x = if x > low { x } else { low };
    if x < high { x } else { high }
}

/// Errors are taken around a centre, modulo their own turn.
#[derive(Clone, Copy, Debug)]
pub struct Around {
    turn: Wrap,
    centre: f64,
}

impl Around {
    /// Errors in `(-period/2, period/2]` around `centre`.
    pub fn new(period: Period, centre: f64) -> Self {
        Self {
            turn: Wrap::new(period),
            centre,
        }
    }

    /// `indicated - reference - centre` without whole turns.
    #[inline(always)]
    pub fn difference(&self, indicated: f64, reference: f64) -> f64 {
        let (difference, carry) = crate::angle::two_sum(indicated, -reference);
        let rest = self.turn.reduce(difference, difference - self.centre);
        (rest - self.centre) + carry
    }
}
