//! The last windows' coefficients: where among them an order moved.

use super::chart::{Scale, Value};

/// Windows that are kept.
pub const KEPT: usize = 32;

/// Windows before a change at least: what it is a change from.
const BEFORE: f64 = 3.0;

/// Coefficients of the last windows with their variances, those of one coefficient side by side.
///
/// In single precision: they place a step, and what a step is off by is noise of windows.
#[derive(Clone, Debug)]
pub struct Recent {
    values: Vec<[f32; 2]>,
    next: usize,
    count: usize,
}

impl Recent {
    /// No windows yet, of so many coefficients.
    pub fn new(size: usize) -> Self {
        Self {
            values: vec![[0.0; 2]; size * KEPT],
            next: 0,
            count: 0,
        }
    }

    /// Bytes of the windows.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// Takes a window in; the oldest goes.
    pub fn add(&mut self, window: impl Iterator<Item = Value>) {
        for (values, found) in self.values.chunks_exact_mut(KEPT).zip(window) {
            values[self.next] = [found.value as f32, found.variance as f32];
        }
        self.next = (self.next + 1) % KEPT;
        self.count = KEPT.min(self.count + 1);
    }

    /// The value of a coefficient so many windows ago, counted from 1.
    fn back(&self, coefficient: usize, back: usize) -> Value {
        let [value, variance] =
            self.values[coefficient * KEPT + (self.next + KEPT - back) % KEPT].map(f64::from);
        Value { value, variance }
    }

    /// A coefficient before and after a step so many windows ago.
    pub fn split(&self, coefficient: usize, since: usize, scale: &Scale) -> (Scale, Scale) {
        let values: Vec<Value> = (1..=since + 1).map(|k| self.back(coefficient, k)).collect();
        scale.split(&values)
    }

    /// Windows since the step that leaves least of two coefficients, within the present level of
    /// `every`.
    pub fn change(&self, pair: [usize; 2], every: [&Scale; 2]) -> usize {
        let (mut best, mut most) = (1, f64::NEG_INFINITY);
        let mut parts = [Scale::default(); 2];
        for back in 1..self.count {
            if back > 1 && every[0].held() - (back as f64) < BEFORE {
                break;
            }
            let mut taken = 0.0;
            for k in 0..2 {
                let (whole, part) = (every[k], &mut parts[k]);
                part.take(self.back(pair[k], back));
                let rest = whole.weight() - part.weight();
                // What a step takes of the squares about one mean.
                taken +=
                    (part.mean() - whole.mean()).powi(2) * part.weight() * whole.weight() / rest;
            }
            if taken > most {
                (most, best) = (taken, back);
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step is found where it is, with what was before and after, beyond one round of the ring;
    /// of uneven windows too.
    #[test]
    fn a_step_is_found_where_it_is() {
        for uneven in [1.0, 3.0] {
            let mut recent = Recent::new(2);
            let mut every = [Scale::default(); 2];
            let mut then = every;
            for i in 0..50 {
                let wave = f64::from(i % 3) - 1.0;
                let variance = if i % 2 == 0 { 1.0 } else { uneven };
                let pair = [wave, 0.5 * wave + if i >= 43 { 8.0 } else { 0.0 }];
                let pair = pair.map(|value| Value { value, variance });
                recent.add(pair.into_iter());
                for (scale, value) in every.iter_mut().zip(pair) {
                    scale.take(value);
                }
                if i == 42 {
                    then = every;
                }
            }
            let since = recent.change([0, 1], [&every[0], &every[1]]);
            assert_eq!(since, 7);
            let (before, after) = recent.split(1, since, &every[1]);
            for (found, wanted) in [
                (before.held(), then[1].held()),
                (before.mean(), then[1].mean()),
                (before.factor(), then[1].factor()),
                (before.inflation(), then[1].inflation()),
                (after.held(), 1.0),
                (after.freedom(), then[1].freedom() + 6.0),
            ] {
                assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
            }
            assert!((after.mean() - 8.0).abs() < 0.1, "{}", after.mean());
        }
    }
}
