//! The search for groups and their sizes: in, out, exchange, size, effect of runs.
//!
//! One move at a time, the one that gains most, until none gains. Gains in, out, of sizes and of
//! exchanges are closed forms ([`Solved`]): with `m` columns in, a round over `K` groups costs
//! `O(K m^2)`. A variance from run to run changes the sums of every run: such a move is factorised,
//! from the columns that are in, and tried only where no other move gains. Every model evaluated
//! within the window of the best is kept.

use std::collections::BTreeMap;

use super::gains::{Solved, Wide};
use super::gram::{Gram, Sums};
use super::model::Model;
use super::prior::Prior;
use crate::interrupt;

/// Moves at most.
const MOVES: usize = 200;

/// Other variances from run to run that are tried before one that gains is taken.
const PROMISING: usize = 3;

/// Gain below which a move is rounding.
const GAIN: f64 = 1e-7;

/// Models whose neighbours are met at last, and how near to the best they must be.
const WIDENED: usize = 8;
const NEAR: f64 = 1.5;

/// A model and the logarithm of its evidence times its prior.
#[derive(Clone, Debug)]
pub struct Found {
    /// The model.
    pub model: Model,
    /// Of evidence and prior.
    pub score: f64,
}

/// Models within a window of the best, under one noise.
#[derive(Debug)]
pub struct Search<'a> {
    grams: &'a [Gram],
    prior: &'a Prior,
    window: f64,
    best: f64,
    /// The best sizes of each set of groups with their effects of runs (bits of `omega`).
    met: BTreeMap<Vec<(usize, bool, u64)>, Found>,
    /// Sums without the effects of runs, for the variances used last.
    sums: Option<(Vec<f64>, Sums)>,
}

impl<'a> Search<'a> {
    /// Under the noise of these Gram matrices.
    pub fn new(grams: &'a [Gram], prior: &'a Prior, window: f64) -> Self {
        Self {
            grams,
            prior,
            window,
            best: f64::NEG_INFINITY,
            met: BTreeMap::new(),
            sums: None,
        }
    }

    /// The best model within reach of `start` by moves that gain; None where its evidence cannot be
    /// computed.
    pub fn from(&mut self, start: Model) -> Option<Found> {
        let mut now = self.solved(start)?;
        let mut score = self.score(&now);
        self.meet(&now.model, score);
        for _ in 0..MOVES {
            interrupt::point();
            let mut next = self.best_move(&now, score)?;
            if next.score <= score + GAIN {
                next = self.best_effect(&now, next)?;
            }
            if next.score <= score + GAIN {
                break;
            }
            // Closed forms and factorisations differ by rounding: no move counts that loses.
            let solved = self.solved(next.model)?;
            let reached = self.score(&solved);
            if reached <= score {
                break;
            }
            (now, score) = (solved, reached);
            self.meet(&now.model, score);
        }
        Some(Found {
            model: now.model,
            score,
        })
    }

    /// Meets the neighbours of the models that are nearly the best, so that orders which are alike
    /// are treated alike, and every size of what differs from run to run in the best: few runs tell
    /// it roughly.
    pub fn widen(&mut self) -> Option<()> {
        let mut near: Vec<Found> = self.met.values().cloned().collect();
        near.sort_by(|a, b| b.score.total_cmp(&a.score));
        let best = near.first()?.model.clone();
        for k in (0..best.omega.len()).filter(|&k| best.omega[k] > 0.0) {
            for &omega in &self.prior.effects {
                let model = with(&best, &[(k, best.tau[k], omega)]);
                self.factorised(model, &mut None)?;
            }
        }
        for found in near.into_iter().take(WIDENED) {
            if found.score < self.best - NEAR {
                break;
            }
            let solved = self.solved(found.model)?;
            self.best_move(&solved, found.score)?;
        }
        Some(())
    }

    /// Models within the window of the best, best first.
    pub fn models(self) -> Vec<Found> {
        let least = self.best - self.window;
        let mut kept: Vec<Found> = self.met.into_values().filter(|f| f.score > least).collect();
        kept.sort_by(|a, b| b.score.total_cmp(&a.score));
        kept
    }

    fn score(&self, solved: &Solved) -> f64 {
        solved.log_evidence + self.prior.log_probability(&solved.model)
    }

    fn solved(&mut self, model: Model) -> Option<Solved> {
        if self
            .sums
            .as_ref()
            .is_none_or(|(omega, _)| *omega != model.omega)
        {
            self.sums = Some((model.omega.clone(), model.sums(self.grams)));
        }
        let (_, sums) = self.sums.as_ref()?;
        Solved::of(model, sums)
    }

    fn meet(&mut self, model: &Model, score: f64) {
        self.best = self.best.max(score);
        if score <= self.best - self.window {
            return;
        }
        let found = || Found {
            model: model.clone(),
            score,
        };
        let has = (0..model.tau.len()).filter(|&k| model.has(k));
        let key = has.map(|k| (k, model.tau[k] > 0.0, model.omega[k].to_bits()));
        let key = key.collect();
        let own = self.met.entry(key).or_insert_with(found);
        if score > own.score {
            *own = found();
        }
    }

    /// Evaluates the neighbours of a model by closed forms; returns the best of it and them.
    fn best_move(&mut self, now: &Solved, score: f64) -> Option<Found> {
        let mut best = Some(Found {
            model: now.model.clone(),
            score,
        });
        let groups = now.model.tau.len();
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..groups).partition(|&k| now.model.tau[k] > 0.0);
        for &j in &outside {
            self.enter(now, j, score, &mut best);
        }
        let greatest = self.prior.sizes.iter().copied().fold(0.0, f64::max);
        let others: Vec<_> = outside
            .iter()
            .map(|&j| (j, now.wide(j, greatest)))
            .collect();
        for &k in &inside {
            self.resize(now, k, score, &mut best)?;
            if now.model.omega[k] == 0.0 {
                self.leave(now, k, &others, score, &mut best)?;
            }
        }
        best
    }

    /// Evaluates other variances from run to run; returns the best of these models and `other`.
    ///
    /// Those that promise most come first. Where none of them gains, all within the window follow.
    fn best_effect(&mut self, now: &Solved, other: Found) -> Option<Found> {
        let score = self.score(now);
        let mut promising = self.effects(now, score);
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best = Some(other);
        for (i, (_, k, tau, omega)) in promising.into_iter().enumerate() {
            if i >= PROMISING && best.as_ref().is_some_and(|b| b.score > score + GAIN) {
                return best;
            }
            self.factorised(with(&now.model, &[(k, tau, omega)]), &mut best)?;
        }
        let (inside, outside): (Vec<usize>, Vec<usize>) =
            (0..now.model.tau.len()).partition(|&k| now.model.tau[k] > 0.0);
        for k in inside.into_iter().filter(|&k| now.model.omega[k] > 0.0) {
            self.leave_with_effect(now, k, &outside, &mut best)?;
        }
        best
    }

    /// Other variances from run to run of each group, also of those that are out, with about the
    /// score of the model: the shared coefficients stay as they are.
    fn effects(&self, now: &Solved, score: f64) -> Vec<(f64, usize, f64, f64)> {
        let prior = self.prior;
        let mut found = Vec::new();
        if prior.effects.is_empty() {
            return found;
        }
        let apart = now.differences(self.grams);
        for k in 0..now.model.tau.len() {
            let (tau, own) = (now.model.tau[k], now.model.omega[k]);
            let mut offer = |tau: f64, omega: f64, gain: f64| {
                let reached = score + gain + prior.change(&now.model, k, tau, omega);
                if reached > self.best - self.window {
                    found.push((reached, k, tau, omega));
                }
            };
            let (size, comes) = if tau > 0.0 {
                (tau, 0.0)
            } else {
                now.outside(k).best(&prior.sizes)
            };
            if own > 0.0 {
                // Its neighbours in size, and none; how much that takes is not known. What runs
                // share comes with less that differs.
                let at = prior.effects.iter().position(|&omega| omega == own);
                let next = |step: isize| prior.effects.get(at?.checked_add_signed(step)?).copied();
                let sizes = [Some(0.0), next(-1), next(1)];
                for omega in sizes.into_iter().flatten() {
                    offer(size, omega, comes);
                    offer(0.0, omega, 0.0);
                }
                offer(0.0, own, 0.0);
                continue;
            }
            for &omega in &prior.effects {
                let gain: f64 = apart[k].iter().map(|run| run.gain(omega)).sum();
                offer(size, omega, comes + gain);
                if tau == 0.0 {
                    offer(0.0, omega, gain);
                }
            }
        }
        found
    }

    fn offer(&mut self, model: impl Fn() -> Model, score: f64, best: &mut Option<Found>) {
        if score > self.best - self.window {
            self.meet(&model(), score);
        }
        if best.as_ref().is_none_or(|best| score > best.score) {
            *best = Some(Found {
                model: model(),
                score,
            });
        }
    }

    /// A group in.
    fn enter(&mut self, now: &Solved, j: usize, score: f64, best: &mut Option<Found>) {
        // All sizes are equally probable.
        let coming = self.coming(&now.model, j, self.prior.sizes[0]);
        let least = self.least(best) - score - coming;
        if let Some((tau, gain)) = now.outside(j).best_above(&self.prior.sizes, least) {
            let model = || with(&now.model, &[(j, tau, now.model.omega[j])]);
            self.offer(model, score + gain + coming, best);
        }
    }

    /// Score below which a model is neither the best of these nor within the window.
    fn least(&self, best: &Option<Found>) -> f64 {
        let known = best.as_ref().map_or(f64::NEG_INFINITY, |b| b.score);
        known.min(self.best - self.window)
    }

    /// What the prior gives group `j` of a model that comes in and keeps its effect of runs.
    fn coming(&self, now: &Model, j: usize, tau: f64) -> f64 {
        self.prior.change(now, j, tau, now.omega[j])
    }

    /// Another size of a group.
    fn resize(
        &mut self,
        now: &Solved,
        k: usize,
        score: f64,
        best: &mut Option<Found>,
    ) -> Option<()> {
        let without = now.without(k)?;
        let (tau, gain) = without.own.best(&self.prior.sizes);
        if tau != now.model.tau[k] {
            let model = || with(&now.model, &[(k, tau, now.model.omega[k])]);
            self.offer(model, score + gain - without.loss, best);
        }
        Some(())
    }

    /// A group out, alone or for another one.
    fn leave(
        &mut self,
        now: &Solved,
        k: usize,
        others: &[(usize, Option<Wide>)],
        score: f64,
        best: &mut Option<Found>,
    ) -> Option<()> {
        let without = now.without(k)?;
        let rest = with(&now.model, &[(k, 0.0, 0.0)]);
        let left = score - without.loss - self.coming(&rest, k, now.model.tau[k]);
        self.offer(|| rest.clone(), left, best);
        for (j, wide) in others {
            let j = *j;
            let coming = self.coming(&rest, j, self.prior.sizes[0]);
            let least = self.least(best) - left - coming;
            let most = wide.as_ref().and_then(|wide| without.at_most(j, wide));
            if most.is_some_and(|most| most <= least) {
                continue;
            }
            if let Some((tau, gain)) = without.other(j).best_above(&self.prior.sizes, least) {
                let model = || with(&rest, &[(j, tau, rest.omega[j])]);
                self.offer(model, left + gain + coming, best);
            }
        }
        Some(())
    }

    /// The same for a group with an effect of runs, which leaves with it; the best one that comes for
    /// it is tried with that effect, too.
    fn leave_with_effect(
        &mut self,
        now: &Solved,
        k: usize,
        outside: &[usize],
        best: &mut Option<Found>,
    ) -> Option<()> {
        let model = with(&now.model, &[(k, 0.0, 0.0)]);
        let sums = model.sums(self.grams);
        let without = Solved::of(model, &sums)?;
        let left = self.score(&without);
        self.offer(|| without.model.clone(), left, best);
        let mut other: Option<Found> = None;
        for &j in outside {
            self.enter(&without, j, left, &mut other);
        }
        let Some(found) = other else { return Some(()) };
        self.offer(|| found.model.clone(), found.score, best);
        let mut model = found.model;
        for &j in outside {
            if model.tau[j] > 0.0 {
                model.omega[j] = now.model.omega[k];
            }
        }
        self.factorised(model, best)
    }

    /// A model by its factorisation.
    fn factorised(&mut self, model: Model, best: &mut Option<Found>) -> Option<()> {
        let evidence = model.posterior(self.grams)?.log_evidence;
        let score = evidence + self.prior.log_probability(&model);
        self.offer(|| model.clone(), score, best);
        Some(())
    }
}

/// A model with other variances of some groups.
fn with(model: &Model, changes: &[(usize, f64, f64)]) -> Model {
    let mut changed = model.clone();
    for &(k, tau, omega) in changes {
        (changed.tau[k], changed.omega[k]) = (tau, omega);
    }
    changed
}
