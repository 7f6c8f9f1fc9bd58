//! Readings of a window, summed by their place in the turn, and the harmonics that they leave.
//!
//! A bin holds how many readings it has, the first two powers of where they stand in it, and the
//! sum of their errors: eight additions a reading, whatever the number of orders. Within a bin of a
//! sixteenth of the highest order's cycle sines and the model are told to second order.

use std::f64::consts::PI;

/// Bins to a cycle of the highest order.
const PER_CYCLE: u32 = 16;

/// Bins at least.
const FEWEST: usize = 128;

/// Least pivot of the normal matrix, its columns scaled, with which orders are told apart.
const TOLD: f64 = 1e-3;

/// Count, sum of places, of their squares, and of errors.
type Bin = [f64; 4];

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

    /// Adds a reading at a part of a turn, 0 to 1.
    #[inline(always)]
    pub fn add(&mut self, turn: f64, error: f64) {
        let place = turn * self.bins.len() as f64;
        let bin = place as u32;
        let within = place - f64::from(bin) - 0.5;
        // 1 itself is the end of the last bin.
        let bin = (bin as usize).min(self.bins.len() - 1);
        let reading = [1.0, within, within * within, error];
        for (sum, value) in self.bins[bin].iter_mut().zip(reading) {
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
        if self.readings() < size as f64 + 1.0 {
            return None;
        }
        let mut gram = self.gram();
        let mut right = self.moments();
        let scales: Vec<f64> = (0..size).map(|i| gram[i * size + i].sqrt()).collect();
        for (i, scale) in scales.iter().enumerate() {
            right[i] /= scale;
            for (j, other) in scales.iter().enumerate() {
                gram[i * size + j] /= scale * other;
            }
        }
        if !factored(&mut gram, size) {
            return None;
        }
        let inverse = inverted(&gram, size);
        // Rows of the inverse triangle: forward and back are products with it.
        let forward: Vec<f64> = (0..size)
            .map(|i| (0..=i).map(|j| inverse[i * size + j] * right[j]).sum())
            .collect();
        let back =
            |i: usize| -> f64 { (i..size).map(|j| inverse[j * size + i] * forward[j]).sum() };
        let spread = |i: usize| -> f64 { (i..size).map(|j| inverse[j * size + i].powi(2)).sum() };
        Some(Solved {
            coefficients: (0..size).map(|i| back(i) / scales[i]).collect(),
            variances: (0..size).map(|i| spread(i) / scales[i].powi(2)).collect(),
        })
    }

    /// Sum over the readings of cosine and sine of an order.
    fn sums(&self, order: u32) -> (f64, f64) {
        let count = self.bins.len();
        let turn = f64::from(order) * 2.0 * PI / count as f64;
        let (mut cosine, mut sine) = (0.0, 0.0);
        for (bin, sums) in self.bins.iter().enumerate() {
            let (c, s) = self.at(order, bin);
            let (first, second) = (turn * sums[1], 0.5 * turn * turn * sums[2]);
            cosine += c * (sums[0] - second) - s * first;
            sine += s * (sums[0] - second) + c * first;
        }
        (cosine, sine)
    }

    /// Cosine and sine of an order at the middle of a bin.
    fn at(&self, order: u32, bin: usize) -> (f64, f64) {
        let (mask, count) = (self.cosines.len() - 1, self.bins.len());
        let i = (order as usize).wrapping_mul(2 * bin + 1);
        let quarter = count / 2;
        (
            self.cosines[i & mask],
            self.cosines[i.wrapping_sub(quarter) & mask],
        )
    }

    /// The normal matrix of zero, cosine and sine of each order in turn.
    fn gram(&self) -> Vec<f64> {
        let size = 1 + 2 * self.orders.len();
        let mut gram = vec![0.0; size * size];
        let mut known: Vec<Option<(f64, f64)>> = Vec::new();
        let mut of = |order: u32| -> (f64, f64) {
            let i = order as usize;
            if known.len() <= i {
                known.resize(i + 1, None);
            }
            *known[i].get_or_insert_with(|| self.sums(order))
        };
        gram[0] = self.readings();
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
        for i in 0..size {
            for j in 0..i {
                gram[j * size + i] = gram[i * size + j];
            }
        }
        gram
    }

    /// Sums of errors less the model's, times 1, cosine and sine of each order.
    fn moments(&self) -> Vec<f64> {
        let width = 2.0 * PI / self.bins.len() as f64;
        let mut found = vec![0.0; 1 + 2 * self.orders.len()];
        for (bin, (sums, model)) in self.bins.iter().zip(&self.model).enumerate() {
            if sums[0] == 0.0 {
                continue;
            }
            let (first, second) = (width * sums[1], width * width * sums[2]);
            let left = sums[3] - model[0] * sums[0] - model[1] * first - 0.5 * model[2] * second;
            found[0] += left;
            let (mean, square) = (first / sums[0], second / sums[0]);
            for (i, &k) in self.orders.iter().enumerate() {
                let turn = f64::from(k);
                let (c, s) = self.at(k, bin);
                let (near, far) = (1.0 - 0.5 * turn * turn * square, turn * mean);
                found[1 + 2 * i] += left * (c * near - s * far);
                found[2 + 2 * i] += left * (s * near + c * far);
            }
        }
        found
    }
}

/// The lower triangle of Cholesky, in place; false where a pivot is too small.
fn factored(matrix: &mut [f64], size: usize) -> bool {
    for j in 0..size {
        for k in 0..j {
            let factor = matrix[j * size + k];
            for i in j..size {
                matrix[i * size + j] -= factor * matrix[i * size + k];
            }
        }
        let pivot = matrix[j * size + j];
        if pivot.is_nan() || pivot < TOLD {
            return false;
        }
        let root = pivot.sqrt();
        for i in j..size {
            matrix[i * size + j] /= root;
        }
    }
    true
}

/// The inverse of a lower triangle.
fn inverted(lower: &[f64], size: usize) -> Vec<f64> {
    let mut inverse = vec![0.0; size * size];
    for i in 0..size {
        inverse[i * size + i] = 1.0 / lower[i * size + i];
        for j in 0..i {
            let sum: f64 = (j..i)
                .map(|k| lower[i * size + k] * inverse[k * size + j])
                .sum();
            inverse[i * size + j] = -sum / lower[i * size + i];
        }
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

    /// What the model lacks is found, whatever the places within the bins, and beside a model a
    /// hundred times as large.
    #[test]
    fn what_the_model_lacks_is_found() {
        let (model, lacks) = ([0.0, 100.0, 50.0, -30.0, 80.0], [0.4, 1.0, -0.5, 0.3, 0.7]);
        for step in [0.618_033_988_749, 0.002_001_3] {
            let mut window = Window::new(&[1, 2], &[100.0, -30.0], &[50.0, 80.0]);
            for i in 0..2000 {
                let x = (f64::from(i) * step).fract();
                window.add(x, series(x, &model) + series(x, &lacks));
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
        (0..1000).for_each(|i| window.add(f64::from(i) / 1000.0, 0.0));
        let variances = window.solve().unwrap().variances;
        assert!((variances[0] - 1e-3).abs() < 1e-6);
        assert!(variances[1..].iter().all(|v| (v - 2e-3).abs() < 2e-5));
    }

    /// A few places, or a short arc, tell no orders.
    #[test]
    fn an_arc_tells_no_orders() {
        let mut window = Window::new(&[1, 2, 3], &[0.0; 3], &[0.0; 3]);
        (0..1000).for_each(|i| window.add(f64::from(i) / 8000.0, 0.0));
        assert!(window.solve().is_none());
        window.clear();
        assert!(window.solve().is_none());
    }
}
