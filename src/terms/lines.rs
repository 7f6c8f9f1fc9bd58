//! Harmonics that a term multiplies: their sum and its slope over a block.

use std::f64::consts::TAU;
use std::sync::Arc;

use super::form::Line;
use crate::error::Error;
use crate::kernel::{Evaluator, Pass, Quantity};
use crate::readings::Argument;
use crate::series::{HarmonicSeries, Shaft};

/// Greatest error of a slope, of its greatest value: it only leads to the angle sought.
const SLOPE_TOLERANCE: f64 = 1e-9;

/// A sum of harmonics without a constant, by a table where they repeat after a turn.
#[derive(Debug)]
pub(super) struct Lines {
    value: Pass,
    /// The slope over `steepest`, which is large where the period is small.
    slope: Pass,
    steepest: f64,
    /// Bound of the second derivative.
    pub bend: f64,
    /// Bound of the slope.
    pub steepness: f64,
}

impl Lines {
    /// Makes the tables.
    pub fn new(period: f64, shafts: Vec<Shaft>) -> Result<Self, Error> {
        let series = HarmonicSeries::new(period, 0.0, shafts)?;
        let rate = TAU / period;
        let highest = series.lines().map(|line| line.order).fold(1.0, f64::max);
        let turned = |shaft: &Shaft| {
            let share = |i: usize| f64::from(shaft.orders[i]) * shaft.cycles / highest;
            let all = 0..shaft.orders.len();
            Shaft {
                cycles: shaft.cycles,
                orders: shaft.orders.clone(),
                cosine: all.clone().map(|i| share(i) * shaft.sine[i]).collect(),
                sine: all.map(|i| -share(i) * shaft.cosine[i]).collect(),
            }
        };
        let shafts = series.shafts().iter().map(turned).collect();
        let slope = HarmonicSeries::new(period, 0.0, shafts)?;
        let slope = Evaluator::new(slope, Argument::Reference);
        let pass = |evaluator: Evaluator| {
            evaluator.room()?;
            Ok::<_, Error>(Pass::new(&Arc::new(evaluator), Quantity::Error))
        };
        Ok(Self {
            bend: series.bend_bound(),
            steepness: series.slope_bound(),
            steepest: rate * highest,
            value: pass(Evaluator::new(series, Argument::Reference))?,
            slope: pass(slope.with_tolerance(SLOPE_TOLERANCE)?)?,
        })
    }

    /// Of lines of any order, each on a shaft of its own; `None` where there are none.
    pub fn of(lines: &[Line], period: f64) -> Result<Option<Self>, Error> {
        if lines.is_empty() {
            return Ok(None);
        }
        Self::new(period, shafts(lines)).map(Some)
    }

    /// The sum at each of some angles.
    pub fn values(&self, x: &[f64], out: &mut [f64]) {
        self.value.run(x, out);
    }

    /// Its slope there.
    pub fn slopes(&self, x: &[f64], out: &mut [f64]) {
        self.slope.run(x, out);
        for slope in out {
            *slope *= self.steepest;
        }
    }
}

/// Every line on a shaft of its own.
pub(super) fn shafts(lines: &[Line]) -> Vec<Shaft> {
    let shaft = |line: &Line| Shaft {
        cycles: line.order,
        orders: vec![1],
        cosine: vec![line.cosine],
        sine: vec![line.sine],
    };
    lines.iter().map(shaft).collect()
}
