//! Noise of readings in runs, and the linear map that makes it white.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use std::sync::OnceLock;

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, DVectorView, DVectorViewMut};

use super::products::{Order, Products, Table};
use super::ratio::eigensystem;
use super::{Beside, Correlated};
use crate::interrupt;
use crate::lstsq::product;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// Readings of which axes are taken off at a time: they stay in the first cache.
const CHUNK: usize = 256;

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
    /// Directions at right angles that the filtered shapes span in every run, column by column, the
    /// last ones zeros where there are fewer; then as many zeros as a vector may read beyond.
    axes: Vec<f64>,
    /// What the map takes off along each, run by run.
    shrink: Vec<f64>,
    /// Of every run, without the weights; and of all, with them.
    log_determinants: Vec<f64>,
    log_determinant: f64,
    /// `(I + Z' Z)^(-1)` of every run's shapes `Z`, made when they are asked for.
    shares: OnceLock<Vec<DMatrix<f64>>>,
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
        let white = -(-rho * rho).ln_1p();
        let mut made = Self {
            log_determinants: vec![white; bounds.len()],
            log_determinant: 0.0,
            bounds,
            rho,
            roots,
            shapes,
            axes: Vec::new(),
            shrink: Vec::new(),
            shares: OnceLock::new(),
        };
        if !made.shapes.is_empty() {
            made.turn()?;
        }
        let weights = made.roots.iter().flatten();
        let weights = weights.map(|root| root.ln()).sum::<f64>();
        made.log_determinant = made.log_determinants.iter().sum::<f64>() - 2.0 * weights;
        Some(made)
    }

    /// Shapes turned to right angles in every run: those of them that add something to the others.
    fn turn(&mut self) -> Option<()> {
        let n = self.readings();
        let width = self.shapes.len() / n;
        let filtered = self.filtered(&self.shapes);
        let grams = self.grams(&filtered, width);
        self.axes = vec![0.0; n * width + MOST_LANES];
        self.shrink = vec![0.0; self.bounds.len() * width];
        let shapes = DMatrixView::from_slice(&filtered, n, width);
        for (run, (gram, &(start, stop))) in grams.into_iter().zip(&self.bounds).enumerate() {
            interrupt::point();
            let found = eigensystem(gram)?;
            let power = found.eigenvalues;
            let limit = VANISHES * power.max().max(0.0);
            let kept: Vec<usize> = (0..width).filter(|&k| power[k] > limit).collect();
            let turns = found.eigenvectors.select_columns(&kept);
            let own = product(shapes.rows(start, stop - start), turns.as_view());
            for (j, (axis, &k)) in own.column_iter().zip(&kept).enumerate() {
                let size = 1.0 / power[k].sqrt();
                let out = &mut self.axes[j * n + start..j * n + stop];
                out.iter_mut()
                    .zip(axis.iter())
                    .for_each(|(out, x)| *out = size * x);
                self.shrink[run * width + j] = 1.0 - 1.0 / (1.0 + power[k]).sqrt();
                self.log_determinants[run] += power[k].ln_1p();
            }
        }
        Some(())
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
        !self.shrink.is_empty()
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
        self.log_determinant
    }

    /// The part of one run, without that of the weights; None where there is no such run.
    pub fn log_determinant_of(&self, run: usize) -> Option<f64> {
        self.log_determinants.get(run).copied()
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
            let grams = self.grams(&self.shapes, self.width());
            grams.into_iter().map(inverse_beside_one).collect()
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
        let axes = &self.axes[..self.readings() * self.width()];
        let shares = self.shrink.iter().map(|shrink| shrink * (2.0 - shrink));
        (self.filtered_back(axes), shares.collect())
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

    /// Shapes of run effects.
    fn width(&self) -> usize {
        self.shrink.len() / self.bounds.len().max(1)
    }

    fn shrink(&self, columns: &mut [f64]) {
        if !self.has_effects() || columns.is_empty() {
            return;
        }
        let (count, width) = (columns.len() / self.readings(), self.width());
        let mut powers = vec![0.0; self.bounds.len() * count];
        let mut inner = vec![0.0; self.bounds.len() * count * width];
        let work = Products {
            noise: self.white(),
            x: (columns, count),
            order: Order::Columns,
            seen: (&self.axes, width),
            each: true,
            pairs: false,
            grams: &mut powers,
            moments: &mut inner,
        };
        dispatch(InstructionSet::best(), work);
        for (inner, shrink) in inner
            .chunks_exact_mut(count * width)
            .zip(self.shrink.chunks_exact(width))
        {
            for (k, inner) in inner.iter_mut().enumerate() {
                *inner *= shrink[k % width];
            }
        }
        let work = TakenOff {
            bounds: &self.bounds,
            axes: (&self.axes, width),
            sizes: &inner,
            columns: (columns, count),
        };
        dispatch(InstructionSet::best(), work);
    }

    /// Products of columns with each other in every run.
    fn grams(&self, columns: &[f64], count: usize) -> Vec<DMatrix<f64>> {
        let size = count * count;
        let mut grams = vec![0.0; self.bounds.len() * size];
        let work = Products {
            noise: self.white(),
            x: (columns, count),
            order: Order::Columns,
            seen: (&[], 0),
            each: true,
            pairs: true,
            grams: &mut grams,
            moments: &mut [],
        };
        dispatch(InstructionSet::best(), work);
        let whole =
            |gram: &[f64]| DMatrix::from_fn(count, count, |i, j| gram[i.min(j) * count + i.max(j)]);
        grams.chunks_exact(size).map(whole).collect()
    }

    /// The runs, and nothing to filter.
    pub(super) fn white(&self) -> Correlated<'_> {
        Correlated {
            bounds: &self.bounds,
            rho: 0.0,
            roots: None,
        }
    }
}

/// Columns less axes of such sizes: in every run for every column of every axis.
struct TakenOff<'a> {
    bounds: &'a [(usize, usize)],
    axes: Table<'a>,
    sizes: &'a [f64],
    columns: (&'a mut [f64], usize),
}

impl Kernel for TakenOff<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let ((axes, width), (columns, count)) = (self.axes, self.columns);
        let n = self.bounds.last().map_or(0, |&(_, stop)| stop);
        for run in 0..self.bounds.len() {
            interrupt::point();
            let (first, last) = self.bounds[run];
            for start in (first..last).step_by(CHUNK) {
                let some = CHUNK.min(last - start);
                for k in 0..count {
                    let out = &mut columns[k * n + start..][..some];
                    for j in 0..width {
                        let size = self.sizes[(run * count + k) * width + j];
                        let axis = &axes[j * n + start..][..some];
                        for i in 0..some {
                            out[i] -= size * axis[i];
                        }
                    }
                }
            }
        }
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
            assert!(noise.map(&[]).is_empty());
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
