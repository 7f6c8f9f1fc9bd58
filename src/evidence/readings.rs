//! Readings of runs, and the rows of their columns: zero, cosines and sines of orders, error.

use std::sync::Arc;

use super::rows::Rows;
use super::whitening::{Terms, decays};
use crate::check::{finite, same_length};
use crate::error::Error;
use crate::memory::room;
use crate::spectrum::median;
use crate::waves;

/// Readings whose columns are made at once: they stay in the second cache.
pub const CHUNK: usize = 256;

/// Bytes that a reading takes at most: its own numbers, factor, residual and products of terms.
const BYTES: usize = 40 * size_of::<f64>();

/// Readings of one run, in the order in which they were read.
#[derive(Clone, Debug)]
pub struct Run {
    theta: Vec<f64>,
    error: Vec<f64>,
    mean: f64,
    decays: Vec<Terms>,
    /// What each row is multiplied by, so that the noise of all is alike.
    roots: Option<Vec<f64>>,
}

impl Run {
    /// Of angles in radians, errors in any unit, and times that do not decrease; without times,
    /// readings are equally spaced.
    pub fn new(theta: &[f64], error: &[f64], time: Option<&[f64]>) -> Result<Self, Error> {
        if theta.is_empty() {
            return Err(Error::NoReadings);
        }
        same_length("error", error.len(), "theta", theta.len())?;
        room(theta.len() * BYTES)?;
        finite("theta", theta)?;
        finite("error", error)?;
        let decays = match time {
            Some(time) => {
                same_length("time", time.len(), "theta", theta.len())?;
                finite("time", time)?;
                decays(&in_steps(time)?)
            }
            None => decays(&(0..theta.len()).map(|i| i as f64).collect::<Vec<_>>()),
        };
        let mean = error.iter().sum::<f64>() / error.len() as f64;
        Ok(Self {
            theta: theta.to_vec(),
            error: error.iter().map(|e| e - mean).collect(),
            mean,
            decays,
            roots: None,
        })
    }

    /// With weights above 0: the noise of a reading is as of weight 1, over their roots.
    pub fn weighted(mut self, weights: &[f64]) -> Result<Self, Error> {
        same_length("weights", weights.len(), "theta", self.len())?;
        if let Some(index) = weights.iter().position(|w| !(*w > 0.0 && w.is_finite())) {
            return Err(Error::Weight {
                what: "weights",
                index,
                got: weights[index],
            });
        }
        self.roots = Some(weights.iter().map(|w| w.sqrt()).collect());
        Ok(self)
    }

    /// Readings.
    pub fn len(&self) -> usize {
        self.theta.len()
    }

    /// True without a reading.
    pub fn is_empty(&self) -> bool {
        self.theta.is_empty()
    }

    /// Decays of the noise between readings.
    pub fn decays(&self) -> &[Terms] {
        &self.decays
    }

    /// Errors less their mean.
    pub fn error(&self) -> &[f64] {
        &self.error
    }

    /// Mean of the errors.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// First reading and length of each chunk.
    pub fn chunks(&self) -> impl DoubleEndedIterator<Item = (usize, usize)> + ExactSizeIterator {
        let n = self.len();
        (0..n.div_ceil(CHUNK)).map(move |k| (k * CHUNK, CHUNK.min(n - k * CHUNK)))
    }
}

/// Times in units of the median step.
fn in_steps(time: &[f64]) -> Result<Vec<f64>, Error> {
    let mut steps: Vec<f64> = time.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if let Some(at) = steps.iter().position(|step| *step < 0.0) {
        return Err(Error::Time {
            index: at + 1,
            got: time[at + 1],
            previous: time[at],
        });
    }
    if steps.is_empty() {
        return Ok(vec![0.0; time.len()]);
    }
    let mut step = median(&mut steps);
    if step == 0.0 {
        // Most readings share their time with another: the mean step is not zero.
        step = (time[time.len() - 1] - time[0]) / steps.len() as f64;
    }
    if step == 0.0 {
        return Err(Error::Time {
            index: 1,
            got: time[1],
            previous: time[0],
        });
    }
    Ok(time.iter().map(|t| (t - time[0]) / step).collect())
}

/// Runs, and the orders that are tested.
#[derive(Clone, Debug)]
pub struct Readings {
    runs: Arc<Vec<Run>>,
    orders: Vec<f64>,
    /// The orders as whole numbers, where they are.
    whole: Option<Vec<u32>>,
}

impl Readings {
    /// Of positive orders in increasing order.
    pub fn new(runs: Vec<Run>, orders: Vec<f64>) -> Result<Self, Error> {
        let mut previous = 0.0;
        for (index, &got) in orders.iter().enumerate() {
            if !(got > previous && got.is_finite()) {
                return Err(Error::OrderValue {
                    index,
                    previous,
                    got,
                });
            }
            previous = got;
        }
        if runs.is_empty() {
            return Err(Error::NoReadings);
        }
        let places: Vec<usize> = (0..orders.len()).collect();
        let all = Self {
            runs: Arc::new(runs),
            orders,
            whole: None,
        };
        Ok(all.among(&places))
    }

    /// The same readings with some of the orders.
    pub fn among(&self, places: &[usize]) -> Self {
        let orders: Vec<f64> = places.iter().map(|&k| self.orders[k]).collect();
        let is_whole = |k: &f64| k.fract() == 0.0 && *k <= f64::from(u32::MAX);
        let whole = orders.iter().all(is_whole);
        Self {
            runs: Arc::clone(&self.runs),
            whole: whole.then(|| orders.iter().map(|&k| k as u32).collect()),
            orders,
        }
    }

    /// The runs.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The orders.
    pub fn orders(&self) -> &[f64] {
        &self.orders
    }

    /// Readings of all runs.
    pub fn len(&self) -> usize {
        self.runs.iter().map(Run::len).sum()
    }

    /// True without a reading.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Columns of a row: the zero, a cosine and a sine of every order, the error.
    pub fn columns(&self) -> usize {
        2 * self.orders.len() + 2
    }

    /// Rows of a chunk of a run.
    pub(super) fn rows(&self, run: &Run, start: usize, count: usize) -> Rows {
        let columns = self.columns();
        let mut rows = Rows::zeros(count, columns);
        let mut waves = vec![0.0; 2 * self.orders.len() * count];
        let theta = &run.theta[start..start + count];
        if let Some(orders) = &self.whole {
            let answer = waves::Answer::default();
            waves::rows(theta, orders, answer, &mut waves).expect("lengths are right");
        } else {
            for (order, pair) in self.orders.iter().zip(waves.chunks_exact_mut(2 * count)) {
                for (i, x) in theta.iter().enumerate() {
                    (pair[count + i], pair[i]) = (order * x).sin_cos();
                }
            }
        }
        for i in 0..count {
            let row = rows.row_mut(i);
            row[0] = 1.0;
            for c in 0..2 * self.orders.len() {
                row[c + 1] = waves[c * count + i];
            }
            row[columns - 1] = run.error[start + i];
            if let Some(roots) = &run.roots {
                for x in &mut row[..columns] {
                    *x *= roots[start + i];
                }
            }
        }
        rows
    }
}
