//! Noise of readings in runs, and the linear map that makes it white.

use std::sync::OnceLock;

use nalgebra::{Cholesky, DMatrix, DMatrixView, DVector, DVectorView, DVectorViewMut};

use super::axes::TakenOff;
use super::products::{Order, Products};
use super::ratio::eigensystem;
use super::{Beside, Correlated};
use crate::interrupt;
use crate::lstsq::product;
use crate::simd::{InstructionSet, MOST_LANES, dispatch};

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
mod tests;
