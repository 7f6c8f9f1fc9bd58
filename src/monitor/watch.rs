//! Windows one after the other, and a chart for every coefficient.

use super::chart::{Cusum, Scale, Value};
use super::recent::Recent;
use super::window::Window;

/// Windows of the baseline: their mean is compared with the model, later ones with theirs.
pub const FIRST: f64 = 8.0;

/// Turns that the sum of a window's steps may lack of whole turns.
const ROUNDING: f64 = 1e-9;

/// Bins beyond which a double has no place within one.
const MOST: f64 = (1u64 << 50) as f64;

/// What a window said.
#[derive(Clone, Debug)]
pub struct Closed {
    /// The reading of the batch that ended it.
    pub reading: usize,
    /// Windows so far.
    pub window: u64,
    /// Readings in it.
    pub readings: f64,
    /// Zero, cosine and sine of each order, less the model's.
    pub coefficients: Vec<f64>,
    /// The larger sum of every coefficient's chart; of the zero its last step, in deviations.
    pub statistics: Vec<f64>,
    /// Orders a chart of which passed its limit.
    pub moved: Vec<Moved>,
    /// Orders whose mean is not the model's since the start.
    pub unlike: Vec<Moved>,
}

/// By how much an order moved.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    /// Counted from 1; 0 is the zero.
    pub order: usize,
    /// Of cosine and sine together; of the zero with its sign.
    pub size: f64,
    /// Standard error of each coefficient's shift.
    pub std: f64,
    /// Windows since then.
    pub since: f64,
}

/// Limits of the charts.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Half of the shift looked for, in standard deviations.
    pub allowance: f64,
    /// Of the sums.
    pub sum: f64,
    /// Of a step of the zero, in standard deviations.
    pub step: f64,
    /// Of the first windows' mean against the model, in standard deviations.
    pub mean: f64,
}

/// A joint against its model.
#[derive(Clone)]
pub struct Monitor {
    window: Window,
    period: f64,
    every: f64,
    limits: Limits,
    /// Variances of the model's own coefficients.
    known: Vec<f64>,
    charts: Vec<(Scale, Cusum)>,
    recent: Recent,
    steps: Scale,
    zero: Option<f64>,
    last_zero: Option<f64>,
    anchor: Option<f64>,
    travel: f64,
    windows: u64,
}

impl Monitor {
    /// Of a model by its orders of a turn; `known` are variances of cosine and sine of each.
    pub fn new(period: f64, window: Window, known: Vec<f64>, every: f64, limits: Limits) -> Self {
        let size = known.len();
        Self {
            window,
            period,
            every,
            limits,
            known,
            charts: vec![Default::default(); size],
            recent: Recent::new(size),
            steps: Scale::default(),
            zero: None,
            last_zero: None,
            anchor: None,
            travel: 0.0,
            windows: 0,
        }
    }

    /// Windows so far.
    pub fn windows(&self) -> u64 {
        self.windows
    }

    /// Bytes of the state.
    pub fn bytes(&self) -> usize {
        let charts = size_of_val(&self.charts[..]);
        let fixed = size_of::<Self>() + size_of_val(&self.known[..]);
        fixed + self.window.bytes() + self.recent.bytes() + charts
    }

    /// Mean and standard deviation of each coefficient's windows, and its sums.
    pub fn state(&self) -> Vec<[f64; 4]> {
        let charts = self.charts.iter();
        charts
            .map(|(scale, chart)| [scale.mean(), scale.std(), chart.sums[0], chart.sums[1]])
            .collect()
    }

    /// Takes readings in; the windows that they ended, or only those that alarm.
    pub fn update(&mut self, angle: &[f64], error: &[f64], alarms: bool) -> Vec<Closed> {
        let mut closed = Vec::new();
        let per_turn = 1.0 / self.period;
        let (count, half) = (self.window.count(), 0.5 * self.period);
        let mut held = self.window.held();
        let mut zero = self.zero;
        for (reading, (&x, &e)) in angle.iter().zip(error).enumerate() {
            if !(x.is_finite() && e.is_finite()) {
                continue;
            }
            let about = *zero.get_or_insert(e);
            // Rounding is a call of a function on the oldest processors: only where it is needed.
            let mut apart = e - about;
            if apart.abs() > half {
                apart -= self.period * (apart * per_turn).round();
            }
            let mut place = x * per_turn * count;
            if place.abs() > MOST {
                place = place.rem_euclid(count);
            }
            if !self.window.add(&mut held, place, apart) {
                continue;
            }
            // Trembling about a place is no travel: only steps of a bin count.
            let mut moved = (place - *self.anchor.get_or_insert(place)).abs();
            if moved > 0.5 * count {
                moved = (moved - count * (moved / count).round()).abs();
            }
            if moved >= 1.0 {
                self.anchor = Some(place);
                self.travel += moved / count;
                if self.travel + ROUNDING >= self.every {
                    self.window.put(std::mem::take(&mut held));
                    if let Some(found) = self.close(reading)
                        && !(alarms && found.moved.is_empty() && found.unlike.is_empty())
                    {
                        closed.push(found);
                    }
                }
            }
        }
        self.window.hold(held);
        self.zero = zero;
        closed
    }

    /// Ends a window, unless its places do not tell the orders apart: then it goes on.
    fn close(&mut self, reading: usize) -> Option<Closed> {
        let Some(solved) = self.window.solve() else {
            // Looked at again after another part of the travel.
            self.travel -= 0.25 * self.every;
            return None;
        };
        self.window.clear();
        self.travel = 0.0;
        self.windows += 1;
        let limits = self.limits;
        let size = self.known.len();
        let (mut moved, mut unlike) = (Vec::new(), Vec::new());
        let mut statistics = vec![0.0; size + 1];
        let values = solved.coefficients.iter().zip(&solved.variances);
        let values = values.map(|(&value, &variance)| Value { value, variance });
        self.recent.add(values.clone().skip(1));
        let rows = self.charts.iter_mut().zip(&mut statistics[1..]);
        for (value, ((scale, chart), statistic)) in values.skip(1).zip(rows) {
            *statistic = chart.add(scale.add(value), limits.allowance);
        }
        for order in 0..size / 2 {
            let pair = 2 * order..2 * order + 2;
            if pair.clone().any(|i| statistics[i + 1] > limits.sum) {
                moved.push(self.moved(order));
            } else if self.windows as f64 == FIRST && pair.clone().any(|i| self.is_unlike(i)) {
                unlike.push(self.unlike(order));
            }
        }
        let zero = solved.coefficients[0];
        if let Some(before) = self.last_zero {
            let (held, std) = (self.steps.held(), self.steps.std());
            let value = zero - before;
            statistics[0] = self
                .steps
                .add(Value {
                    value,
                    variance: 1.0,
                })
                .abs();
            if held > FIRST && statistics[0] > limits.step {
                moved.push(Moved {
                    order: 0,
                    size: value,
                    std,
                    since: 1.0,
                });
            }
        }
        self.last_zero = Some(zero);
        Some(Closed {
            reading,
            window: self.windows,
            readings: solved.readings,
            coefficients: solved.coefficients,
            statistics,
            moved,
            unlike,
        })
    }

    /// By how much an order moved in one of the last windows, from its level before; its charts go
    /// on from the new level, so that a step is one alarm.
    fn moved(&mut self, order: usize) -> Moved {
        let pair = [2 * order, 2 * order + 1];
        let since = self.recent.change(pair, pair.map(|i| &self.charts[i].0));
        let (mut size, mut variance) = (0.0f64, 0.0);
        for i in pair {
            let (before, after) = self.recent.split(i, since, &self.charts[i].0);
            size = size.hypot(after.mean() - before.mean());
            // Scatter of the windows before: those after are few, and may go on moving.
            let own =
                before.factor() * (1.0 / (since as f64 * after.weight()) + 1.0 / before.weight());
            variance += 0.5 * own * before.inflation();
            self.charts[i] = (after, Cusum::default());
        }
        Moved {
            order: order + 1,
            size,
            std: variance.sqrt(),
            since: since as f64,
        }
    }

    /// Variance of the first windows' mean less the model's coefficient.
    fn spread(&self, i: usize) -> f64 {
        self.known[i] + self.charts[i].0.spread()
    }

    /// Whether the first windows' mean is not the model's.
    fn is_unlike(&self, i: usize) -> bool {
        let scale = &self.charts[i].0;
        let t = scale.mean() / self.spread(i).sqrt();
        super::chart::normal_of_student(t, scale.freedom()).abs() > self.limits.mean
    }

    /// How far the first windows' mean is from the model.
    fn unlike(&self, order: usize) -> Moved {
        let (a, b) = (2 * order, 2 * order + 1);
        Moved {
            order: order + 1,
            size: self.charts[a].0.mean().hypot(self.charts[b].0.mean()),
            std: (0.5 * (self.spread(a) + self.spread(b))).sqrt(),
            since: FIRST,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn monitor() -> Monitor {
        let limits = Limits {
            allowance: 0.5,
            sum: 6.0,
            step: 6.0,
            mean: 6.0,
        };
        let window = Window::new(&[1], &[0.0], &[0.0]);
        Monitor::new(360.0, window, vec![0.0; 2], 1.0, limits)
    }

    /// A window ends after a turn of travel, in either direction and with angles within a turn.
    #[test]
    fn windows_are_turns_of_travel() {
        for step in [1.0, -1.0] {
            let mut watched = monitor();
            let angle: Vec<f64> = (0..3601)
                .map(|i| (step * f64::from(i)).rem_euclid(360.0))
                .collect();
            let closed = watched.update(&angle, &vec![0.0; angle.len()], false);
            assert_eq!(closed.len(), 10 - usize::from(closed[0].reading > 360));
            assert_eq!(watched.windows(), closed.len() as u64);
        }
    }

    /// Angles within a turn, and errors a turn off, say the same as those that go on.
    #[test]
    fn turns_do_not_matter() {
        let angle: Vec<f64> = (0..40 * 120).map(|i| 3.0 * f64::from(i)).collect();
        let error: Vec<f64> = angle.iter().map(|x| (0.31 * x).sin()).collect();
        let within: Vec<f64> = angle.iter().map(|x| x % 360.0).collect();
        let off: Vec<f64> = error.iter().map(|e| e + 360.0).collect();
        let whole = monitor().update(&angle, &error, false);
        let other = monitor().update(&within, &off, false);
        assert_eq!(whole.len(), other.len());
        for (a, b) in whole.iter().zip(&other) {
            assert_eq!((a.reading, a.readings), (b.reading, b.readings));
            for (p, q) in a.coefficients.iter().zip(&b.coefficients) {
                assert!((p - q).abs() < 1e-6, "{p} {q}");
            }
        }
    }

    /// Batches of any size say the same.
    #[test]
    fn batches_say_the_same() {
        let angle: Vec<f64> = (0..5000).map(|i| 1.7 * f64::from(i)).collect();
        let error: Vec<f64> = angle.iter().map(|x| (0.3 * x).sin() + 359.0).collect();
        let (mut one, mut other) = (monitor(), monitor());
        let whole = one.update(&angle, &error, false);
        let parts = angle.chunks(7).zip(error.chunks(7));
        let parts: Vec<Closed> = parts.flat_map(|(x, e)| other.update(x, e, false)).collect();
        assert_eq!(whole.len(), parts.len());
        for (a, b) in whole.iter().zip(&parts) {
            assert_eq!(a.coefficients, b.coefficients);
        }
    }

    /// A joint that trembles, or swings over a part of a turn, ends no window.
    #[test]
    fn trembling_ends_no_window() {
        let mut watched = monitor();
        let angle: Vec<f64> = (0..9000).map(|i| f64::from(i % 2)).collect();
        assert!(
            watched
                .update(&angle, &vec![0.0; angle.len()], false)
                .is_empty()
        );
        let angle: Vec<f64> = (0..9000)
            .map(|i| 10.0 * (0.1 * f64::from(i)).sin())
            .collect();
        assert!(
            watched
                .update(&angle, &vec![0.0; angle.len()], false)
                .is_empty()
        );
    }
}
