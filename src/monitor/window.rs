//! Readings of a window, summed by their place in the turn, and the harmonics that they leave.
//!
//! A bin holds how many readings it has, the first two powers of where they stand in it, and the
//! sum of their errors: eight additions a reading, whatever the number of orders. Within a bin of a
//! sixteenth of the highest order's cycle sines and the model are told to second order.

use std::f64::consts::PI;

use super::folded::{Folded, Rows, dot};

/// Bins to a cycle of the highest order.
const PER_CYCLE: u32 = 16;

/// Bins at least.
const FEWEST: usize = 128;

/// Least pivot of the normal matrix, its columns scaled, with which orders are told apart.
const TOLD: f64 = 1e-3;

/// Count, sum of places, of their squares, and of errors.
type Bin = [f64; 4];

/// Added to a double, it leaves a whole number in the last places.
const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;

/// The sums of one bin, held beside the window while readings fall in it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Held {
    bin: usize,
    sums: Bin,
}

/// Coefficients of the errors less the model's: the zero, then cosine and sine of each order.
#[derive(Clone, Debug)]
pub struct Solved {
    /// The coefficients.
    pub coefficients: Vec<f64>,
    /// Variances of the coefficients for readings of unit variance.
    pub variances: Vec<f64>,
}

/// Sums of the readings of one window.
#[derive(Clone, Debug)]
pub struct Window {
    orders: Vec<u32>,
    bins: Vec<Bin>,
    held: Held,
    /// Cosines at multiples of half a bin.
    cosines: Vec<f64>,
    /// Value, slope and curvature of the model at the middle of each bin, per radian.
    model: Vec<[f64; 3]>,
}

impl Window {
    /// No readings yet, of a model with these coefficients of its orders.
    pub fn new(orders: &[u32], cosine: &[f64], sine: &[f64]) -> Self {
        let highest = orders.iter().copied().max().unwrap_or(1);
        let count = ((highest * PER_CYCLE) as usize)
            .max(FEWEST)
            .next_power_of_two();
        let angle = |i: usize| PI * i as f64 / count as f64;
        let cosines = (0..2 * count).map(|i| angle(i).cos()).collect();
        let model = (0..count).map(|bin| {
            let x = angle(2 * bin + 1);
            let mut found = [0.0; 3];
            for ((&k, a), b) in orders.iter().zip(cosine).zip(sine) {
                let k = f64::from(k);
                let (s, c) = (k * x).sin_cos();
                found[0] += a * c + b * s;
                found[1] += k * (b * c - a * s);
                found[2] -= k * k * (a * c + b * s);
            }
            found
        });
        Self {
            orders: orders.to_vec(),
            bins: vec![[0.0; 4]; count],
            held: Held::default(),
            cosines,
            model: model.collect(),
        }
    }

    /// Parts of a turn that a bin takes.
    pub fn width(&self) -> f64 {
        1.0 / self.bins.len() as f64
    }

    /// Bytes that a window keeps.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.bins[..]) + size_of_val(&self.cosines[..]) + size_of_val(&self.model[..])
    }

    /// Readings so far.
    pub fn readings(&self) -> f64 {
        self.bins.iter().map(|sums| sums[0]).sum()
    }

    /// Bins of a turn.
    pub fn count(&self) -> f64 {
        self.bins.len() as f64
    }

    /// The sums of the bin that readings fall in now, to be held beside the window.
    pub fn held(&self) -> Held {
        self.held
    }

    /// What was held goes on with the next readings.
    pub fn hold(&mut self, held: Held) {
        self.held = held;
    }

    /// Adds a reading at a place in bins, any number of turns on; whether it is in another bin
    /// than the reading before.
    #[inline(always)]
    pub fn add(&mut self, held: &mut Held, place: f64, error: f64) -> bool {
        // Rounded to a whole number in the last places of the double, whose bits are then the bin.
        let shifted = (place - 0.5) + WHOLE;
        let within = (place - 0.5) - (shifted - WHOLE);
        let bin = shifted.to_bits() as usize & (self.bins.len() - 1);
        let other = bin != held.bin;
        if other {
            self.put(*held);
            *held = Held {
                bin,
                sums: [0.0; 4],
            };
        }
        let reading = [1.0, within, within * within, error];
        for (sum, value) in held.sums.iter_mut().zip(reading) {
            *sum += value;
        }
        other
    }

    /// Adds what was held to its bin.
    pub fn put(&mut self, held: Held) {
        for (sum, value) in self.bins[held.bin].iter_mut().zip(held.sums) {
            *sum += value;
        }
    }

    /// Forgets all readings.
    pub fn clear(&mut self) {
        self.bins.fill([0.0; 4]);
    }

    /// Least squares of the errors less the model's; `None` where the places do not tell the
    /// orders apart.
    pub fn solve(&self) -> Option<Solved> {
        let size = 1 + 2 * self.orders.len();
        let readings = self.readings();
        if readings < size as f64 + 1.0 {
            return None;
        }
        let (mut gram, mut right) = self.normal(readings);
        let scales: Vec<f64> = (0..size).map(|i| 1.0 / gram[i * size + i].sqrt()).collect();
        for (i, scale) in scales.iter().enumerate() {
            right[i] *= scale;
            let row = &mut gram[i * size..i * size + i + 1];
            for (value, other) in row.iter_mut().zip(&scales) {
                *value *= scale * other;
            }
        }
        if !factored(&mut gram, size) {
            return None;
        }
        let inverse = inverted(&gram, size);
        // Rows of the inverse triangle: forward, back and the diagonal are products with it.
        let mut coefficients = vec![0.0; size];
        let mut variances = vec![0.0; size];
        for i in 0..size {
            let row = &inverse[i * size..i * size + i + 1];
            let forward = dot(row, &right[..=i]);
            for (j, &x) in row.iter().enumerate() {
                coefficients[j] += x * forward;
                variances[j] += x * x;
            }
        }
        for (i, scale) in scales.iter().enumerate() {
            coefficients[i] *= scale;
            variances[i] *= scale * scale;
        }
        Some(Solved {
            coefficients,
            variances,
        })
    }

    /// The normal matrix of zero, cosine and sine of each order in turn, its lower triangle, and
    /// the sums of the errors less the model's times these.
    fn normal(&self, readings: f64) -> (Vec<f64>, Vec<f64>) {
        let size = 1 + 2 * self.orders.len();
        let (places, errors) = (self.places(), self.errors());
        let mut right = vec![0.0; size];
        right[0] = errors.total();
        let highest = 2 * self.orders.iter().copied().max().unwrap_or(0) as usize;
        let mut known = vec![None; highest + 1];
        let mut rows = Rows::new(self.bins.len() / 4);
        for (i, &k) in self.orders.iter().enumerate() {
            rows.fill(&self.cosines, k);
            (right[1 + 2 * i], right[2 + 2 * i]) = errors.sums(&rows, k);
            known[k as usize] = Some(places.sums(&rows, k));
        }
        let mut of = |order: u32| -> (f64, f64) {
            *known[order as usize].get_or_insert_with(|| {
                rows.fill(&self.cosines, order);
                places.sums(&rows, order)
            })
        };
        let mut gram = vec![0.0; size * size];
        gram[0] = readings;
        for (i, &k) in self.orders.iter().enumerate() {
            let (a, b) = (1 + 2 * i, 2 + 2 * i);
            let (cosine, sine) = of(k);
            gram[a * size] = cosine;
            gram[b * size] = sine;
            for (j, &l) in self.orders[..=i].iter().enumerate() {
                let (c, d) = (1 + 2 * j, 2 + 2 * j);
                let (more, less) = (of(k + l), of(k.abs_diff(l)));
                // sin (k - l) x changes its sign with the order of the two.
                let turned = if k < l { -less.1 } else { less.1 };
                gram[a * size + c] = 0.5 * (less.0 + more.0);
                gram[b * size + d] = 0.5 * (less.0 - more.0);
                gram[a * size + d] = 0.5 * (more.1 - turned);
                gram[b * size + c] = 0.5 * (more.1 + turned);
            }
        }
        (gram, right)
    }

    /// The readings of the bins: how many, and the first two powers of their places.
    fn places(&self) -> Folded {
        Folded::new(self.bins.len(), |bin| {
            let sums = &self.bins[bin];
            [sums[0], sums[1], sums[2]]
        })
    }

    /// The errors of the bins less the model's, times the mean powers of their places.
    fn errors(&self) -> Folded {
        let width = 2.0 * PI / self.bins.len() as f64;
        Folded::new(self.bins.len(), |bin| {
            let (sums, model) = (&self.bins[bin], &self.model[bin]);
            if sums[0] == 0.0 {
                return [0.0; 3];
            }
            let (first, second) = (width * sums[1], width * width * sums[2]);
            let left = sums[3] - model[0] * sums[0] - model[1] * first - 0.5 * model[2] * second;
            let each = left / sums[0];
            [left, each * sums[1], each * sums[2]]
        })
    }
}

/// The lower triangle of Cholesky, in place, the diagonal inverted; false where a pivot is too
/// small.
fn factored(matrix: &mut [f64], size: usize) -> bool {
    for i in 0..size {
        let (above, row) = matrix.split_at_mut(i * size);
        for j in 0..i {
            let other = &above[j * size..j * size + j + 1];
            row[j] = (row[j] - dot(&row[..j], &other[..j])) * other[j];
        }
        let pivot = row[i] - dot(&row[..i], &row[..i]);
        if pivot.is_nan() || pivot < TOLD {
            return false;
        }
        row[i] = 1.0 / pivot.sqrt();
    }
    true
}

/// The inverse of a lower triangle whose diagonal is inverted.
fn inverted(lower: &[f64], size: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; size * size];
    for i in 0..size {
        let (above, row) = inverse.split_at_mut(i * size);
        let scale = lower[i * size + i];
        for k in 0..i {
            let factor = -scale * lower[i * size + k];
            let other = &above[k * size..k * size + k + 1];
            for (sum, value) in row.iter_mut().zip(other) {
                *sum += factor * value;
            }
        }
        row[i] = scale;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(x: f64, coefficients: &[f64]) -> f64 {
        let pairs = coefficients[1..].chunks(2).zip(1u32..);
        let terms = pairs.map(|(pair, k)| {
            let (s, c) = (2.0 * PI * f64::from(k) * x).sin_cos();
            pair[0] * c + pair[1] * s
        });
        coefficients[0] + terms.sum::<f64>()
    }

    fn add(window: &mut Window, turn: f64, error: f64) {
        let mut held = Held::default();
        window.add(&mut held, turn * window.count(), error);
        window.put(held);
    }

    /// A place is in its bin on both sides of zero and turns away, its part of the bin with it.
    #[test]
    fn places_are_found_whatever_the_turn() {
        for turns in [0.0, -1.0, 1.0, -4096.0, 1e9] {
            let mut window = Window::new(&[1], &[0.0], &[0.0]);
            for (i, part) in [(0, 0.25), (1, 0.75), (127, 0.5), (64, 0.125)] {
                add(&mut window, turns + (f64::from(i) + part) / 128.0, 3.0);
                let sums = window.bins[i as usize];
                assert_eq!((sums[0], sums[3]), (1.0, 3.0));
                assert!((sums[1] - part + 0.5).abs() < 2e-5, "{turns} {i}: {sums:?}");
            }
        }
    }

    /// What the model lacks is found, whatever the places within the bins, and beside a model a
    /// hundred times as large.
    #[test]
    fn what_the_model_lacks_is_found() {
        let (model, lacks) = ([0.0, 100.0, 50.0, -30.0, 80.0], [0.4, 1.0, -0.5, 0.3, 0.7]);
        for step in [0.618_033_988_749, 0.002_001_3] {
            let mut window = Window::new(&[1, 2], &[100.0, -30.0], &[50.0, 80.0]);
            for i in 0..2000 {
                let x = (f64::from(i) * step).fract();
                add(&mut window, x, series(x, &model) + series(x, &lacks));
            }
            let found = window.solve().unwrap().coefficients;
            for (a, b) in found.iter().zip(lacks) {
                assert!((a - b).abs() < 2e-3, "{found:?}");
            }
        }
    }

    /// Over even places each coefficient has the variance 2 / n, the zero 1 / n.
    #[test]
    fn variances_are_those_of_even_places() {
        let mut window = Window::new(&[1, 3, 8], &[0.0; 3], &[0.0; 3]);
        (0..1000).for_each(|i| add(&mut window, f64::from(i) / 1000.0, 0.0));
        let variances = window.solve().unwrap().variances;
        assert!((variances[0] - 1e-3).abs() < 1e-6);
        assert!(variances[1..].iter().all(|v| (v - 2e-3).abs() < 2e-5));
    }

    /// A few places, or a short arc, tell no orders.
    #[test]
    fn an_arc_tells_no_orders() {
        let mut window = Window::new(&[1, 2, 3], &[0.0; 3], &[0.0; 3]);
        (0..1000).for_each(|i| add(&mut window, f64::from(i) / 8000.0, 0.0));
        assert!(window.solve().is_none());
        window.clear();
        assert!(window.solve().is_none());
    }
}
