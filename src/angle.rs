//! One turn, and the exact place of an angle within it.
//!
//! `x - n * period` is formed with fused multiply-adds, so an angle a million
//! turns away from zero keeps every digit it had.

use std::f64::consts::TAU;

use crate::error::Error;

/// `2 pi - TAU`: what the double nearest to `2 pi` misses.
const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;

/// Beyond this many turns a double no longer carries a place within the turn.
const MANY_TURNS: f64 = (1u64 << 51) as f64;

/// Turns that anybody measures in: within these, no product of a few of them overflows.
const PERIODS: std::ops::RangeInclusive<f64> = 1e-30..=1e30;

/// The length of one turn in the unit of the angles, as an unevaluated sum.
///
/// The double nearest to `2 pi` stands for `2 pi` itself; any other value is exact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Period {
    high: f64,
    low: f64,
}

impl Period {
    /// One turn of angles in radians.
    pub const RADIANS: Self = Self {
        high: TAU,
        low: TAU_LOW,
    };

    /// One turn of `value` units: `TAU`, 360, 1, or the counts per turn.
    pub fn new(value: f64) -> Result<Self, Error> {
        if !PERIODS.contains(&value) {
            return Err(Error::Period(value));
        }
        let low = if value == TAU { TAU_LOW } else { 0.0 };
        Ok(Self { high: value, low })
    }

    /// The nearest double.
    pub fn value(self) -> f64 {
        self.high
    }

    /// What `value` misses of the true turn.
    pub fn low(self) -> f64 {
        self.low
    }

    /// One turn of a shaft of `cycles` per turn.
    pub fn divided(self, cycles: f64) -> Self {
        let high = self.high / cycles;
        let low = (high.mul_add(-cycles, self.high) + self.low) / cycles;
        Self { high, low }
    }

    /// Whole turns nearest to `x`, and the rest as an unevaluated sum.
    #[inline(always)]
    fn reduce(self, x: f64) -> (f64, f64, f64) {
        let turns = (x / self.high).round_ties_even();
        if turns.abs() > MANY_TURNS {
            let rest = x % self.high;
            let turn = (rest / self.high).round_ties_even();
            return (0.0, rest - turn * self.high, 0.0);
        }
        let rest = turns.mul_add(-self.high, x);
        let (sum, carry) = two_sum(rest, -turns * self.low);
        (turns, sum, carry)
    }

    /// `x` moved by whole turns into `(-period/2, period/2]`.
    #[inline(always)]
    pub fn wrap(self, x: f64) -> f64 {
        let (_, rest, carry) = self.reduce(x);
        let half = 0.5 * self.high;
        let wrapped = rest + carry;
        if wrapped <= -half {
            wrapped + self.high
        } else if wrapped > half {
            wrapped - self.high
        } else {
            wrapped
        }
    }

    /// Phase of a shaft of `cycles` per turn at angle `x`: a part of its own turn,
    /// in `[-1/2, 1/2]`, as an unevaluated sum whose error is far below an ulp.
    #[inline(always)]
    pub fn phase(self, x: f64, cycles: f64) -> (f64, f64) {
        let (turns, rest, carry) = self.reduce(x);
        let part = rest / self.high;
        let remainder = part.mul_add(-self.high, rest) + carry - part * self.low;
        let part_low = remainder / self.high;
        if cycles == 1.0 {
            return (part, part_low);
        }
        // cycles * (turns + part), each product kept whole by its own remainder.
        let (whole, whole_low) = two_product(cycles, turns);
        let (own, own_low) = two_product(cycles, part);
        let (sum, carry) = two_sum(whole - whole.round_ties_even(), own - own.round_ties_even());
        let low = carry + whole_low + own_low + cycles * part_low;
        let nearest = (sum + low).round_ties_even();
        fast_two_sum(sum - nearest, low)
    }

    /// Phase of order `order` of a shaft, from the shaft's own phase.
    #[inline(always)]
    pub fn harmonic(phase: (f64, f64), order: f64) -> (f64, f64) {
        let (product, low) = two_product(order, phase.0);
        let low = order.mul_add(phase.1, low);
        let nearest = (product + low).round_ties_even();
        fast_two_sum(product - nearest, low)
    }
}

/// Sine and cosine of a phase in parts of a turn.
#[inline(always)]
pub fn sin_cos_turns(phase: (f64, f64)) -> (f64, f64) {
    let (angle, low) = two_product(phase.0, TAU);
    let low = phase.1.mul_add(TAU, phase.0.mul_add(TAU_LOW, low));
    let (sine, cosine) = angle.sin_cos();
    // First-order step by the low part: |low| < 4e-16, its square vanishes.
    (low.mul_add(cosine, sine), (-low).mul_add(sine, cosine))
}

/// `a + b` as sum and remainder (Knuth).
#[inline(always)]
pub fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    let part = sum - a;
    (sum, (a - (sum - part)) + (b - part))
}

/// `a + b` as sum and remainder for `|a| >= |b|` (Dekker).
#[inline(always)]
pub fn fast_two_sum(a: f64, b: f64) -> (f64, f64) {
    let sum = a + b;
    (sum, b - (sum - a))
}

/// `a * b` as product and remainder.
#[inline(always)]
pub fn two_product(a: f64, b: f64) -> (f64, f64) {
    let product = a * b;
    (product, a.mul_add(b, -product))
}
