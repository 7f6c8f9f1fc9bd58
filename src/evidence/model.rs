//! Which groups of columns are in, with which prior variances.

use nalgebra::{Cholesky, DMatrix};

use super::gram::{Gram, Sums};
use super::posterior::Posterior;

/// Prior variances of groups of columns: a group with neither is not in the model.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Columns of each group.
    pub widths: Vec<usize>,
    /// Of the coefficients that all runs share.
    pub tau: Vec<f64>,
    /// Of what differs from run to run.
    pub omega: Vec<f64>,
}

impl Model {
    /// Groups of two columns, all of them with the same variance.
    pub fn of_orders(orders: usize, tau: f64) -> Self {
        Self {
            widths: vec![2; orders],
            tau: vec![tau; orders],
            omega: vec![0.0; orders],
        }
    }

    /// Groups of these widths with a variance each, the same in every run.
    pub fn of_groups(widths: Vec<usize>, tau: Vec<f64>) -> Self {
        let omega = vec![0.0; tau.len()];
        Self { widths, tau, omega }
    }

    /// Groups with a variance that all runs share.
    pub fn active(&self) -> Vec<usize> {
        (0..self.tau.len()).filter(|&k| self.tau[k] > 0.0).collect()
    }

    /// True of a group that has a variance.
    pub fn has(&self, group: usize) -> bool {
        self.tau[group] > 0.0 || self.omega[group] > 0.0
    }

    /// Some groups alone.
    pub fn among(&self, groups: &[usize]) -> Self {
        let picked = |values: &[f64]| groups.iter().map(|&k| values[k]).collect();
        Self {
            widths: groups.iter().map(|&k| self.widths[k]).collect(),
            tau: picked(&self.tau),
            omega: picked(&self.omega),
        }
    }

    /// Of groups at places `from`, the same at places `to`.
    pub fn among_places(&self, from: &[usize], to: &[usize]) -> Self {
        let at = |values: &[f64]| {
            let value = |place: &usize| from.binary_search(place).map_or(0.0, |k| values[k]);
            to.iter().map(value).collect()
        };
        Self {
            widths: vec![2; to.len()],
            tau: at(&self.tau),
            omega: at(&self.omega),
        }
    }

    /// First column and the one past the last of each group.
    pub fn bounds(&self) -> Vec<(usize, usize)> {
        let ends = self.widths.iter().scan(0, |end, width| {
            let start = *end;
            *end += width;
            Some((start, *end))
        });
        ends.collect()
    }

    /// A value of each group at each of its columns.
    pub(super) fn by_column(&self, values: &[f64]) -> Vec<f64> {
        let each = self.widths.iter().zip(values);
        each.flat_map(|(&width, &value)| std::iter::repeat_n(value, width))
            .collect()
    }

    /// Sums over runs of all columns, without the effects of runs:
    /// `G_r - G_r W (I + W G_r W)^-1 W G_r` with `W` the roots of `omega` (Woodbury).
    pub fn sums(&self, grams: &[Gram]) -> Sums {
        let all: Vec<usize> = (0..self.widths.iter().sum()).collect();
        self.sums_of(grams, &all)
    }

    /// Of some columns.
    fn sums_of(&self, grams: &[Gram], columns: &[usize]) -> Sums {
        let omega = self.by_column(&self.omega);
        let targets = grams.first().map_or(1, |gram| gram.sums.moments.ncols());
        let mut total = Sums::zeros(columns.len(), targets);
        for gram in grams {
            gram.sums.add_without_effects(&omega, columns, &mut total);
        }
        total
    }

    /// Posterior of the shared coefficients; None where a covariance is not positive by rounding.
    ///
    /// It is computed from the columns of groups that are in.
    pub fn posterior(&self, grams: &[Gram]) -> Option<Posterior> {
        let tau = self.by_column(&self.tau);
        let active: Vec<usize> = (0..tau.len()).filter(|&c| tau[c] > 0.0).collect();
        let sums = self.sums_of(grams, &active);
        let own: Vec<f64> = active.iter().map(|&c| tau[c]).collect();
        Posterior::of(&sums, &own, active)
    }
}

impl Sums {
    /// Adds some columns of a run to `total`, without its effects of variances `omega`.
    pub(super) fn add_without_effects(&self, omega: &[f64], columns: &[usize], total: &mut Self) {
        let picked = |rows: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, k| {
                self.products[(rows[i], columns[k])]
            })
        };
        total.products += picked(columns);
        total.moments += self.moments.select_rows(columns);
        total.squares += &self.squares;
        total.log_scale += self.log_scale;
        let on: Vec<usize> = (0..omega.len()).filter(|&c| omega[c] > 0.0).collect();
        if on.is_empty() {
            return;
        }
        let Some(effects) = Effects::of(&self.products, omega, &on) else {
            total.log_scale = f64::NAN;
            return;
        };
        let x = effects.whitened(picked(&on));
        let y = effects.whitened(self.moments.select_rows(&on));
        total.products -= x.tr_mul(&x);
        total.moments -= x.tr_mul(&y);
        total.squares -= y.tr_mul(&y);
        total.log_scale -= effects.log_root();
    }
}

/// `I + W G W = L L'` of the columns that differ from run to run.
pub(super) struct Effects {
    lower: DMatrix<f64>,
    roots: Vec<f64>,
}

impl Effects {
    /// Of columns `on`.
    pub(super) fn of(products: &DMatrix<f64>, omega: &[f64], on: &[usize]) -> Option<Self> {
        let roots: Vec<f64> = on.iter().map(|&c| omega[c].sqrt()).collect();
        let inner = DMatrix::from_fn(on.len(), on.len(), |i, k| {
            let unit = if i == k { 1.0 } else { 0.0 };
            unit + roots[i] * products[(on[i], on[k])] * roots[k]
        });
        let lower = Cholesky::new(inner)?.unpack();
        Some(Self { lower, roots })
    }

    /// `L^-1 W rows`.
    pub(super) fn whitened(&self, mut rows: DMatrix<f64>) -> DMatrix<f64> {
        for (i, root) in self.roots.iter().enumerate() {
            rows.row_mut(i).scale_mut(*root);
        }
        self.lower.solve_lower_triangular_unchecked_mut(&mut rows);
        rows
    }

    fn log_root(&self) -> f64 {
        self.lower.diagonal().map(f64::ln).sum()
    }
}
