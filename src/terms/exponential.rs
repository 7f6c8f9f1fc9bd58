//! `exp` in a few operations that a compiler can take several readings through at once.

use crate::simd::ROUNDER;

/// The logarithm of 2 in two parts; multiples of the first one below 2^11 are exact (fdlibm).
const LN_2: (f64, f64) = (6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10);

/// Beyond it results are no normal doubles.
const FARTHEST: f64 = 708.0;

/// Taylor's coefficients from `1/2!` to `1/13!`: what is left out is 4e-18 of the result.
const COEFFICIENTS: [f64; 12] = {
    let mut coefficients = [0.0; 12];
    let (mut factorial, mut n) = (1.0, 2);
    while n < 14 {
        factorial *= n as f64;
        coefficients[n - 2] = 1.0 / factorial;
        n += 1;
    }
    coefficients
};

/// `exp(x)` to 4e-16 of it, held at its value for +-708; NaN of NaN.
#[inline(always)]
pub(super) fn exp(x: f64) -> f64 {
    let x = if x < -FARTHEST { -FARTHEST } else { x };
    let x = if x > FARTHEST { FARTHEST } else { x };
    let whole = x * std::f64::consts::LOG2_E + ROUNDER;
    let n = whole - ROUNDER;
    let rest = (x - n * LN_2.0) - n * LN_2.1;
    // In pairs of pairs (Estrin): one reading alone waits for few operations in a row.
    let (square, [a, b, c, d, e, f, g, h, i, j, k, l]) = (rest * rest, COEFFICIENTS);
    let fourth = square * square;
    let low = (a + b * rest) + (c + d * rest) * square;
    let middle = (e + f * rest) + (g + h * rest) * square;
    let high = (i + j * rest) + (k + l * rest) * square;
    let sum = low + (middle + high * fourth) * fourth;
    let sum = 1.0 + (rest + square * sum);
    // The integer stands in the low bits: into the exponent with it.
    let power = f64::from_bits((whole.to_bits() << 52).wrapping_add(1.0f64.to_bits()));
    sum * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponentials_are_those_of_the_standard_library() {
        for i in -7080..=7080 {
            let x = f64::from(i) * 0.099_99;
            let (own, std) = (exp(x), x.exp());
            assert!(
                (own - std).abs() <= 2.5 * f64::EPSILON * std,
                "{x}: {own} {std}"
            );
        }
        let one = exp;
        assert_eq!((one(0.0), one(-1e300)), (1.0, one(-708.0)));
        assert!(one(f64::NAN).is_nan() && one(-f64::INFINITY) < 1e-300);
    }
}
