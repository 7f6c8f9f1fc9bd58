//! Phases of shafts, and their sines and cosines, several at once.

use std::f64::consts::TAU;

use crate::angle::Period;
use crate::simd::Lanes;

/// `2 pi - TAU`.
const TAU_LOW: f64 = 2.449_293_598_294_706_4e-16;

/// A phase in turns as an unevaluated sum, as [`Period::phase`] gives it.
#[derive(Clone, Copy)]
pub struct Phase<L> {
    high: L,
    low: L,
}

impl<L: Lanes> Phase<L> {
    /// The same phase in every lane.
    #[inline(always)]
    pub fn splat(turns: f64) -> Self {
        Self {
            high: L::splat(turns),
            low: L::splat(0.0),
        }
    }

    /// Phase at angle `x` of a shaft of `cycles` per turn: a part of its own turn.
    #[inline(always)]
    pub fn new(period: Period, x: L, cycles: f64) -> Self {
        let one_turn = L::splat(period.value());
        let per_unit = L::splat(1.0 / period.value());
        let turns = (x * per_unit).round();
        let rest = x.remainder(turns, one_turn);
        let carry = L::splat(0.0) - turns * L::splat(period.low());
        // The quotient need not be exact: its remainder is added at once.
        let part = rest * per_unit;
        let product = part * one_turn;
        let remainder = (rest - product) - part.product_rest(one_turn, product);
        let remainder = part.neg_mul_add(L::splat(period.low()), remainder + carry);
        let output = Self::sum(part, remainder * per_unit);
        if cycles == 1.0 {
            return output;
        }
        let own = output.harmonic(cycles);
        if cycles.fract() == 0.0 {
            return own;
        }
        // Whole turns of the output are no whole turns of this shaft.
        let Self { high, low } = Self::splat(cycles).times(turns);
        let whole = high - high.round();
        let sum = whole + own.high;
        let part = sum - whole;
        let carry = (whole - (sum - part)) + (own.high - part);
        Self::within(sum, carry + low + own.low)
    }

    /// In parts of a turn, rounded.
    #[inline(always)]
    pub fn turns(self) -> L {
        self.high + self.low
    }

    /// Phase of order `order` of the shaft.
    #[inline(always)]
    pub fn harmonic(self, order: f64) -> Self {
        let order = L::splat(order);
        let Self { high, low } = self.times(order);
        Self::within(high, self.low.mul_add(order, low))
    }

    /// The high part times a factor, exactly.
    #[inline(always)]
    fn times(self, factor: L) -> Self {
        let high = self.high * factor;
        Self {
            high,
            low: self.high.product_rest(factor, high),
        }
    }

    /// Less its whole turns.
    #[inline(always)]
    fn within(high: L, low: L) -> Self {
        Self::sum(high - (high + low).round(), low)
    }

    /// With a low part below an ulp of the high part.
    #[inline(always)]
    fn sum(high: L, low: L) -> Self {
        let sum = high + low;
        Self {
            high: sum,
            low: low - (sum - high),
        }
    }
}

/// Sine and cosine of a phase within a turn, to about 1e-16.
///
/// The phase is `q` quarter turns and a rest of at most an eighth; the polynomials are
/// those of fdlibm (`__kernel_sin`, `__kernel_cos`), Copyright (C) 1993 by Sun
/// Microsystems, which permits free use of them.
#[inline(always)]
pub fn sin_cos<L: Lanes>(phase: Phase<L>) -> (L, L) {
    let quarters = (phase.high * L::splat(4.0)).round();
    let rest = quarters.neg_mul_add(L::splat(0.25), phase.high);
    let x = rest * L::splat(TAU);
    let low = rest.product_rest(L::splat(TAU), x);
    let low = rest.mul_add(L::splat(TAU_LOW), low);
    let low = phase.low.mul_add(L::splat(TAU), low);

    let square = x * x;
    let sine = polynomial(
        square,
        [
            1.589_690_995_211_55e-10,
            -2.505_076_025_340_686_3e-8,
            2.755_731_370_707_006_8e-6,
            -1.984_126_982_985_795e-4,
            8.333_333_333_322_49e-3,
            -1.666_666_666_666_663_2e-1,
        ],
    );
    let cosine = polynomial(
        square,
        [
            -1.135_964_755_778_819_5e-11,
            2.087_572_321_298_175e-9,
            -2.755_731_435_139_066_3e-7,
            2.480_158_728_947_673e-5,
            -1.388_888_888_887_411e-3,
            4.166_666_666_666_66e-2,
        ],
    );
    // First-order steps by the low part, added to the small terms.
    let half = square * L::splat(0.5);
    let one = L::splat(1.0) - half;
    let lost = (L::splat(1.0) - one) - half;
    let sine_x = x + (square * x).mul_add(sine, low * one);
    let cosine_x = one + (square * square).mul_add(cosine, x.neg_mul_add(low, lost));

    // Turned by whole quarters: q = -2..2 has cosine 1 - q^2 (7 - q^2) / 6 and sine
    // q (4 - q^2) / 3, and products with -1, 0 and 1 are exact.
    let q2 = quarters * quarters;
    let turned_cosine = L::splat(1.0) - q2 * (L::splat(7.0) - q2) * L::splat(1.0 / 6.0);
    let turned_sine = quarters * (L::splat(4.0) - q2) * L::splat(1.0 / 3.0);
    (
        sine_x.mul_add(turned_cosine, cosine_x * turned_sine),
        sine_x.neg_mul_add(turned_sine, cosine_x * turned_cosine),
    )
}

/// Coefficients from the highest power down.
#[inline(always)]
fn polynomial<L: Lanes, const N: usize>(x: L, coefficients: [f64; N]) -> L {
    let mut sum = L::splat(coefficients[0]);
    for i in 1..N {
        sum = sum.mul_add(x, L::splat(coefficients[i]));
    }
    sum
}
