//! Noise of readings in runs, and the linear map that makes it white.

use std::sync::OnceLock;

use nalgebra::{
    Cholesky, DMatrix, DMatrixView, DMatrixViewMut, DVector, DVectorView, DVectorViewMut,
};

use super::ratio::eigensystem;
use super::{Beside, Correlated};
use crate::interrupt;

/// Share of the power of the strongest combination of shapes below which one is rounding.
const VANISHES: f64 = 1e-14;

/// Shapes, column by column, of an error whose size every run draws anew, and the variance of
/// their coefficients over that of a reading.
#[derive(Clone, Copy, Debug)]
pub struct RunEffect<'a> {
    /// As many numbers as readings for each.
    pub shapes: &'a [f64],
    /// Of variances.
    pub ratio: f64,
}

/// Noise of first-order correlation within runs, of readings of these weights, and what every run
/// draws anew.
///
/// With `F` the filter and `A` the filtered shapes times their standard deviations, the map is
/// `(I + A A')^(-1/2) F` in every run.
#[derive(Debug)]
pub struct Noise {
    bounds: Vec<(usize, usize)>,
    rho: f64,
    roots: Option<Vec<f64>>,
    /// Times their standard deviations, column by column.
    shapes: Vec<f64>,
    /// Of every run, where there are shapes.
    drawn: Vec<Drawn>,
    /// `(I + Z' Z)^(-1)` of every run's shapes `Z`, made when they are asked for.
    shares: OnceLock<Vec<DMatrix<f64>>>,
}

/// What a run effect is in one run.
#[derive(Debug)]
struct Drawn {
    /// Directions at right angles that the filtered shapes span.
    axes: DMatrix<f64>,
    /// What the map takes off along each.
    shrink: Vec<f64>,
    log_determinant: f64,
}

impl Noise {
    /// Of runs one after the other; None where a number is not finite.
    pub fn new(
        bounds: Vec<(usize, usize)>,
        rho: f64,
        roots: Option<Vec<f64>>,
        effects: &[RunEffect<'_>],
    ) -> Option<Self> {
        let scaled = effects.iter().flat_map(|effect| {
            let size = effect.ratio.sqrt();
            effect.shapes.iter().map(move |x| size * x)
        });
        Self::made(bounds, rho, roots, scaled.collect())
    }

    /// The same but for the correlation.
    pub fn with_rho(&self, rho: f64) -> Option<Self> {
        let (bounds, roots) = (self.bounds.clone(), self.roots.clone());
        Self::made(bounds, rho, roots, self.shapes.clone())
    }

    fn made(
        bounds: Vec<(usize, usize)>,
        rho: f64,
        roots: Option<Vec<f64>>,
        shapes: Vec<f64>,
    ) -> Option<Self> {
        let mut made = Self {
            bounds,
            rho,
            roots,
            shapes,
            drawn: Vec::new(),
            shares: OnceLock::new(),
        };
        if !made.shapes.is_empty() {
            let filtered = made.filtered(&made.shapes);
            let runs = made.bounds.iter();
            let drawn = runs.map(|&run| Drawn::of(&made.of_run(&filtered, run)));
            made.drawn = drawn.collect::<Option<_>>()?;
        }
        Some(made)
    }

    /// Readings.
    pub fn readings(&self) -> usize {
        self.bounds.last().map_or(0, |&(_, stop)| stop)
    }

    /// Correlation of neighbours.
    pub fn rho(&self) -> f64 {
        self.rho
    }

    /// The runs.
    pub fn bounds(&self) -> &[(usize, usize)] {
        &self.bounds
    }

    /// Roots of the weights.
    pub fn roots(&self) -> Option<&[f64]> {
        self.roots.as_deref()
    }

    /// Something is drawn anew in every run.
    pub fn has_effects(&self) -> bool {
        !self.drawn.is_empty()
    }

    /// Without what runs draw anew.
    pub fn correlated(&self) -> Correlated<'_> {
        Correlated {
            bounds: &self.bounds,
            rho: self.rho,
            roots: self.roots(),
        }
    }

    /// `-2 ln|map|`, to be added to the likelihood's `n ln RSS`.
    pub fn log_determinant(&self) -> f64 {
        let runs: f64 = (0..self.bounds.len())
            .map(|run| self.log_determinant_of(run))
            .sum();
        let weights = self.roots.iter().flatten();
        runs - 2.0 * weights.map(|root| root.ln()).sum::<f64>()
    }

    /// The part of one run, without that of the weights.
    pub fn log_determinant_of(&self, run: usize) -> f64 {
        let drawn = self.drawn.get(run).map_or(0.0, |run| run.log_determinant);
        drawn - (-self.rho * self.rho).ln_1p()
    }

    /// The map applied to columns, one after the other.
    pub fn map(&self, x: &[f64]) -> Vec<f64> {
        let mut out = self.filtered(x);
        self.shrink(&mut out);
        out
    }

    /// The transpose of the map.
    pub fn map_back(&self, x: &[f64]) -> Vec<f64> {
        let mut shrunk = x.to_vec();
        self.shrink(&mut shrunk);
        self.filtered_back(&shrunk)
    }

    /// Best guess of what every run has drawn, of a residual as it is, each shape times a factor
    /// where these are given.
    pub fn run_part(&self, left: &[f64], factors: Option<&[f64]>) -> Vec<f64> {
        let mut out = vec![0.0; left.len()];
        if !self.has_effects() {
            return out;
        }
        let shares = self.shares.get_or_init(|| {
            let runs = self.bounds.iter();
            let gram = |&run| {
                let shapes = self.of_run(&self.shapes, run);
                shapes.tr_mul(&shapes)
            };
            runs.map(|run| inverse_beside_one(gram(run))).collect()
        });
        for (&(start, stop), share) in self.bounds.iter().zip(shares) {
            let parts = self.shapes.chunks_exact(self.readings());
            let parts: Vec<_> = parts.map(|shape| view(&shape[start..stop])).collect();
            let own = view(&left[start..stop]);
            let moments = DVector::from_iterator(parts.len(), parts.iter().map(|p| p.dot(&own)));
            let sizes = share * moments;
            let mut out = view_mut(&mut out[start..stop]);
            for (j, part) in parts.iter().enumerate() {
                let factor = factors.map_or(1.0, |factors| factors[j]);
                out.axpy(factor * sizes[j], part, 1.0);
            }
        }
        out
    }

    /// What run effects take from products of columns: with `F` the filter alone, `map(x)'map(y)`
    /// is `(F x)'F y` less, run by run, `(w'x) c (w'y)`. Columns `w`, one after the other, and `c`
    /// run by run.
    pub fn taken(&self) -> (Vec<f64>, Vec<f64>) {
        let width = self.drawn.iter().map(|run| run.shrink.len()).max();
        let (width, n) = (width.unwrap_or(0), self.readings());
        let (mut axes, mut shares) = (vec![0.0; n * width], vec![0.0; self.bounds.len() * width]);
        for (run, (drawn, &(start, stop))) in self.drawn.iter().zip(&self.bounds).enumerate() {
            for (j, (axis, shrink)) in drawn.axes.column_iter().zip(&drawn.shrink).enumerate() {
                view_mut(&mut axes[j * n + start..j * n + stop]).copy_from(&axis);
                shares[run * width + j] = shrink * (2.0 - shrink);
            }
        }
        (self.filtered_back(&axes), shares)
    }

    /// A fit under this noise as columns see it that are not mapped; see [`Beside::new`].
    pub fn beside(&self, fitted: &[f64], residual: &[f64], squares: f64, excited: f64) -> Beside {
        if !self.has_effects() {
            let taken = (&[][..], &[][..]);
            return Beside::new(self.correlated(), fitted, residual, taken, squares, excited);
        }
        let (mut q, mut r) = (fitted.to_vec(), residual.to_vec());
        self.shrink(&mut q);
        self.shrink(&mut r);
        let (shapes, shares) = self.taken();
        let taken = (shapes.as_slice(), shares.as_slice());
        Beside::new(self.correlated(), &q, &r, taken, squares, excited)
    }

    fn filtered(&self, x: &[f64]) -> Vec<f64> {
        self.by_columns(x, |column, out| self.correlated().filtered(column, 1, out))
    }

    fn filtered_back(&self, x: &[f64]) -> Vec<f64> {
        self.by_columns(x, |column, out| {
            self.correlated().filtered_back(column, 1, out);
        })
    }

    fn by_columns(&self, x: &[f64], filter: impl Fn(&[f64], &mut [f64])) -> Vec<f64> {
        if self.correlated().is_white() {
            return x.to_vec();
        }
        let (mut out, n) = (vec![0.0; x.len()], self.readings().max(1));
        for (x, out) in x.chunks_exact(n).zip(out.chunks_exact_mut(n)) {
            filter(x, out);
        }
        out
    }

    fn shrink(&self, columns: &mut [f64]) {
        let n = self.readings();
        let count = columns.len() / n.max(1);
        let mut columns = DMatrixViewMut::from_slice(columns, n, count);
        for (drawn, &(start, stop)) in self.drawn.iter().zip(&self.bounds) {
            interrupt::point();
            let mut part = columns.rows_mut(start, stop - start);
            let mut inner = drawn.axes.tr_mul(&part);
            for (mut row, factor) in inner.row_iter_mut().zip(&drawn.shrink) {
                row.scale_mut(*factor);
            }
            part.gemm(-1.0, &drawn.axes, &inner, 1.0);
        }
    }

    fn of_run(&self, columns: &[f64], (start, stop): (usize, usize)) -> DMatrix<f64> {
        let n = self.readings();
        let columns = DMatrixView::from_slice(columns, n, columns.len() / n.max(1));
        columns.rows(start, stop - start).into_owned()
    }
}

impl Drawn {
    /// Columns turned to right angles, those of them that add something to the others.
    fn of(filtered: &DMatrix<f64>) -> Option<Self> {
        interrupt::point();
        let found = eigensystem(filtered.tr_mul(filtered))?;
        let power = found.eigenvalues;
        let limit = VANISHES * power.max().max(0.0);
        let kept: Vec<usize> = (0..power.len()).filter(|&k| power[k] > limit).collect();
        let mut axes = filtered * found.eigenvectors.select_columns(&kept);
        for (mut axis, &k) in axes.column_iter_mut().zip(&kept) {
            axis.unscale_mut(power[k].sqrt());
        }
        let of_kept = kept.iter().map(|&k| power[k]);
        Some(Self {
            axes,
            shrink: of_kept
                .clone()
                .map(|p| 1.0 - 1.0 / (1.0 + p).sqrt())
                .collect(),
            log_determinant: of_kept.map(f64::ln_1p).sum(),
        })
    }
}

/// Inverse of the unit matrix plus one that is not negative.
///
/// Well conditioned where it matters; beside columns 1e8 times as large as others the unit is lost in
/// rounding, and the eigenvalues are told one by one.
fn inverse_beside_one(gram: DMatrix<f64>) -> DMatrix<f64> {
    let size = gram.nrows();
    if let Some(found) = Cholesky::new(DMatrix::identity(size, size) + &gram) {
        return found.inverse();
    }
    let Some(found) = eigensystem(gram) else {
        return DMatrix::from_element(size, size, f64::NAN);
    };
    let mut scaled = found.eigenvectors.clone();
    for (mut column, &value) in scaled.column_iter_mut().zip(&found.eigenvalues) {
        column.unscale_mut(1.0 + value.max(0.0));
    }
    scaled * found.eigenvectors.transpose()
}

fn view(values: &[f64]) -> DVectorView<'_, f64> {
    DVectorView::from_slice(values, values.len())
}

fn view_mut(values: &mut [f64]) -> DVectorViewMut<'_, f64> {
    let n = values.len();
    DVectorViewMut::from_slice(values, n)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: [(usize, usize); 3] = [(0, 9), (9, 11), (11, 24)];
    const N: usize = 24;

    fn wave(i: usize, k: usize) -> f64 {
        ((3 * i * i + 5 * i * (k + 1)) as f64).sin()
    }

    fn noise(rho: f64, weighted: bool, ratios: [f64; 2]) -> (Noise, DMatrix<f64>) {
        let roots = weighted.then(|| (0..N).map(|i| 1.0 + 0.05 * i as f64).collect::<Vec<_>>());
        let shapes: Vec<f64> = (0..3 * N).map(|at| wave(at % N, at / N)).collect();
        let effects = [
            RunEffect {
                shapes: &shapes[..N],
                ratio: ratios[0],
            },
            RunEffect {
                shapes: &shapes[N..],
                ratio: ratios[1],
            },
        ];
        let made = Noise::new(BOUNDS.to_vec(), rho, roots.clone(), &effects).unwrap();
        let run = |i: usize| BOUNDS.iter().position(|&(_, stop)| i < stop);
        let covariance = DMatrix::from_fn(N, N, |i, j| {
            if run(i) != run(j) {
                return 0.0;
            }
            let root = |i: usize| roots.as_ref().map_or(1.0, |roots| roots[i]);
            let own = rho.powi(i32::try_from(i.abs_diff(j)).unwrap()) / (1.0 - rho * rho);
            let drawn = (0..3).map(|k| {
                let ratio = ratios[usize::from(k > 0)];
                ratio * shapes[k * N + i] * shapes[k * N + j]
            });
            own / (root(i) * root(j)) + drawn.sum::<f64>()
        });
        (made, covariance)
    }

    #[test]
    fn the_map_makes_the_covariance_the_unit_matrix() {
        for (rho, weighted) in [(0.0, false), (0.6, false), (0.3, true)] {
            let (noise, covariance) = noise(rho, weighted, [0.4, 7.0]);
            let unit = DMatrix::<f64>::identity(N, N);
            let map = DMatrix::from_vec(N, N, noise.map(unit.as_slice()));
            let white = &map * &covariance * map.transpose();
            assert!((white - &unit).amax() < 1e-10);
            let back = DMatrix::from_vec(N, N, noise.map_back(unit.as_slice()));
            assert!((back - map.transpose()).amax() < 1e-13);
            let expected = covariance.determinant().ln();
            assert!((noise.log_determinant() - expected).abs() < 1e-9);
            // Products without the map, less what the effects take.
            let (w, c) = noise.taken();
            let width = c.len() / BOUNDS.len();
            let mut gram = noise.correlated_gram();
            for (run, &(start, stop)) in BOUNDS.iter().enumerate() {
                for k in 0..width {
                    for (i, j) in (start..stop).flat_map(|i| (start..stop).map(move |j| (i, j))) {
                        gram[(i, j)] -= w[k * N + i] * c[run * width + k] * w[k * N + j];
                    }
                }
            }
            assert!((gram - map.tr_mul(&map)).amax() < 1e-12);
        }
    }

    impl Noise {
        /// `F'F` of the filter alone.
        fn correlated_gram(&self) -> DMatrix<f64> {
            let unit = DMatrix::<f64>::identity(N, N);
            let filter = DMatrix::from_vec(N, N, self.filtered(unit.as_slice()));
            filter.tr_mul(&filter)
        }
    }

    /// `Z S Z' V^-1 y` of white noise beside, of all effects or some.
    #[test]
    fn what_runs_draw_is_guessed_best() {
        let (noise, covariance) = noise(0.0, false, [0.4, 7.0]);
        let y = DVector::from_fn(N, |i, _| wave(i, 7));
        let weighed = covariance.lu().solve(&y).unwrap();
        for factors in [None, Some([1.0, 0.0, 0.0]), Some([0.0, 1.0, 1.0])] {
            let found = noise.run_part(y.as_slice(), factors.as_ref().map(|f| &f[..]));
            for &(start, stop) in &BOUNDS {
                for (i, found) in found.iter().enumerate().take(stop).skip(start) {
                    let shape = |k: usize, i: usize| noise.shapes[k * N + i];
                    let part = |k: usize| {
                        let along: f64 = (start..stop).map(|j| shape(k, j) * weighed[j]).sum();
                        factors.map_or(1.0, |f| f[k]) * shape(k, i) * along
                    };
                    let expected: f64 = (0..3).map(part).sum();
                    assert!((found - expected).abs() < 1e-10);
                }
            }
        }
    }

    /// Two columns that are one: their sum is known, their difference is as before.
    #[test]
    fn powers_beside_which_the_unit_is_lost() {
        for power in [2.0_f64.powi(10), 2.0_f64.powi(60)] {
            let share = power / (1.0 + 2.0 * power);
            let found = inverse_beside_one(DMatrix::from_element(2, 2, power));
            let expected = DMatrix::identity(2, 2) - DMatrix::from_element(2, 2, share);
            assert!((found - expected).amax() < 1e-9);
        }
    }

    #[test]
    fn an_effect_far_larger_than_the_noise_and_than_another_takes_all() {
        let ramp = |i: usize| i as f64 / 11.5 - 1.0;
        let shapes: Vec<f64> = (0..2 * N)
            .map(|at| if at < N { 1.0 } else { 1e8 * ramp(at - N) })
            .collect();
        let effects = [RunEffect {
            shapes: &shapes,
            ratio: 1e4,
        }];
        let noise = Noise::new(BOUNDS.to_vec(), 0.0, None, &effects).unwrap();
        let y: Vec<f64> = (0..N).map(|i| 3.0 + 2.0 * ramp(i)).collect();
        for (part, y) in noise.run_part(&y, None).iter().zip(&y) {
            assert!((part - y).abs() < 1e-3);
        }
    }

    #[test]
    fn shapes_that_are_no_numbers_are_no_noise() {
        let shapes = [1.0, f64::NAN, 2.0];
        let effects = [RunEffect {
            shapes: &shapes,
            ratio: 1.0,
        }];
        assert!(Noise::new(vec![(0, 3)], 0.0, None, &effects).is_none());
    }
}
