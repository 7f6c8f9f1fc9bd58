//! A fit whose noise and outliers are those of what it leaves.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::{Clipped, Factor, Fitted, LinearModel, Neighbours, Noise, clipped, left};

/// Residuals are taken at most this many robust standard deviations large: outliers must not make
/// causes, and normal ones are not touched.
const CLIP: f64 = 4.0;

/// Readings in a row up to which a glitch is a glitch: what lasts longer is an error of the mean.
const MOST_IN_ROW: usize = 4;

/// Fits after each other by which noise and outliers settle, the last one not counted.
const PASSES: usize = 2;

/// Readings that are fitted.
#[derive(Clone, Copy, Debug)]
pub struct Observed<'a> {
    /// The readings.
    pub readings: &'a [f64],
    /// Roots of their weights.
    pub roots: &'a [f64],
    /// Standard deviation of their rounding.
    pub rounding: f64,
    /// What tells the correlation of their noise.
    pub neighbours: &'a Neighbours,
}

impl Observed<'_> {
    /// What coefficients leave, less what run effects take of it, outliers clipped.
    fn clipped(&self, noise: &Noise, design: &[f64], coefficients: &[f64]) -> Clipped {
        let mut left = left(design, coefficients, self.readings);
        if noise.has_effects() {
            let part = noise.run_part(&left, None);
            left.iter_mut().zip(part).for_each(|(e, part)| *e -= part);
        }
        clipped(self.readings, &left, self.roots, CLIP, self.rounding)
    }
}

/// A fit, and what it was found by.
#[derive(Debug)]
pub struct Settled {
    /// Of the fit.
    pub fitted: Fitted,
    /// Of the noises that it passed through, its own first.
    pub factors: Vec<Arc<Factor>>,
    /// The readings, outliers clipped.
    pub target: Vec<f64>,
    /// Those that are outliers.
    pub outlying: Vec<bool>,
}

/// Readings fitted by columns, under the correlation `rho` or that of what is left; `factor` makes
/// that of the columns under noise of a correlation. None where it makes none.
pub fn settled(
    observed: Observed<'_>,
    design: &[f64],
    rho: Option<f64>,
    mut factor: impl FnMut(f64) -> Option<Arc<Factor>>,
) -> Option<Settled> {
    let Observed {
        readings, roots, ..
    } = observed;
    let mut factors: Vec<Arc<Factor>> = Vec::new();
    let mut projected = |rho: f64, target: &[f64], factors: &mut Vec<Arc<Factor>>| {
        let place = factors.iter().position(|f| f.noise().rho() == rho);
        let one = match place {
            Some(place) => factors.remove(place),
            None => factor(rho)?,
        };
        let fitted = one.fitted(design, target);
        factors.insert(0, one);
        Some(fitted)
    };
    let (mut target, mut outlying) = (readings.to_vec(), Vec::new());
    let mut correlation = rho.unwrap_or(0.0);
    for _ in 0..PASSES {
        let fitted = projected(correlation, &target, &mut factors)?;
        let noise = factors[0].noise();
        let found = observed.clipped(noise, design, &fitted.coefficients);
        (target, outlying) = (found.target, found.outlying);
        let is_clipped = outlying.contains(&true);
        let before = correlation;
        if rho.is_none() {
            let mut kept = found.kept;
            kept.iter_mut().zip(roots).for_each(|(e, root)| *e *= root);
            // What lasts over two readings or three is not noise that neighbours share.
            let short = short_stretches(&outlying, noise.bounds());
            for (e, _) in kept.iter_mut().zip(short).filter(|(_, short)| *short) {
                *e = 0.0;
            }
            correlation = observed.neighbours.correlation(&kept);
        }
        if !is_clipped && correlation == before {
            return Some(Settled {
                fitted,
                factors,
                target,
                outlying,
            });
        }
    }
    let fitted = projected(correlation, &target, &mut factors)?;
    Some(Settled {
        fitted,
        factors,
        target,
        outlying,
    })
}

/// Coefficients of all columns where those at some places are held at 0, by
///
/// `b - C_(.g) C_gg^(-1) b_g`, `C = B B'`,
///
/// outliers clipped as they are in a fit of the others. None where a number is not finite.
pub fn without(
    observed: Observed<'_>,
    design: &[f64],
    factor: &Factor,
    held: &[usize],
) -> Option<Vec<f64>> {
    let own = factor.back().select_rows(held);
    let gram = &own * own.transpose();
    let none = DMatrix::zeros(held.len(), 0);
    let inverse = LinearModel::of_sums(&gram, &none, &[], None, None)?.inverse();
    let moved = factor.back() * (own.transpose() * inverse);
    let solved = |target: &[f64]| {
        let found = factor.coefficients(design, target);
        let held = DVector::from_iterator(held.len(), held.iter().map(|&k| found[k]));
        found - &moved * held
    };
    let mut coefficients = solved(observed.readings);
    for _ in 0..PASSES {
        let found = observed.clipped(factor.noise(), design, coefficients.as_slice());
        if !found.outlying.contains(&true) {
            break;
        }
        coefficients = solved(&found.target);
    }
    Some(coefficients.as_slice().to_vec())
}

/// The flags that stand in stretches of at most `MOST_IN_ROW`, none of which goes over two runs.
pub fn short_stretches(flags: &[bool], bounds: &[(usize, usize)]) -> Vec<bool> {
    let mut found = vec![false; flags.len()];
    for &(start, stop) in bounds {
        let mut first = start;
        while first < stop {
            let rest = &flags[first..stop];
            let length = rest.iter().take_while(|&&is| is == rest[0]).count();
            let short = rest[0] && length <= MOST_IN_ROW;
            found[first..first + length].fill(short);
            first += length;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_is_short_within_its_run() {
        let flags = [true, true, true, true, true, false, true, false];
        let found = short_stretches(&flags, &[(0, 3), (3, 8)]);
        assert_eq!(found, flags);
        let found = short_stretches(&flags, &[(0, 8)]);
        assert_eq!(found[..6], [false; 6]);
        assert!(found[6] && !found[7]);
    }

    /// As the fit of the others alone.
    #[test]
    fn columns_that_are_held_at_zero_leave_the_fit_of_the_others() {
        let n = 240;
        let wave = |i: usize, k: usize| ((i * (k + 1)) as f64 * 0.11).sin();
        let design: Vec<f64> = (0..4 * n).map(|at| wave(at % n, at / n)).collect();
        let mut readings: Vec<f64> = (0..n)
            .map(|i| 3.0 * wave(i, 0) - wave(i, 3) + ((i * i) as f64).sin())
            .collect();
        readings[100] += 60.0;
        let clock: Vec<f64> = (0..n).map(|i| i as f64).collect();
        let observed = Observed {
            readings: &readings,
            roots: &vec![1.0; n],
            rounding: 0.0,
            neighbours: &Neighbours::new(&clock, &[(0, n)]),
        };
        let noise = Arc::new(Noise::new(vec![(0, n)], 0.3, None, &[]).unwrap());
        let whole = Factor::of(noise.clone(), &design).unwrap();
        let found = without(observed, &design, &whole, &[1, 2]).unwrap();
        let others: Vec<f64> = [&design[..n], &design[3 * n..]].concat();
        let rest = settled(observed, &others, Some(0.3), |_| {
            Factor::of(noise.clone(), &others).map(Arc::new)
        });
        let rest = rest.unwrap();
        assert!(rest.outlying[100]);
        assert!(found[1].abs() < 1e-12 && found[2].abs() < 1e-12);
        for (k, expected) in [0, 3].into_iter().zip(rest.fitted.coefficients) {
            assert!(
                (found[k] - expected).abs() < 1e-9,
                "{} {expected}",
                found[k]
            );
        }
    }

    #[test]
    fn outliers_are_clipped_and_the_correlation_is_that_of_the_rest() {
        let n = 600;
        let drawn = |i: usize| (((i * i * 31 + 7 * i) % 1009) as f64 / 504.5 - 1.0) * 1.7;
        let mut noise = vec![0.0; n];
        for i in 1..n {
            noise[i] = 0.6 * noise[i - 1] + drawn(i);
        }
        let design = vec![1.0; n];
        let clock: Vec<f64> = (0..n).map(|i| i as f64).collect();
        let bounds = vec![(0, n)];
        let neighbours = Neighbours::new(&clock, &bounds);
        let mut readings: Vec<f64> = noise.iter().map(|e| e + 10.0).collect();
        readings[300] += 100.0;
        let observed = Observed {
            readings: &readings,
            roots: &vec![1.0; n],
            rounding: 0.0,
            neighbours: &neighbours,
        };
        let factor = |rho| {
            let noise = Noise::new(bounds.clone(), rho, None, &[])?;
            Factor::of(Arc::new(noise), &design).map(Arc::new)
        };
        let found = settled(observed, &design, None, factor).unwrap();
        assert!(found.outlying[300]);
        assert_eq!(found.outlying.iter().filter(|&&is| is).count(), 1);
        let rho = found.factors[0].noise().rho();
        assert!((rho - 0.6).abs() < 0.1, "{rho}");
        assert!((found.fitted.coefficients[0] - 10.0).abs() < 0.3);
        assert!((found.target[300] - readings[300]).abs() > 80.0);
        let found = settled(observed, &design, Some(0.2), factor).unwrap();
        assert_eq!(found.factors.len(), 1);
        assert_eq!(found.factors[0].noise().rho(), 0.2);
    }
}
