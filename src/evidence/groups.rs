//! Groups of columns under one noise: which are in, beside some that are given.
//!
//! Of all readings with one zero the Gram matrix is enough: the search, evidences and posteriors
//! need no further pass.

use nalgebra::DMatrix;

use super::gains::Solved;
use super::gram::{Gram, Sums};
use super::model::Model;
use super::posterior::Posterior;
use super::prior::Prior;
use super::readings::Readings;
use super::search::{Found, Search};
use super::whitening::Noise;

/// Gram matrix of groups of columns under a noise.
#[derive(Clone, Debug)]
pub struct GroupSums {
    gram: Gram,
    widths: Vec<usize>,
    total: f64,
}

/// What changes of a model do to its log evidence.
#[derive(Clone, Debug)]
pub struct Changes {
    /// What each group's leaving takes; 0 of those that are out.
    pub losses: Vec<f64>,
    /// What each group's coming in gives at its best size; 0 of those that are in.
    pub gains: Vec<f64>,
    /// The same of each group (columns) in a model without one that is in (rows).
    pub instead: DMatrix<f64>,
}

impl Readings {
    /// Sums of all runs with one zero, under a noise; `total` is the variance of the errors.
    pub fn group_sums(&self, noise: Noise, total: f64) -> GroupSums {
        GroupSums {
            gram: self.pooled(noise),
            widths: self.widths(),
            total,
        }
    }
}

impl GroupSums {
    /// Columns of each group.
    pub fn widths(&self) -> &[usize] {
        &self.widths
    }

    /// Variances that a group may have.
    pub fn sizes(&self) -> Vec<f64> {
        Prior::of(Vec::new(), self.total, 1).sizes
    }

    /// The groups of most probability beside those that are `given` with a variance above 0, which
    /// stay as they are; groups of probability 0 stay out.
    ///
    /// It goes from the other groups that have a variance in `start`. The score is the logarithm of
    /// the evidence times the prior, over that of the other groups all being out.
    pub fn search(&self, given: &[f64], probabilities: &[f64], start: &[f64]) -> Option<Found> {
        let is_free = |k: &usize| given[*k] == 0.0 && probabilities[*k] > 0.0;
        let free: Vec<usize> = (0..given.len()).filter(is_free).collect();
        let own: Vec<f64> = free.iter().map(|&k| probabilities[k]).collect();
        let prior = Prior::of(own, self.total, 1);
        let grams = [self.beside(given, &free)];
        let widths = free.iter().map(|&k| self.widths[k]).collect();
        let start = Model::of_groups(widths, free.iter().map(|&k| start[k]).collect());
        let mut search = Search::new(&grams, &prior, 0.0);
        let found = search.from(start)?;
        let none: f64 = prior.probabilities.iter().map(|p| (1.0 - p).ln()).sum();
        let mut tau = given.to_vec();
        for (&k, own) in free.iter().zip(&found.model.tau) {
            tau[k] = *own;
        }
        Some(Found {
            score: found.score - none,
            model: Model::of_groups(self.widths.clone(), tau),
        })
    }

    /// `X' C^-1 X` of all columns, without a zero beside them.
    pub fn information(&self) -> DMatrix<f64> {
        let gram = &self.gram;
        &gram.sums.products + gram.information * &gram.means * gram.means.transpose()
    }

    /// Posterior of the coefficients of a model's groups.
    pub fn posterior(&self, tau: &[f64]) -> Option<Posterior> {
        self.model(tau).posterior(std::slice::from_ref(&self.gram))
    }

    /// What leaving, coming in and exchange of groups do to a model.
    pub fn changes(&self, tau: &[f64]) -> Option<Changes> {
        let solved = Solved::of(self.model(tau), &self.gram.sums)?;
        let (sizes, groups) = (self.sizes(), tau.len());
        let mut found = Changes {
            losses: vec![0.0; groups],
            gains: vec![0.0; groups],
            instead: DMatrix::zeros(groups, groups),
        };
        let (inside, outside): (Vec<usize>, Vec<usize>) = (0..groups).partition(|&k| tau[k] > 0.0);
        for &j in &outside {
            found.gains[j] = solved.outside(j).best(&sizes).1;
        }
        for &k in &inside {
            let without = solved.without(k)?;
            found.losses[k] = without.loss;
            for &j in &outside {
                found.instead[(k, j)] = without.other(j).best(&sizes).1;
            }
        }
        Some(found)
    }

    fn model(&self, tau: &[f64]) -> Model {
        Model::of_groups(self.widths.clone(), tau.to_vec())
    }

    /// Some groups, those given being integrated over.
    fn beside(&self, given: &[f64], free: &[usize]) -> Gram {
        let model = self.model(given);
        let bounds = model.bounds();
        let columns: Vec<usize> = free
            .iter()
            .flat_map(|&k| bounds[k].0..bounds[k].1)
            .collect();
        let mut sums = Sums::zeros(columns.len(), 1);
        let variances = model.by_column(given);
        self.gram
            .sums
            .add_without_effects(&variances, &columns, &mut sums);
        Gram {
            sums,
            means: self.gram.means.select_rows(&columns),
            ..self.gram.clone()
        }
    }
}
