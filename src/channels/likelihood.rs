//! Maximum likelihood of the curve: least squares of the distances to it.
//!
//! The phase of each reading is an unknown of its own; at the nearest place it is at its best, so
//! the distance's slope by a parameter is that of the curve across itself (envelope theorem).

use super::curve::{Curve, ELLIPSE};
use super::start::{LOOKED_AT, starts};
use crate::error::Error;
use crate::interrupt;
use crate::lstsq::{Reduction, System, Triangle};

/// Starts that are followed to their end.
const FOLLOWED: usize = 6;

/// Most steps, and the decrease of the squares at which they end.
const STEPS: usize = 100;
const DECREASE: f64 = 1e-11;

/// Damping at first, and beyond which no step helps.
const DAMPING: f64 = 1e-6;
const MOST_DAMPING: f64 = 1e8;

/// Rows reduced at a time.
const BLOCK: usize = 4096;

/// Readings of two channels.
#[derive(Clone, Copy)]
pub struct Readings<'a> {
    /// The sine channel.
    pub sine: &'a [f64],
    /// The cosine channel.
    pub cosine: &'a [f64],
    /// Weights of the readings.
    pub weights: &'a [f64],
    /// Variances of the noise of cosine and sine, relative to one another.
    pub variances: [f64; 2],
}

/// What was found.
#[derive(Clone, Debug)]
pub struct CurveFit {
    /// The curve.
    pub curve: Curve,
    /// Covariance of its parameters for noise of the variances given, row by row.
    pub covariance: Vec<f64>,
    /// The phase of every reading, radians.
    pub phases: Vec<f64>,
    /// Distance of every reading to the curve in standard deviations of the variances given.
    pub residuals: Vec<f64>,
    /// Shares of the cosine's variance in the square of each distance before that.
    pub shares: Vec<f64>,
}

/// Fit the curve with the harmonics of some orders, from another curve on where there is one.
///
/// None where the readings do not settle it: a line, a point, too few.
pub fn fit(
    readings: Readings<'_>,
    orders: &[u32],
    start: Option<&Curve>,
) -> Result<Option<CurveFit>, Error> {
    let n = readings.sine.len();
    crate::check::same_length("cosine", readings.cosine.len(), "sine", n)?;
    crate::check::same_length("weights", readings.weights.len(), "sine", n)?;
    crate::check::finite("sine", readings.sine)?;
    crate::check::finite("cosine", readings.cosine)?;
    crate::check::not_negative("weights", readings.weights)?;
    let middle = |values: &[f64]| values.iter().sum::<f64>() / n.max(1) as f64;
    let (mx, my) = (middle(readings.cosine), middle(readings.sine));
    let squares = readings.sine.iter().zip(readings.cosine);
    let size = (squares
        .map(|(y, x)| (x - mx).powi(2) + (y - my).powi(2))
        .sum::<f64>()
        / n.max(1) as f64)
        .sqrt();
    if n <= ELLIPSE + 2 * orders.len() || !(size > 0.0 && size.is_finite()) {
        return Ok(None);
    }
    // Near zero and of size one, whatever the converter's counts.
    let scaled = |values: &[f64], middle: f64| -> Vec<f64> {
        values.iter().map(|v| (v - middle) / size).collect()
    };
    let (sine, cosine) = (scaled(readings.sine, my), scaled(readings.cosine, mx));
    let whole = Readings {
        sine: &sine,
        cosine: &cosine,
        ..readings
    };
    let curve = match start {
        Some(start) if start.is_whole() => start.moved([mx, my], size),
        _ => match whole.begun() {
            Some(curve) => curve,
            None => return Ok(None),
        },
    };
    let state = whole.settled(whole.state(curve.with(orders), None));
    Ok(whole.fit(state, size, [mx, my]))
}

struct State {
    curve: Curve,
    phases: Vec<f64>,
    squares: f64,
}

impl Readings<'_> {
    /// The best ellipse of a grid of starts, of some of the readings.
    fn begun(&self) -> Option<Curve> {
        let stride = self.sine.len().div_ceil(LOOKED_AT);
        let every =
            |values: &[f64]| -> Vec<f64> { values.iter().copied().step_by(stride).collect() };
        let (sine, cosine, weights) = (every(self.sine), every(self.cosine), every(self.weights));
        let few = Readings {
            sine: &sine,
            cosine: &cosine,
            weights: &weights,
            ..*self
        };
        let mut best: Option<State> = None;
        for curve in starts(&cosine, &sine).into_iter().take(FOLLOWED) {
            let found = few.settled(few.state(curve, None));
            if best.as_ref().is_none_or(|b| found.squares < b.squares) {
                best = Some(found);
            }
            interrupt::point();
        }
        best.map(|state| state.curve)
    }

    fn reading(&self, i: usize) -> [f64; 2] {
        [self.cosine[i], self.sine[i]]
    }

    /// The curve with the nearest places of all readings, from those of another one on.
    fn state(&self, curve: Curve, phases: Option<&[f64]>) -> State {
        let mut squares = 0.0;
        let places = (0..self.sine.len()).map(|i| {
            let start = phases.map_or_else(|| curve.phase(self.reading(i)), |phases| phases[i]);
            let phase = curve.nearest(self.reading(i), self.variances, start);
            squares += self.weights[i] * self.distance(&curve, i, phase).0.powi(2);
            phase
        });
        let phases = places.collect();
        State {
            curve,
            phases,
            squares,
        }
    }

    /// Distance in standard deviations, and the normal in units of them.
    fn distance(&self, curve: &Curve, i: usize, phase: f64) -> (f64, [f64; 2]) {
        let place = curve.at(phase);
        let normal = [place.along[1], -place.along[0]];
        let spread = normal[0].powi(2) * self.variances[0] + normal[1].powi(2) * self.variances[1];
        let normal = normal.map(|n| n / spread.sqrt());
        let reading = self.reading(i);
        let off = [reading[0] - place.at[0], reading[1] - place.at[1]];
        (normal[0] * off[0] + normal[1] * off[1], normal)
    }

    /// The triangle of the linearised problem, each reading times a power of its weight.
    fn triangle(&self, state: &State, power: impl Fn(f64) -> f64) -> Option<Triangle> {
        let width = state.curve.parameters.len() + 1;
        let mut reduction = Reduction::default();
        for start in (0..self.sine.len()).step_by(BLOCK) {
            let stop = (start + BLOCK).min(self.sine.len());
            let mut rows = vec![0.0; (stop - start) * width];
            for (row, i) in rows.chunks_exact_mut(width).zip(start..stop) {
                let (distance, normal) = self.distance(&state.curve, i, state.phases[i]);
                let root = power(self.weights[i]);
                let weighted = normal.map(|n| n * root);
                state
                    .curve
                    .row(state.phases[i], weighted, &mut row[..width - 1]);
                row[width - 1] = root * distance;
            }
            reduction.push(Triangle::of_rows(width, &rows));
            interrupt::point();
        }
        reduction.finish()
    }

    /// Levenberg-Marquardt from a state on.
    fn settled(&self, mut state: State) -> State {
        let mut damping = DAMPING;
        for _ in 0..STEPS {
            let Some(shared) = self.triangle(&state, f64::sqrt) else {
                break;
            };
            let sizes: Vec<f64> = shared
                .design_columns()
                .iter()
                .map(|column| column.iter().map(|v| v * v).sum())
                .collect();
            let system = System {
                runs: Vec::new(),
                shared,
            };
            let mut decrease = None;
            while damping < MOST_DAMPING {
                let ridge: Vec<f64> = sizes.iter().map(|s| damping * s).collect();
                if let Some(step) = system.solve(Some(&ridge)) {
                    let mut curve = state.curve.clone();
                    for (p, d) in curve.parameters.iter_mut().zip(&step.coefficients) {
                        *p += d;
                    }
                    let next = self.state(curve, Some(&state.phases));
                    let is_ellipse =
                        next.curve.parameters[2] > 0.0 && next.curve.parameters[3] > 0.0;
                    if is_ellipse && next.squares <= state.squares {
                        decrease = Some(state.squares - next.squares);
                        state = next;
                        damping = (damping * 0.1).max(1e-12);
                        break;
                    }
                }
                damping *= 10.0;
            }
            match decrease {
                Some(less) if less > DECREASE * state.squares => {}
                _ => break,
            }
        }
        state
    }

    /// The result in the unit of the readings.
    fn fit(&self, state: State, size: f64, middle: [f64; 2]) -> Option<CurveFit> {
        let width = state.curve.parameters.len();
        let solved = System {
            runs: Vec::new(),
            shared: self.triangle(&state, f64::sqrt)?,
        }
        .solve(None)?;
        let whole = solved.covariance(&[]);
        let inverse = |i: usize, j: usize| whole[(i + 1) * (width + 1) + j + 1];
        // The covariance of weighted readings: H (sum w^2 j j') H.
        let root = self.triangle(&state, |w| w)?.design_columns();
        let mut spread = vec![0.0; width * width];
        for (k, row) in spread.chunks_exact_mut(width).enumerate() {
            for (j, value) in row.iter_mut().enumerate() {
                *value = (0..width).map(|i| root[i][k] * inverse(i, j)).sum();
            }
        }
        let mut covariance = vec![0.0; width * width];
        for i in 0..width {
            for j in 0..width {
                let products = spread.chunks_exact(width).map(|row| row[i] * row[j]);
                covariance[i * width + j] = products.sum::<f64>();
            }
        }
        let each: Vec<_> = (0..self.sine.len())
            .map(|i| self.distance(&state.curve, i, state.phases[i]))
            .collect();
        let residuals = each.iter().map(|(distance, _)| distance * size).collect();
        let shares = each
            .iter()
            .map(|(_, normal)| normal[0].powi(2) * self.variances[0])
            .collect();
        let State {
            mut curve, phases, ..
        } = state;
        for value in &mut curve.parameters {
            *value *= size;
        }
        curve.parameters[0] += middle[0];
        curve.parameters[1] += middle[1];
        Some(CurveFit {
            curve,
            covariance,
            phases,
            residuals,
            shares,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in -1 to 1 that look random.
    struct Numbers(u64);

    impl Numbers {
        fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    /// Readings of a curve over an arc, with the same noise in both channels.
    fn readings(curve: &Curve, arc: f64, noise: f64, numbers: &mut Numbers) -> [Vec<f64>; 2] {
        let start = 3.0 * numbers.next();
        let mut found = [Vec::new(), Vec::new()];
        for i in 0..400 {
            let place = curve.at(start + arc * f64::from(i) / 400.0).at;
            for (channel, value) in found.iter_mut().zip(place) {
                channel.push(value + noise * numbers.next());
            }
        }
        found
    }

    fn found(channels: &[Vec<f64>; 2], orders: &[u32]) -> Option<CurveFit> {
        let [cosine, sine] = channels;
        let weights = vec![1.0; sine.len()];
        let readings = Readings {
            sine,
            cosine,
            weights: &weights,
            variances: [1.0, 1.0],
        };
        fit(readings, orders, None).unwrap()
    }

    #[test]
    fn curves_come_back_from_readings_without_noise() {
        let mut numbers = Numbers(7);
        for _ in 0..40 {
            let mut n = || numbers.next();
            let size = 1000.0 * (1.2 + n());
            let shape = [
                2.0 * n(),
                2.0 * n(),
                1.0 + 0.3 * n(),
                1.0 + 0.3 * n(),
                0.3 * n(),
            ];
            let parameters = shape.map(|value| size * value).to_vec();
            let curve = Curve {
                orders: Vec::new(),
                parameters,
            };
            let arc = 3.9 + 2.3 * n();
            let channels = readings(&curve, arc, 0.0, &mut numbers);
            let fit = found(&channels, &[]).unwrap();
            for (got, wanted) in fit.curve.parameters.iter().zip(&curve.parameters) {
                assert!((got - wanted).abs() < 1e-6 * size, "{got} {wanted} {arc}");
            }
        }
    }

    #[test]
    fn harmonics_come_back_and_distances_are_those_of_the_noise() {
        let mut numbers = Numbers(11);
        let curve = Curve {
            orders: vec![2, 3],
            parameters: vec![0.1, -0.2, 1.1, 0.9, 0.1, 0.03, -0.02, 0.01, 0.04],
        };
        let noise = 3e-3;
        let fit = found(
            &readings(&curve, std::f64::consts::TAU, noise, &mut numbers),
            &[2, 3],
        )
        .unwrap();
        let width = fit.curve.parameters.len();
        let sigma = noise / 3.0_f64.sqrt();
        let mut pulls = 0.0;
        for (i, (got, wanted)) in fit
            .curve
            .parameters
            .iter()
            .zip(&curve.parameters)
            .enumerate()
        {
            let std = sigma * fit.covariance[i * width + i].sqrt();
            pulls += ((got - wanted) / std).powi(2) / width as f64;
        }
        assert!((0.1..3.0).contains(&pulls), "{pulls}");
        let squares: f64 = fit.residuals.iter().map(|r| r * r).sum();
        let spread = (squares / (400.0 - width as f64)).sqrt();
        assert!((spread / sigma - 1.0).abs() < 0.15, "{spread} {sigma}");
    }

    #[test]
    fn what_draws_no_curve_is_none() {
        let line: Vec<f64> = (0..50).map(f64::from).collect();
        let still = vec![2.0; 50];
        assert!(found(&[still.clone(), still], &[]).is_none());
        assert!(found(&[line[..5].to_vec(), line[..5].to_vec()], &[]).is_none());
    }
}
