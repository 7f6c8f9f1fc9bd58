//! The last windows' coefficients: where among them an order moved.

use super::chart::Scale;

/// Windows that are kept.
pub const KEPT: usize = 32;

/// Windows before a change at least: what it is a change from.
const BEFORE: f64 = 3.0;

/// Coefficients of the last windows, those of one coefficient side by side.
#[derive(Clone, Debug)]
pub struct Recent {
    values: Vec<f64>,
    next: usize,
    count: usize,
}

impl Recent {
    /// No windows yet, of so many coefficients.
    pub fn new(size: usize) -> Self {
        Self {
            values: vec![0.0; size * KEPT],
            next: 0,
            count: 0,
        }
    }

    /// Bytes of the windows.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// Takes a window in; the oldest goes.
    pub fn add(&mut self, coefficients: &[f64]) {
        for (values, &value) in self.values.chunks_exact_mut(KEPT).zip(coefficients) {
            values[self.next] = value;
        }
        self.next = (self.next + 1) % KEPT;
        self.count = KEPT.min(self.count + 1);
    }

    /// Windows since the step that leaves least of two coefficients, and what these have since:
    /// means, and squares about them. `every` holds all windows of either.
    pub fn change(&self, pair: [usize; 2], every: [&Scale; 2]) -> (f64, [f64; 2], [f64; 2]) {
        let mut best = (1.0, [0.0; 2], [0.0; 2]);
        let mut most = f64::NEG_INFINITY;
        let (mut means, mut squares) = ([0.0; 2], [0.0; 2]);
        for back in 1..=self.count {
            let since = back as f64;
            if back > 1 && every[0].count() - since < BEFORE {
                break;
            }
            let at = (self.next + KEPT - back) % KEPT;
            for k in 0..2 {
                let apart = self.values[pair[k] * KEPT + at] - means[k];
                means[k] += apart / since;
                squares[k] += apart * (self.values[pair[k] * KEPT + at] - means[k]);
            }
            let rest = every[0].count() - since;
            // What a step takes of the squares about one mean.
            let taken: f64 = (0..2)
                .map(|k| (means[k] - every[k].mean()).powi(2))
                .sum::<f64>()
                * since
                * (since + rest)
                / rest.max(1.0);
            if taken > most {
                (most, best) = (taken, (since, means, squares));
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step is found where it is, with what was before and after, beyond one round of the ring.
    #[test]
    fn a_step_is_found_where_it_is() {
        let mut recent = Recent::new(2);
        let mut every = [Scale::default(); 2];
        for i in 0..50 {
            let wave = f64::from(i % 3) - 1.0;
            let pair = [wave, 0.5 * wave + if i >= 43 { 8.0 } else { 0.0 }];
            recent.add(&pair);
            for (scale, value) in every.iter_mut().zip(pair) {
                scale.take(value);
            }
        }
        let (since, means, squares) = recent.change([0, 1], [&every[0], &every[1]]);
        assert_eq!(since, 7.0);
        assert!((means[1] - 8.0).abs() < 0.1, "{means:?}");
        let (before, mean, left) = every[1].without(since, means[1], squares[1]);
        assert_eq!(before, 43.0);
        assert!(mean.abs() < 0.05, "{mean}");
        assert!((left - 0.25 * 28.0).abs() < 0.6, "{left}");
    }
}
