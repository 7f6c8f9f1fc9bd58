//! Columns beside a fit: what of them is not fitted, and what they would save.

use nalgebra::{DMatrix, DVector};

use super::golden::golden;
use super::products::{Order, Products, Table};
use super::ratio::eigensystem;
use super::{Correlated, Left, RunProducts, best_ratio};
use crate::kernel::lines;
use crate::simd::{InstructionSet, MOST_LANES, dispatch};

/// A fit under a noise that M makes white, as columns that are not mapped by it see it.
///
/// Products `(M X)' Q` with the fitted columns `Q`, orthonormal, are `X' (M' Q)`: the few are
/// mapped once, and the many that are tried beside them never are.
#[derive(Clone, Debug)]
pub struct Beside {
    bounds: Vec<(usize, usize)>,
    rho: f64,
    roots: Option<Vec<f64>>,
    /// Column by column: what is fitted, what that leaves, the shapes of run effects; then as
    /// many zeros as a vector may read beyond the last.
    seen: Vec<f64>,
    readings: usize,
    fitted: usize,
    /// What every run takes off products with each shape.
    shares: Vec<f64>,
    left: Left,
    excited: f64,
}

/// What is known of some columns one by one.
#[derive(Clone, Debug, Default)]
pub struct Powers {
    /// Power of each.
    pub before: Vec<f64>,
    /// What of the power is not fitted.
    pub after: Vec<f64>,
    /// Products with what the fit leaves.
    pub moment: Vec<f64>,
}

impl Beside {
    /// Of a fit of so many readings under a noise, column by column: the orthonormal columns
    /// `fitted` and what they leave, both under `M`; of run effects the shapes, under the
    /// transposed filter, and what each run takes off products with them. Columns of which a share
    /// of at most `excited` of the power is left are not told from the fitted ones.
    pub fn new(
        noise: Correlated<'_>,
        fitted: &[f64],
        residual: &[f64],
        (shapes, shares): (&[f64], &[f64]),
        squares: f64,
        excited: f64,
    ) -> Self {
        let n = residual.len();
        let mapped = fitted.len() + n;
        let mut seen = vec![0.0; mapped + shapes.len() + MOST_LANES];
        let from = fitted.chunks_exact(n.max(1)).chain([residual]);
        for (from, to) in from.zip(seen.chunks_exact_mut(n.max(1))) {
            if noise.is_white() {
                to.copy_from_slice(from);
            } else {
                noise.filtered_back(from, 1, to);
            }
        }
        seen[mapped..mapped + shapes.len()].copy_from_slice(shapes);
        Self {
            bounds: noise.bounds.to_vec(),
            rho: noise.rho,
            roots: noise.roots.map(<[f64]>::to_vec),
            seen,
            readings: n,
            fitted: fitted.len() / n.max(1),
            shares: shares.to_vec(),
            left: Left {
                readings: n as f64,
                squares,
            },
            excited,
        }
    }

    /// Readings of the fit.
    pub fn readings(&self) -> usize {
        self.readings
    }

    /// The fitted columns and what they leave, one after the other.
    pub fn seen(&self) -> &[f64] {
        &self.seen[..(self.fitted + 1) * self.readings]
    }

    /// Deviance that columns save together, and their coefficients: zeros where the fit or the
    /// others have nearly all of one.
    pub fn gain(&self, (x, k): Table<'_>) -> (f64, Vec<f64>) {
        let nothing = (0.0, vec![0.0; k]);
        let products = self.total(x, k);
        let known = products.moments.columns(0, self.fitted);
        let beside = &products.gram - known * known.transpose();
        let counts = |i| beside[(i, i)] > self.excited * products.gram[(i, i)].max(1e-300);
        if k == 0 || !(0..k).all(counts) {
            return nothing;
        }
        let lengths = beside.diagonal().map(f64::sqrt);
        let unit = beside.component_div(&(&lengths * lengths.transpose()));
        let Some(found) = eigensystem(unit) else {
            return nothing;
        };
        if found.eigenvalues.min() < self.excited * found.eigenvalues.max() {
            return nothing;
        }
        let scaled = products.moments.column(self.fitted).component_div(&lengths);
        let moment = found.eigenvectors.tr_mul(&scaled);
        let part = moment.component_div(&found.eigenvalues);
        let coefficients: DVector<f64> = (found.eigenvectors * &part).component_div(&lengths);
        let saved = part.dot(&moment);
        (self.left.deviance(saved), coefficients.as_slice().to_vec())
    }

    /// Powers of columns one by one, and their products with what the fit leaves.
    pub fn powers(&self, (x, k): Table<'_>) -> Powers {
        let (mut found, width) = (Powers::default(), self.width());
        let (grams, moments) =
            self.products((x, k), Order::Readings, !self.shares.is_empty(), false);
        for j in 0..k {
            let mut before = 0.0;
            let mut own = vec![0.0; self.fitted + 1];
            for (run, grams) in grams.chunks_exact(k).enumerate() {
                let row = &moments[(run * k + j) * width..][..width];
                let (fit, shapes) = row.split_at(self.fitted + 1);
                let taken = self.shares_of(run).iter().zip(shapes);
                before += grams[j] - taken.map(|(c, p)| c * p * p).sum::<f64>();
                own.iter_mut().zip(fit).for_each(|(sum, part)| *sum += part);
            }
            let known: f64 = own[..self.fitted].iter().map(|part| part * part).sum();
            found.before.push(before);
            found.after.push(before - known);
            found.moment.push(own[self.fitted]);
        }
        found
    }

    /// Best ratio of variances of an error that every run draws anew from these shapes, and the
    /// deviance that it saves; None where a number is not finite. See [`best_ratio`].
    pub fn ratio(&self, x: Table<'_>, order: Order) -> Option<(f64, f64)> {
        let k = x.1;
        let (grams, moments) = self.products(x, order, true, true);
        let runs: Vec<_> = (0..self.bounds.len())
            .map(|run| self.of_run(run, k, &grams, &moments))
            .collect();
        best_ratio(&runs, self.left)
    }

    /// Order of a line with a phase of its own in every run, between two, that saves most, and the
    /// deviance: of angles in radians, by so many golden sections. Cosines and sines that
    /// [`vanished`](lines::vanished) are none. None where a number is not finite.
    pub fn line(
        &self,
        angles: &[f64],
        span: (f64, f64),
        steps: usize,
        vanishing: f64,
    ) -> Option<(f64, f64)> {
        let (mut rows, mut is_finite) = (vec![0.0; 2 * angles.len()], true);
        let saved = |order: f64| {
            let orders = [order];
            let made = lines::columns(angles, &orders, &mut rows);
            lines::vanished(&orders, vanishing, &mut rows);
            let found = made
                .ok()
                .and_then(|()| self.ratio((&rows, 2), Order::Readings));
            is_finite &= found.is_some();
            found.map_or(f64::NAN, |(_, deviance)| deviance)
        };
        let found = golden(saved, span, steps);
        is_finite.then_some(found)
    }

    /// Deviance that a column saves alone: none where the fit has nearly all of it.
    pub fn gain_of_one(&self, x: &[f64]) -> f64 {
        let found = self.powers((x, 1));
        let (before, after, moment) = (found.before[0], found.after[0], found.moment[0]);
        if after > self.excited * before.max(1e-300) {
            self.left.deviance(moment * moment / after)
        } else {
            0.0
        }
    }

    /// Coefficients of columns beside the fit, where it has not nearly all of one.
    pub fn coefficients(&self, (x, k): Table<'_>) -> Option<Vec<f64>> {
        let products = self.total(x, k);
        let known = products.moments.columns(0, self.fitted);
        let beside = &products.gram - known * known.transpose();
        let counts = |i| beside[(i, i)] > self.excited * products.gram[(i, i)].max(1e-300);
        if !(0..k).all(counts) {
            return None;
        }
        let lengths = beside.diagonal().map(f64::sqrt);
        let found = eigensystem(beside.component_div(&(&lengths * lengths.transpose())))?;
        let scaled = products.moments.column(self.fitted).component_div(&lengths);
        let moment = found.eigenvectors.tr_mul(&scaled);
        let limit = super::rank_limit(k) * found.eigenvalues.max();
        let part = moment.zip_map(
            &found.eigenvalues,
            |m, v| if v > limit { m / v } else { 0.0 },
        );
        let solved = (found.eigenvectors * part).component_div(&lengths);
        Some(solved.as_slice().to_vec())
    }

    fn noise(&self) -> Correlated<'_> {
        Correlated {
            bounds: &self.bounds,
            rho: self.rho,
            roots: self.roots.as_deref(),
        }
    }

    fn width(&self) -> usize {
        self.seen.len().saturating_sub(MOST_LANES) / self.readings.max(1)
    }

    fn shares_of(&self, run: usize) -> &[f64] {
        let shapes = self.width().saturating_sub(self.fitted + 1);
        self.shares
            .get(run * shapes..(run + 1) * shapes)
            .unwrap_or(&[])
    }

    /// Products of all runs together.
    fn total(&self, x: &[f64], k: usize) -> RunProducts {
        let each = !self.shares.is_empty();
        let (grams, moments) = self.products((x, k), Order::Readings, each, true);
        let mut runs = 0..if each { self.bounds.len() } else { 1 };
        let first = runs.next().unwrap_or(0);
        let mut total = self.of_run(first, k, &grams, &moments);
        for run in runs {
            let one = self.of_run(run, k, &grams, &moments);
            total.gram += one.gram;
            total.moments += one.moments;
        }
        total
    }

    /// Products of a run, less what run effects take.
    fn of_run(&self, run: usize, k: usize, grams: &[f64], moments: &[f64]) -> RunProducts {
        let width = self.width();
        let gram = &grams[run * k * k..][..k * k];
        let all = &moments[run * k * width..][..k * width];
        let (shares, at) = (self.shares_of(run), self.fitted + 1);
        let part = |i: usize, j: usize| all[i * width + at + j];
        let taken = |i, j| {
            let pairs = shares.iter().enumerate();
            pairs.map(|(s, c)| c * part(i, s) * part(j, s)).sum::<f64>()
        };
        RunProducts {
            gram: DMatrix::from_fn(k, k, |i, j| gram[i.min(j) * k + i.max(j)] - taken(i, j)),
            moments: DMatrix::from_fn(k, at, |i, j| all[i * width + j]),
        }
    }

    /// Products of mapped columns with each other (of the filter alone; the upper triangle) or
    /// their powers, and of columns with what is seen: of each run, or of all together.
    fn products(
        &self,
        (x, k): Table<'_>,
        order: Order,
        each: bool,
        pairs: bool,
    ) -> (Vec<f64>, Vec<f64>) {
        let runs = if each { self.bounds.len() } else { 1 };
        let size = if pairs { k * k } else { k };
        let mut grams = vec![0.0; runs * size];
        let mut moments = vec![0.0; runs * k * self.width()];
        let work = Products {
            noise: self.noise(),
            x: (x, k),
            order,
            seen: (&self.seen, self.width()),
            each,
            pairs,
            grams: &mut grams,
            moments: &mut moments,
        };
        dispatch(InstructionSet::best(), work);
        (grams, moments)
    }
}
