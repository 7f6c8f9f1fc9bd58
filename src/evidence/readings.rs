//! Readings of runs, and the rows of their columns: zero, groups of columns, error.
//!
//! The columns of a group are the cosine and the sine of an order, or any that are given.

use std::sync::Arc;

use super::rows::Rows;
use super::whitening::{Noise, Terms, decays};
use crate::check::{finite, same_length};
use crate::error::Error;
use crate::memory::room;
use crate::simd::MOST_LANES;
use crate::spectrum::median;
use crate::waves;

/// Readings whose columns are made at once: they stay in the second cache.
pub const CHUNK: usize = 256;

/// Numbers of rows that are held at most, rather than made anew for every noise: 32 MB.
const HELD: usize = 1 << 22;

/// Bytes that a reading takes at most: its own numbers, factor, residual and products of terms.
const BYTES: usize = 40 * size_of::<f64>();

/// What the columns of a run are made of.
#[derive(Clone, Debug)]
enum Source {
    /// Angles in radians.
    Angles(Vec<f64>),
    /// The columns themselves, a row of this width for each reading.
    Columns { values: Vec<f64>, width: usize },
}

/// Readings of one run, in the order in which they were read.
#[derive(Clone, Debug)]
pub struct Run {
    source: Source,
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
        Self::of(Source::Angles(theta.to_vec()), error, time)
    }

    /// Of columns, a row of `width` for each error, and times as in [`Run::new`].
    pub fn of_columns(
        columns: &[f64],
        width: usize,
        error: &[f64],
        time: Option<&[f64]>,
    ) -> Result<Self, Error> {
        if error.is_empty() {
            return Err(Error::NoReadings);
        }
        same_length(
            "columns",
            columns.len(),
            "width * error",
            width * error.len(),
        )?;
        room(error.len() * BYTES + size_of_val(columns))?;
        finite("columns", columns)?;
        let values = columns.to_vec();
        Self::of(Source::Columns { values, width }, error, time)
    }

    fn of(source: Source, error: &[f64], time: Option<&[f64]>) -> Result<Self, Error> {
        finite("error", error)?;
        let decays = match time {
            Some(time) => {
                same_length("time", time.len(), "error", error.len())?;
                finite("time", time)?;
                decays(&in_steps(time)?)
            }
            None => decays(&(0..error.len()).map(|i| i as f64).collect::<Vec<_>>()),
        };
        let mean = error.iter().sum::<f64>() / error.len() as f64;
        Ok(Self {
            source,
            error: error.iter().map(|e| e - mean).collect(),
            mean,
            decays,
            roots: None,
        })
    }

    /// With weights above 0: the noise of a reading is as of weight 1, over their roots.
    pub fn weighted(mut self, weights: &[f64]) -> Result<Self, Error> {
        same_length("weights", weights.len(), "error", self.len())?;
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
        self.error.len()
    }

    /// True without a reading.
    pub fn is_empty(&self) -> bool {
        self.error.is_empty()
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

    /// Variance of the zero, of which the readings have this information under a noise.
    ///
    /// No two readings have a smaller covariance than the first and the last. So much is common to
    /// all, and is a zero: what is left of an exponential is convex, and a covariance, too (Polya).
    pub(super) fn zero_variance(&self, noise: Noise, information: f64) -> f64 {
        let count = self.len() as f64;
        let squares = |roots: &Vec<f64>| roots.iter().map(|r| r * r).sum();
        let weights: f64 = self.roots.as_ref().map_or(count, squares);
        let common = noise.total() - self.within(noise).total();
        (1.0 / information - common * count / weights).max(noise.white / weights)
    }

    /// What is left of a noise without the part that all readings have in common.
    pub(super) fn within(&self, noise: Noise) -> Noise {
        let mut terms = noise.terms;
        for decay in self.decays.iter().skip(1) {
            terms.iter_mut().zip(decay).for_each(|(own, d)| *own *= d);
        }
        terms
            .iter_mut()
            .zip(noise.terms)
            .for_each(|(own, whole)| *own = whole - *own);
        Noise { terms, ..noise }
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

/// Groups of columns.
#[derive(Clone, Debug)]
enum Groups {
    /// Orders; as whole numbers, too, where they are.
    Orders {
        orders: Vec<f64>,
        whole: Option<Vec<u32>>,
    },
    /// Widths of the groups, and the columns given that they have in turn.
    Columns {
        widths: Vec<usize>,
        columns: Vec<usize>,
    },
}

/// Runs, and the groups of columns that are tested.
#[derive(Clone, Debug)]
pub struct Readings {
    runs: Arc<Vec<Run>>,
    groups: Groups,
    /// Rows of every chunk of each run, where they are few enough to be held.
    held: Option<Arc<Vec<Vec<Rows>>>>,
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
        Ok(Self {
            runs: Arc::new(runs),
            groups: Groups::of_orders(orders),
            held: None,
        })
    }

    /// Of runs with columns ([`Run::of_columns`]), which are groups of these widths in turn.
    pub fn of_groups(runs: Vec<Run>, widths: Vec<usize>) -> Result<Self, Error> {
        if runs.is_empty() {
            return Err(Error::NoReadings);
        }
        let total = widths.iter().sum();
        for (run, own) in runs.iter().enumerate() {
            let Source::Columns { width, .. } = own.source else {
                unreachable!("runs have columns");
            };
            same_length("columns", width, "widths", total).map_err(|cause| Error::InRun {
                run,
                cause: Box::new(cause),
            })?;
        }
        let columns = (0..total).collect();
        Ok(Self {
            runs: Arc::new(runs),
            groups: Groups::Columns { widths, columns },
            held: None,
        })
    }

    /// The same readings with some of the groups.
    pub fn among(&self, places: &[usize]) -> Self {
        Self {
            runs: Arc::clone(&self.runs),
            groups: self.groups.among(places),
            held: None,
        }
    }

    /// The same readings with their rows made once, if they are few enough.
    pub(super) fn holding(&self) -> Self {
        let few = self.len() * Rows::width(self.columns()) <= HELD;
        let rows = |run: &Run| {
            let each = run.chunks();
            each.map(|(start, count)| self.rows(run, start, count))
                .collect()
        };
        let made = || Arc::new(self.runs.iter().map(rows).collect());
        Self {
            held: few.then(made),
            ..self.clone()
        }
    }

    /// The rows of each chunk of a run, where they are held.
    pub(super) fn held(&self, run: usize) -> Option<&[Rows]> {
        self.held.as_ref().map(|held| held[run].as_slice())
    }

    /// The runs.
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// The orders; none where columns were given.
    pub fn orders(&self) -> &[f64] {
        match &self.groups {
            Groups::Orders { orders, .. } => orders,
            Groups::Columns { .. } => &[],
        }
    }

    /// Columns of each group.
    pub fn widths(&self) -> Vec<usize> {
        match &self.groups {
            Groups::Orders { orders, .. } => vec![2; orders.len()],
            Groups::Columns { widths, .. } => widths.clone(),
        }
    }

    /// Readings of all runs.
    pub fn len(&self) -> usize {
        self.runs.iter().map(Run::len).sum()
    }

    /// True without a reading.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Columns of a row: the zero, those of every group, the error.
    pub fn columns(&self) -> usize {
        let own = match &self.groups {
            Groups::Orders { orders, .. } => 2 * orders.len(),
            Groups::Columns { columns, .. } => columns.len(),
        };
        own + 2
    }

    /// Rows of a chunk of a run.
    pub(super) fn rows(&self, run: &Run, start: usize, count: usize) -> Rows {
        let columns = self.columns();
        let mut rows = Rows::zeros(count, columns);
        match (&self.groups, &run.source) {
            (Groups::Orders { orders, whole }, Source::Angles(theta)) => {
                let theta = &theta[start..start + count];
                let waves = waves_of(theta, orders, whole.as_deref());
                // A few columns at a time: all that is read and written stays in the first cache.
                for first in (0..2 * orders.len()).step_by(MOST_LANES) {
                    let some = MOST_LANES.min(2 * orders.len() - first);
                    let columns = &waves[first * count..(first + some) * count];
                    for i in 0..count {
                        let row = &mut rows.row_mut(i)[first + 1..][..MOST_LANES];
                        for k in 0..some {
                            row[k] = columns[k * count + i];
                        }
                    }
                }
            }
            (Groups::Columns { columns, .. }, Source::Columns { values, width }) => {
                for i in 0..count {
                    let own = &values[(start + i) * width..][..*width];
                    for (out, &c) in rows.row_mut(i)[1..].iter_mut().zip(columns) {
                        *out = own[c];
                    }
                }
            }
            _ => unreachable!("runs are made of what their groups are"),
        }
        for i in 0..count {
            let row = rows.row_mut(i);
            row[0] = 1.0;
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

impl Groups {
    fn of_orders(orders: Vec<f64>) -> Self {
        let is_whole = |k: &f64| k.fract() == 0.0 && *k <= f64::from(u32::MAX);
        let whole = orders.iter().all(is_whole);
        Self::Orders {
            whole: whole.then(|| orders.iter().map(|&k| k as u32).collect()),
            orders,
        }
    }

    fn among(&self, places: &[usize]) -> Self {
        match self {
            Self::Orders { orders, .. } => {
                Self::of_orders(places.iter().map(|&k| orders[k]).collect())
            }
            Self::Columns { widths, columns } => {
                let first = |k: usize| widths[..k].iter().sum::<usize>();
                let own = |&k: &usize| columns[first(k)..][..widths[k]].to_vec();
                Self::Columns {
                    widths: places.iter().map(|&k| widths[k]).collect(),
                    columns: places.iter().flat_map(own).collect(),
                }
            }
        }
    }
}

/// Cosine and sine of every order in turn, one after the other.
fn waves_of(theta: &[f64], orders: &[f64], whole: Option<&[u32]>) -> Vec<f64> {
    let count = theta.len();
    let mut waves = vec![0.0; 2 * orders.len() * count];
    if let Some(whole) = whole {
        waves::rows(theta, whole, waves::Answer::default(), &mut waves).expect("lengths are right");
        return waves;
    }
    for (order, pair) in orders.iter().zip(waves.chunks_exact_mut(2 * count)) {
        for (i, x) in theta.iter().enumerate() {
            (pair[count + i], pair[i]) = (order * x).sin_cos();
        }
    }
    waves
}
