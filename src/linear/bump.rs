//! A bump beside a fit: the place and the width with which it saves most.

use super::Beside;
use super::golden::golden;

/// Degrees of a turn.
const TURN: f64 = 360.0;

/// Widths from the place beyond which a bump is below the rounding of its height.
const VANISHES: f64 = 9.0;

/// Adding this to a number rounds it to an integer, a half to the even one.
const ROUNDER: f64 = crate::simd::ROUNDER;

/// Times that place and width are searched one after the other, steps of each search, and how
/// far the logarithm of the width is searched.
const ROUNDS: usize = 2;
const GOLDEN_STEPS: usize = 8;
const LOG_WIDTH: f64 = 0.8;

/// Steps by which both are made exact, the most of each in widths, and the share of a width over
/// which slopes are taken.
const NEWTON_STEPS: usize = 4;
const MOST: f64 = 0.3;
const SLOPE: f64 = 0.05;

/// Bumps `e^(-(φ - c)²/2w²)` of a shaft whose angle at every reading is φ, in degrees.
pub struct Bumps<'a> {
    beside: &'a Beside,
    phase: &'a [f64],
    widest: f64,
}

impl<'a> Bumps<'a> {
    /// Beside a fit of as many readings as there are angles.
    pub fn new(beside: &'a Beside, phase: &'a [f64], widest: f64) -> Self {
        Self {
            beside,
            phase,
            widest,
        }
    }

    /// Place and width from which a bump near some saves most, no wider than the widest.
    ///
    /// Golden sections by each in turn, which stop at some 4 % of the width, and Gauss-Newton steps
    /// on both together for as long as they save more.
    pub fn refined(&self, mut place: f64, mut width: f64) -> (f64, f64) {
        let mut column = vec![0.0; self.phase.len()];
        let mut gain = |place: f64, width: f64| {
            self.fill(place, width, 1, &mut column);
            self.beside.gain_of_one(&column)
        };
        for _ in 0..ROUNDS {
            let span = (place - width, place + width);
            place = golden(|c| gain(c, width), span, GOLDEN_STEPS).0;
            let log = width.ln();
            let top = (log + LOG_WIDTH).min(self.widest.ln());
            let span = (log - LOG_WIDTH, top);
            width = golden(|x| gain(place, x.exp()), span, GOLDEN_STEPS).0.exp();
        }
        let mut value = gain(place, width);
        for _ in 0..NEWTON_STEPS {
            let Some(found) = self.beside.coefficients((&self.tangents(place, width), 3)) else {
                break;
            };
            let step = |k: usize| (found[k] / found[0]).clamp(-MOST * width, MOST * width);
            let (there, wide) = (place + step(1), (width + step(2)).min(self.widest));
            let following = gain(there, wide);
            // Steps that are no numbers save nothing.
            if following > value {
                (place, width, value) = (there, wide, following);
            } else {
                break;
            }
        }
        (place, width)
    }

    /// A bump of height 1 as one of so many columns, from the first reading's place on.
    fn fill(&self, place: f64, width: f64, columns: usize, out: &mut [f64]) {
        for (to, &phase) in out.iter_mut().step_by(columns).zip(self.phase) {
            let away = phase - place;
            let turns = (away / TURN + ROUNDER) - ROUNDER;
            *to = (away - TURN * turns) / width;
        }
        for to in out.iter_mut().step_by(columns) {
            let away = *to;
            *to = if away.abs() < VANISHES {
                (-0.5 * (away * away)).exp()
            } else {
                0.0
            };
        }
    }

    /// The bump and its derivatives by place and width, reading by reading.
    fn tangents(&self, place: f64, width: f64) -> Vec<f64> {
        let n = self.phase.len();
        let (step, mut rows) = (SLOPE * width, vec![0.0; 3 * n]);
        self.fill(place, width, 3, &mut rows);
        let (mut above, mut below) = (vec![0.0; n], vec![0.0; n]);
        for (k, there, wide) in [(1, step, 0.0), (2, 0.0, step)] {
            self.fill(place + there, width + wide, 1, &mut above);
            self.fill(place - there, width - wide, 1, &mut below);
            let slopes = above
                .iter()
                .zip(&below)
                .map(|(a, b)| (a - b) / (2.0 * step));
            for (to, slope) in rows[k..].iter_mut().step_by(3).zip(slopes) {
                *to = slope;
            }
        }
        rows
    }
}

#[cfg(test)]
mod tests {
    use super::super::Correlated;
    use super::*;

    /// Readings of three turns with a bump, a line and a little of something else.
    fn case(place: f64, width: f64) -> (Vec<f64>, Vec<f64>) {
        let phase: Vec<f64> = (0..900).map(|i| 1.2 * f64::from(i) - 400.0).collect();
        let readings = phase.iter().enumerate().map(|(i, x)| {
            let away = (x - place + 180.0).rem_euclid(TURN) - 180.0;
            let bump = 5.0 * (-0.5 * (away / width).powi(2)).exp();
            bump + x.to_radians().cos() + 0.2 * ((i * i) as f64).sin()
        });
        (phase.clone(), readings.collect())
    }

    /// A fit of those by a constant and that line.
    fn fitted(phase: &[f64], readings: &[f64], rho: f64) -> Beside {
        let n = readings.len();
        let bounds = [(0, n / 3), (n / 3, n)];
        let noise = Correlated {
            bounds: &bounds,
            rho,
            roots: None,
        };
        let white = |x: Vec<f64>| {
            let mut out = vec![0.0; n];
            noise.filtered(&x, 1, &mut out);
            out
        };
        let mut columns = nalgebra::DMatrix::zeros(n, 2);
        columns.column_mut(0).copy_from_slice(&white(vec![1.0; n]));
        let line = phase.iter().map(|x| x.to_radians().cos()).collect();
        columns.column_mut(1).copy_from_slice(&white(line));
        let q = columns.qr().q();
        let y = nalgebra::DVector::from_vec(white(readings.to_vec()));
        let r = &y - &q * q.tr_mul(&y);
        let squares = r.norm_squared();
        Beside::new(noise, q.as_slice(), r.as_slice(), (&[], &[]), squares, 1e-4)
    }

    #[test]
    fn no_place_or_width_near_the_one_found_saves_more() {
        for (place, width, rho) in [(77.3, 6.0, 0.0), (-3.0, 11.0, 0.4), (358.0, 4.0, 0.0)] {
            let (phase, readings) = case(place, width);
            let beside = fitted(&phase, &readings, rho);
            let bumps = Bumps::new(&beside, &phase, 16.0);
            let (c, w) = bumps.refined(place + 2.0, 1.5 * width);
            let away = (c - place + 180.0).rem_euclid(TURN) - 180.0;
            assert!(away.abs() < 0.5 && (w / width - 1.0).abs() < 0.2, "{c} {w}");
            let gain = |place: f64, width: f64| {
                let mut column = vec![0.0; phase.len()];
                bumps.fill(place, width, 1, &mut column);
                beside.gain_of_one(&column)
            };
            let best = gain(c, w);
            for (dc, dw) in [(0.01, 0.0), (-0.01, 0.0), (0.0, 0.01), (0.0, -0.01)] {
                assert!(gain(c + dc * w, w * (1.0 + dw)) < best, "{place} {dc} {dw}");
            }
        }
    }

    #[test]
    fn a_bump_is_no_wider_than_the_widest() {
        let (phase, readings) = case(100.0, 40.0);
        let beside = fitted(&phase, &readings, 0.0);
        let (_, width) = Bumps::new(&beside, &phase, 16.0).refined(101.0, 11.0);
        assert!((width - 16.0).abs() < 1.0, "{width}");
    }

    /// Derivatives of `e^(-a²/2)`, `a = (φ - c)/w`: `a/w` and `a²/w` times the bump.
    #[test]
    fn tangents_are_the_derivatives_by_place_and_width() {
        /// Third derivatives of at most 5 in widths, times a sixth of the step squared.
        const DIFFERENCE: f64 = 5.0 * SLOPE * SLOPE / 6.0;
        for width in [0.5, 6.0, 40.0] {
            let phase: Vec<f64> = (-40..=40)
                .map(|i| 100.0 + 0.1 * width * f64::from(i))
                .collect();
            let beside = fitted(&phase, &vec![0.0; phase.len()], 0.0);
            let rows = Bumps::new(&beside, &phase, 90.0).tangents(100.0, width);
            for (row, x) in rows.chunks_exact(3).zip(&phase) {
                let a = (x - 100.0) / width;
                let bump = (-0.5 * a * a).exp();
                assert!((row[0] - bump).abs() < 1e-12, "{width} {a}");
                for (slope, expected) in [(row[1], a * bump), (row[2], a * a * bump)] {
                    let off = (width * slope - expected).abs();
                    assert!(off < DIFFERENCE, "{width} {a}: {off}");
                }
            }
        }
    }

    /// Of the readings where the bump is nothing is left: a step would be nothing by nothing.
    #[test]
    fn where_nothing_is_left_a_bump_keeps_a_place() {
        let phase: Vec<f64> = (0..720).map(|i| 0.5 * f64::from(i)).collect();
        let n = phase.len();
        let sign = |i: usize| 1.0 - 2.0 * (i % 2) as f64;
        let left: Vec<f64> = (0..n)
            .map(|i| if i < 480 { 0.0 } else { sign(i) })
            .collect();
        let bounds = [(0, n)];
        let noise = Correlated {
            bounds: &bounds,
            rho: 0.0,
            roots: None,
        };
        let constant = vec![(n as f64).sqrt().recip(); n];
        let beside = Beside::new(noise, &constant, &left, (&[], &[]), 240.0, 1e-4);
        let (place, width) = Bumps::new(&beside, &phase, 4.0).refined(100.0, 2.0);
        assert!(
            (place - 100.0).abs() < 10.0 && width > 0.0 && width <= 4.0,
            "{place} {width}"
        );
    }

    #[test]
    fn the_place_of_nothing_is_where_it_was_looked_for() {
        let phase = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0];
        let beside = fitted(&phase, &[0.0; 6], 0.0);
        let (place, width) = Bumps::new(&beside, &phase, 16.0).refined(200.0, 0.5);
        assert!(
            (place - 200.0).abs() < 2.0 && width < 2.5,
            "{place} {width}"
        );
    }
}
