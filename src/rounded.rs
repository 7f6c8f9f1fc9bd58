//! Errors of readings that were rounded: normal numbers of which only the interval is known.
//!
//! A reading rounded to whole steps `q` that a fit leaves `e` of holds its own error to
//! `[e - q/2, e + q/2]`. What is expected of it there is the mean of a normal number between two
//! limits `a` and `b` (in standard deviations),
//!
//! ```text
//! E[x] = (φ(a) - φ(b))/(Φ(b) - Φ(a)),    E[x²] = 1 + (a φ(a) - b φ(b))/(Φ(b) - Φ(a)).
//! ```

use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// Limit from which on the tail is told by its continued fraction: below, `erfc` is exact; above,
/// so many terms are.
const FAR: f64 = 5.0;
const TERMS: u32 = 40;

/// What is expected of the errors of readings.
#[derive(Clone, Debug)]
pub struct Rounded {
    /// Of every reading, in the unit of the readings.
    pub error: Vec<f64>,
    /// Sum of the expected squares.
    pub squares: f64,
    /// Logarithm of the likelihood: of the chance of every reading's step.
    pub log_likelihood: f64,
}

/// Errors of readings that a fit leaves `left` of, rounded to whole steps; `sigma` is that of the
/// noise before.
pub fn rounded(left: &[f64], step: f64, sigma: f64) -> Rounded {
    let half = 0.5 * step / sigma;
    let mut found = Rounded {
        error: Vec::with_capacity(left.len()),
        squares: 0.0,
        log_likelihood: 0.0,
    };
    for e in left {
        let at = e / sigma;
        // The mean lies on the side of the reading: seen from there its step is far out.
        let [mean, square, log_chance] = between(at.abs() - half, at.abs() + half);
        found.error.push(sigma * mean * at.signum());
        found.squares += sigma * sigma * square;
        found.log_likelihood += log_chance;
    }
    found
}

/// Errors drawn at random among those that the readings' steps allow, one for each of the shares
/// `at` in (0, 1): all together they are normal where the fit and `sigma` are right.
pub fn drawn(left: &[f64], step: f64, sigma: f64, at: &[f64]) -> Vec<f64> {
    let half = 0.5 * step / sigma;
    let each = left.iter().zip(at).map(|(e, &share)| {
        let away = (e / sigma).abs();
        sigma * drawn_between(away - half, away + half, share) * e.signum()
    });
    each.collect()
}

/// Number at a share of the chance of those between `a` and `b`, from `a` on.
fn drawn_between(a: f64, b: f64, share: f64) -> f64 {
    let beyond_b = tail(b).0;
    if a >= 0.0 {
        let beyond_a = tail(a).0;
        let log_beyond = beyond_a + (share * (beyond_b - beyond_a).exp_m1()).ln_1p();
        return inverse_tail(log_beyond).clamp(a, b);
    }
    let below_a = tail(-a).0.exp();
    let below = below_a + share * (1.0 - below_a - beyond_b.exp());
    let x = if below < 0.5 {
        -inverse_tail(below.ln())
    } else {
        inverse_tail((1.0 - below).ln())
    };
    x.clamp(a, b)
}

/// Number `x >= 0` of which the logarithm of the chance to lie beyond is this one.
fn inverse_tail(log_beyond: f64) -> f64 {
    let mut x = (-2.0 * (log_beyond + std::f64::consts::LN_2))
        .max(0.0)
        .sqrt();
    // Newton: the logarithm falls ever faster, so that the first step may go too far and no other.
    for _ in 0..20 {
        let (found, hazard) = tail(x);
        let change = (found - log_beyond) / hazard;
        x = (x + change).max(0.0);
        if change.abs() < 1e-12 * (1.0 + x) {
            break;
        }
    }
    x
}

/// Mean, mean square and logarithm of the chance of a normal number between `a` and `b`, of which
/// `b` is the farther from zero.
fn between(a: f64, b: f64) -> [f64; 3] {
    let (beyond_b, hazard_b) = tail(b);
    if a < 0.0 {
        let (beyond_a, hazard_a) = tail(-a);
        let (qa, qb) = (beyond_a.exp(), beyond_b.exp());
        let chance = 1.0 - qa - qb;
        let (at_a, at_b) = (hazard_a * qa, hazard_b * qb);
        let mean = (at_a - at_b) / chance;
        return [mean, 1.0 + (a * at_a - b * at_b) / chance, chance.ln()];
    }
    let (beyond_a, hazard_a) = tail(a);
    let ratio = (beyond_b - beyond_a).exp();
    let share = -(beyond_b - beyond_a).exp_m1();
    let mean = (hazard_a - ratio * hazard_b) / share;
    let square = 1.0 + (a * hazard_a - ratio * b * hazard_b) / share;
    [mean, square, beyond_a + share.ln()]
}

/// Logarithm of the chance that a normal number lies beyond `x >= 0`, and its density over that.
fn tail(x: f64) -> (f64, f64) {
    let log_density = -0.5 * x * x - 0.5 * (2.0 * PI).ln();
    if x < FAR {
        let beyond = 0.5 * libm::erfc(x * FRAC_1_SQRT_2);
        return (beyond.ln(), (log_density - beyond.ln()).exp());
    }
    // x + 1/(x + 2/(x + 3/(x + ...)))
    let hazard = (1..=TERMS).rev().fold(x, |rest, k| x + f64::from(k) / rest);
    (log_density - hazard.ln(), hazard)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean, mean square and logarithm of the chance by sums over many points, from their largest.
    fn summed(a: f64, b: f64) -> [f64; 3] {
        let (points, width) = (200_000, b - a);
        let at = |i: u32| a + width * (f64::from(i) + 0.5) / f64::from(points);
        let nearest = if a > 0.0 { a } else { 0.0 };
        let mut sums = [0.0; 3];
        for x in (0..points).map(at) {
            let density = (0.5 * (nearest * nearest - x * x)).exp();
            sums[0] += density;
            sums[1] += density * x;
            sums[2] += density * x * x;
        }
        let chance = sums[0] * width / f64::from(points) / (2.0 * PI).sqrt();
        let log_chance = chance.ln() - 0.5 * nearest * nearest;
        [sums[1] / sums[0], sums[2] / sums[0], log_chance]
    }

    #[test]
    fn limits_near_and_far_give_what_sums_over_the_density_give() {
        for (a, b) in [
            (-0.5, 0.5),
            (-1.9, 2.0),
            (-0.01, 3.0),
            (0.0, 1.7),
            (0.3, 2.1),
            (4.9, 6.6),
            (5.1, 6.8),
            (30.0, 32.0),
            (200.0, 233.0),
        ] {
            for (one, other) in between(a, b).iter().zip(summed(a, b)) {
                assert!(
                    (one - other).abs() < 1e-6 * other.abs().max(1e-3),
                    "{a} {b}"
                );
            }
        }
    }

    #[test]
    fn a_reading_on_either_side_errs_by_as_much_and_one_in_the_middle_not_at_all() {
        let found = rounded(&[0.7, -0.7, 0.0], 1.0, 0.3);
        assert_eq!(found.error[0], -found.error[1]);
        assert_eq!(found.error[2], 0.0);
        assert!(found.error[0] > 0.2 && found.error[0] < 0.7);
    }

    #[test]
    fn what_is_drawn_between_two_limits_lies_at_its_share_of_the_chance() {
        for (a, b) in [
            (-0.5, 0.5),
            (-1.9, 2.0),
            (-0.01, 3.0),
            (0.3, 2.1),
            (5.1, 6.8),
            (30.0, 32.0),
        ] {
            let [_, _, whole] = between(a, b);
            for share in [1e-3, 0.2, 0.5, 0.9, 0.999] {
                let x = drawn_between(a, b, share);
                assert!(x > a && x < b);
                let [_, _, part] = summed(a, x);
                assert!(
                    ((part - whole).exp() - share).abs() < 1e-5,
                    "{a} {b} {share}"
                );
            }
        }
        assert!(inverse_tail(0.5_f64.ln()).abs() < 1e-12);
        assert!((inverse_tail(0.025_f64.ln()) - 1.959_963_984_540_054).abs() < 1e-12);
    }

    #[test]
    fn beside_much_noise_nothing_is_lost_and_beside_little_a_step_is_all() {
        let wide = rounded(&[0.4, -1.3, 2.0], 1e-3, 1.0);
        for (error, left) in wide.error.iter().zip([0.4, -1.3, 2.0]) {
            assert!((error - left).abs() < 1e-6);
        }
        // Within its step it says nothing, outside of it at least the distance to its border.
        let narrow = rounded(&[0.3, -0.9], 1.0, 0.01);
        assert!(narrow.error[0].abs() < 1e-9);
        assert!(narrow.error[1] < -0.4 && narrow.error[1] > -0.4 - 1e-3);
    }
}
