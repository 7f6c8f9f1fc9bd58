//! Readings of a window, summed by their place in the turn, and the harmonics that they leave.
//!
//! A bin holds how many readings it has, the first two powers of where they stand about its middle,
//! and the sum of their errors: eight additions a reading, whatever the number of orders. Within a
//! bin of a sixteenth of the highest order's cycle sines and the model are told to second order.
//! The end of a window takes one Fourier transform of each power over the bins and one
//! factorisation of the normal matrix: n log n of its n bins and the third power of its orders,
//! however many readings it had.

use std::f64::consts::PI;
use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

/// Bins to a cycle of the highest order.
const PER_CYCLE: u32 = 16;

/// Bins at least.
const FEWEST: usize = 128;

/// Least pivot of the normal matrix, its columns scaled, with which orders are told apart.
const TOLD: f64 = 1e-3;

/// Columns of an inverse that are computed side by side.
const LANES: usize = 4;

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
    /// Readings that they are of.
    pub readings: f64,
}

/// Sums of the readings of one window.
#[derive(Clone)]
pub struct Window {
    orders: Vec<u32>,
    bins: Vec<Bin>,
    held: Held,
    /// Value, slope and half the curvature of the model at the middle of each bin, per bin.
    model: Vec<[f64; 3]>,
    transform: Arc<dyn Fft<f64>>,
}

impl Window {
    /// No readings yet, of a model with these coefficients of its orders.
    pub fn new(orders: &[u32], cosine: &[f64], sine: &[f64]) -> Self {
        let highest = orders.iter().copied().max().unwrap_or(1);
        let count = ((highest * PER_CYCLE) as usize)
            .max(FEWEST)
            .next_power_of_two();
        let width = 2.0 * PI / count as f64;
        let model = (0..count).map(|bin| {
            let mut found = [0.0; 3];
            for ((&k, a), b) in orders.iter().zip(cosine).zip(sine) {
                let turn = f64::from(k) * width;
                let (s, c) = (turn * bin as f64).sin_cos();
                found[0] += a * c + b * s;
                found[1] += turn * (b * c - a * s);
                found[2] -= 0.5 * turn * turn * (a * c + b * s);
            }
            found
        });
        Self {
            orders: orders.to_vec(),
            bins: vec![[0.0; 4]; count],
            held: Held::default(),
            model: model.collect(),
            transform: FftPlanner::new().plan_fft_forward(count),
        }
    }

    /// Parts of a turn that a bin takes.
    pub fn width(&self) -> f64 {
        1.0 / self.bins.len() as f64
    }

    /// Bytes that a window keeps.
    pub fn bytes(&self) -> usize {
        // The transform keeps one complex factor a bin.
        let factors = self.bins.len() * size_of::<Complex64>();
        size_of_val(&self.bins[..]) + size_of_val(&self.model[..]) + factors
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
        let shifted = place + WHOLE;
        let within = place - (shifted - WHOLE);
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
        let readings = self.bins.iter().map(|sums| sums[0]).sum();
        if readings < size as f64 + 1.0 {
            return None;
        }
        let (mut gram, mut right) = self.normal();
        let scales: Vec<f64> = (0..size).map(|i| 1.0 / gram[i * size + i].sqrt()).collect();
        for (i, scale) in scales.iter().enumerate() {
            right[i] *= scale;
            let column = &mut gram[i * size + i..(i + 1) * size];
            for (value, other) in column.iter_mut().zip(&scales[i..]) {
                *value *= scale * other;
            }
        }
        if !factored(&mut gram, size) {
            return None;
        }
        let mut passed = right;
        for j in 0..size {
            let column = &gram[j * size + j..(j + 1) * size];
            passed[j] *= column[0];
            let (done, rest) = passed.split_at_mut(j + 1);
            subtract(rest, done[j], &column[1..]);
        }
        let mut solved = Solved {
            coefficients: vec![0.0; size],
            variances: vec![0.0; size],
            readings,
        };
        let mut inverse = vec![[0.0; LANES]; size];
        for first in (0..size).step_by(LANES) {
            let own = &mut inverse[first..];
            inverse_columns(&gram, first, own);
            let (mut products, mut squares) = ([0.0; LANES], [0.0; LANES]);
            for (row, y) in own.iter().zip(&passed[first..]) {
                for lane in 0..LANES {
                    products[lane] += row[lane] * y;
                    squares[lane] += row[lane] * row[lane];
                }
            }
            for (lane, i) in (first..size.min(first + LANES)).enumerate() {
                solved.coefficients[i] = scales[i] * products[lane];
                solved.variances[i] = scales[i] * scales[i] * squares[lane];
            }
        }
        Some(solved)
    }

    /// The normal matrix of zero, cosine and sine of each order in turn, its lower triangle column
    /// by column, and the sums of the errors less the model's times these.
    fn normal(&self) -> (Vec<f64>, Vec<f64>) {
        let size = 1 + 2 * self.orders.len();
        let sums = self.sums();
        let mut right = vec![sums[0].1.re; size];
        let mut gram = vec![0.0; size * size];
        gram[0] = sums[0].0.re;
        for (i, &k) in self.orders.iter().enumerate() {
            let (a, b) = (1 + 2 * i, 2 + 2 * i);
            let (places, errors) = sums[k as usize];
            (gram[a], gram[b]) = (places.re, places.im);
            (right[a], right[b]) = (errors.re, errors.im);
            for (j, &l) in self.orders[..=i].iter().enumerate() {
                let (c, d) = ((1 + 2 * j) * size, (2 + 2 * j) * size);
                let (more, less) = (sums[(k + l) as usize].0, sums[k.abs_diff(l) as usize].0);
                // sin (k - l) x changes its sign with the order of the two.
                let turned = if k < l { -less.im } else { less.im };
                gram[c + a] = 0.5 * (less.re + more.re);
                gram[d + b] = 0.5 * (less.re - more.re);
                gram[d + a] = 0.5 * (more.im - turned);
                gram[c + b] = 0.5 * (more.im + turned);
            }
        }
        (gram, right)
    }

    /// Sums over the readings of cosine and sine of every order up to twice the highest: of the
    /// places, and times the errors less the model's.
    fn sums(&self) -> Vec<(Complex64, Complex64)> {
        let count = self.bins.len();
        let mut waves = vec![Complex64::default(); 3 * count];
        let (zeroth, rest) = waves.split_at_mut(count);
        let (first, second) = rest.split_at_mut(count);
        let powers = zeroth.iter_mut().zip(first).zip(second);
        for (((zeroth, first), second), (sums, model)) in
            powers.zip(self.bins.iter().zip(&self.model))
        {
            let left = sums[3] - model[0] * sums[0] - model[1] * sums[1] - model[2] * sums[2];
            // The errors of a bin stand where its readings do on average.
            let each = left / sums[0].max(1.0);
            *zeroth = Complex64::new(sums[0], left);
            *first = Complex64::new(sums[1], each * sums[1]);
            *second = Complex64::new(sums[2], each * sums[2]);
        }
        self.transform.process(&mut waves);
        let highest = 2 * self.orders.iter().copied().max().unwrap_or(0) as usize;
        let wave = |order: usize, turn: f64| {
            // exp(-i turn w) to second order in the place w within a bin.
            let [zeroth, first, second] = [0, 1, 2].map(|power| waves[power * count + order]);
            zeroth + first * Complex64::new(0.0, -turn) - second * (0.5 * turn * turn)
        };
        let width = 2.0 * PI / count as f64;
        let sums = (0..=highest).map(|order| {
            let turn = order as f64 * width;
            let ahead = wave(order, turn).conj();
            let back = wave((count - order) % count, -turn);
            let apart = back - ahead;
            (
                0.5 * (back + ahead),
                0.5 * Complex64::new(apart.im, -apart.re),
            )
        });
        sums.collect()
    }
}

/// Takes a multiple of a column from another.
#[inline(always)]
fn subtract(from: &mut [f64], factor: f64, column: &[f64]) {
    for (value, other) in from.iter_mut().zip(column) {
        *value -= factor * other;
    }
}

/// The lower triangle of Cholesky column by column, in place, the diagonal inverted; false where a
/// pivot is too small.
fn factored(matrix: &mut [f64], size: usize) -> bool {
    for j in 0..size {
        let (before, after) = matrix.split_at_mut((j + 1) * size);
        let column = &mut before[j * size + j..];
        let pivot = column[0];
        if pivot.is_nan() || pivot < TOLD {
            return false;
        }
        let root = 1.0 / pivot.sqrt();
        column[0] = root;
        column[1..].iter_mut().for_each(|value| *value *= root);
        for (i, other) in after.chunks_exact_mut(size).enumerate() {
            subtract(&mut other[j + 1 + i..], column[i + 1], &column[i + 1..]);
        }
    }
    true
}

/// `LANES` columns side by side of the inverse of a triangle whose diagonal is inverted, from the
/// diagonal of the first on.
fn inverse_columns(triangle: &[f64], first: usize, found: &mut [[f64; LANES]]) {
    let size = found.len() + first;
    found.fill([0.0; LANES]);
    for (lane, row) in found.iter_mut().take(LANES).enumerate() {
        row[lane] = 1.0;
    }
    for k in 0..found.len() {
        let column = &triangle[(first + k) * (size + 1)..(first + k + 1) * size];
        let (done, rest) = found.split_at_mut(k + 1);
        let row = done[k].map(|value| value * column[0]);
        done[k] = row;
        for (values, factor) in rest.iter_mut().zip(&column[1..]) {
            for lane in 0..LANES {
                values[lane] -= factor * row[lane];
            }
        }
    }
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

    /// A place is in the bin about it on both sides of zero and turns away, its distance from the
    /// middle with it.
    #[test]
    fn places_are_found_whatever_the_turn() {
        for turns in [0.0, -1.0, 1.0, -4096.0, 1e9] {
            let mut window = Window::new(&[1], &[0.0], &[0.0]);
            for (i, part) in [(0, -0.25), (1, 0.25), (127, 0.0), (64, -0.375)] {
                add(&mut window, turns + (f64::from(i) + part) / 128.0, 3.0);
                let sums = window.bins[i as usize];
                assert_eq!((sums[0], sums[3]), (1.0, 3.0));
                assert!((sums[1] - part).abs() < 2e-5, "{turns} {i}: {sums:?}");
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
