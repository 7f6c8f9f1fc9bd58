//! A running joint: windows against dense least squares, charts against sums over all windows.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector};
use trueangle::monitor::chart::normal_of_student;
use trueangle::monitor::watch::Limits;
use trueangle::monitor::window::Window;
use trueangle::monitor::{Closed, Monitor};

/// Of coefficients of order 1: sines within a bin are told to second order.
const BINNED: f64 = 2e-3;

/// Orders in no order, which no caller promises.
const ORDERS: [u32; 3] = [3, 1, 2];
const COSINE: [f64; 3] = [0.5, -1.0, 0.25];
const SINE: [f64; 3] = [-0.75, 0.5, 1.5];

fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed | 1;
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// `[1, cos, sin, ...]` of a place in turns.
fn row(turn: f64) -> Vec<f64> {
    let waves = ORDERS.iter().flat_map(|&k| {
        let (s, c) = (TAU * f64::from(k) * turn).sin_cos();
        [c, s]
    });
    std::iter::once(1.0).chain(waves).collect()
}

fn model(turn: f64) -> f64 {
    let known = COSINE.iter().zip(SINE).flat_map(|(&c, s)| [c, s]);
    row(turn)[1..].iter().zip(known).map(|(x, b)| x * b).sum()
}

/// Least squares reading by reading: coefficients less the model's, and their variances.
fn dense(turns: &[f64], errors: &[f64]) -> (DVector<f64>, DVector<f64>) {
    let rows: Vec<f64> = turns.iter().flat_map(|&x| row(x)).collect();
    let design = DMatrix::from_row_slice(turns.len(), 7, &rows);
    let left = DVector::from_fn(turns.len(), |i, _| errors[i] - model(turns[i]));
    let inverse = design.tr_mul(&design).try_inverse().unwrap();
    (&inverse * design.tr_mul(&left), inverse.diagonal())
}

/// Places that are not even and leave out a part of the turn: nothing is at right angles.
#[test]
fn a_window_is_the_least_squares_of_its_readings() {
    for seed in 1..6 {
        let mut next = uniform(seed);
        let turns: Vec<f64> = (0..400).map(|_| 0.7 * next() * next().sqrt()).collect();
        let errors: Vec<f64> = turns.iter().map(|&x| model(x) + next() - 0.3).collect();
        let mut window = Window::new(&ORDERS, &COSINE, &SINE);
        let mut held = window.held();
        for (x, e) in turns.iter().zip(&errors) {
            window.add(&mut held, x * window.count(), *e);
        }
        window.put(held);
        let (expected, variances) = dense(&turns, &errors);
        let found = window.solve().unwrap();
        assert_eq!(found.readings, 400.0);
        for i in 0..7 {
            // As far as bins can shift a solution: by its own length in this direction.
            let scale = (400.0 * variances[i]).sqrt();
            let off = (found.coefficients[i] - expected[i]).abs();
            assert!(off < BINNED * scale, "seed {seed}, {i}: {off} of {scale}");
            let ratio = found.variances[i] / variances[i];
            assert!((ratio - 1.0).abs() < 0.05, "seed {seed}, {i}: {ratio}");
        }
    }
}

/// Values of one level with their variances; the first ones count as one where they came by a step.
#[derive(Clone, Default)]
struct Level {
    values: Vec<(f64, f64)>,
    first: usize,
}

impl Level {
    /// Weight and mean of the values before one.
    fn before(&self, end: usize) -> (f64, f64) {
        let parts = self.values[..end].iter().enumerate();
        let weighed = parts.map(|(j, &(x, v))| {
            let shared = if j < self.first && end >= self.first {
                self.first
            } else {
                1
            };
            (x, 1.0 / v / shared as f64)
        });
        let (weight, sum) = weighed.fold((0.0, 0.0), |(w, s), (x, one)| (w + one, s + one * x));
        (weight, sum / weight)
    }

    fn all(&self) -> (f64, f64) {
        self.before(self.values.len())
    }

    /// Squares about the means: of the first values about theirs, and of what follows.
    fn squares(&self) -> f64 {
        let (_, own) = self.before(self.first);
        let (_, every) = self.all();
        let (mut squares, mut weight) = (0.0, 0.0);
        for (j, &(x, v)) in self.values.iter().enumerate() {
            let middle = if j < self.first { own } else { every };
            squares += (x - middle).powi(2) / v;
            weight += if j < self.first { 1.0 / v } else { 0.0 };
        }
        match self.first {
            0 => squares,
            n => squares + (own - every).powi(2) * weight / n as f64,
        }
    }

    /// Products of neighbours about the mean before each, and squares of the former.
    fn neighbours(&self) -> (f64, f64) {
        let (mut products, mut squares) = (0.0, 0.0);
        for j in 1..self.values.len() {
            let (_, middle) = self.before(j);
            let [a, b] = [j, j - 1].map(|k| (self.values[k].0 - middle) / self.values[k].1.sqrt());
            products += a * b;
            squares += b * b;
        }
        (products, squares)
    }
}

fn freedom(levels: &[Level]) -> f64 {
    levels.iter().map(|l| l.values.len() as f64 - 1.0).sum()
}

fn factor(levels: &[Level]) -> f64 {
    levels.iter().map(Level::squares).sum::<f64>() / freedom(levels).max(1.0)
}

/// Correlation of neighbours, where it is found.
fn correlation(levels: &[Level]) -> f64 {
    let both = levels.iter().map(Level::neighbours);
    let (products, squares) = both.fold((0.0, 0.0), |(p, s), (a, b)| (p + a, s + b));
    let found = products / squares;
    let counts = freedom(levels) >= 9.0 && found * (freedom(levels) + 1.0).sqrt() >= 2.0;
    if counts { found.min(0.95) } else { 0.0 }
}

/// The last value by those before it.
fn standard(levels: &[Level]) -> f64 {
    let mut before = levels.to_vec();
    let level = before.last_mut().unwrap();
    let (last, variance) = level.values.pop().unwrap();
    let Some(&(previous, own)) = level.values.last() else {
        return 0.0;
    };
    let ((weight, mean), n) = (level.all(), freedom(&before));
    if n < 2.0 {
        return 0.0;
    }
    let c = correlation(&before);
    let apart = (last - mean) / variance.sqrt() - c * (previous - mean) / own.sqrt();
    let std = (factor(&before) * (1.0 - c * c) * (1.0 + 1.0 / (weight * variance))).sqrt();
    normal_of_student(apart / std, n)
}

/// Windows since the split of a level that leaves least squares of both coefficients.
fn since(a: &Level, b: &Level) -> usize {
    let taken = |k: usize| {
        let parts = [a, b].map(|level| {
            let ((whole, mean), at) = (level.all(), level.values.len() - k);
            let new = Level {
                values: level.values[at..].to_vec(),
                first: 0,
            };
            let (own, middle) = new.all();
            (middle - mean).powi(2) * own * whole / (whole - own)
        });
        parts[0] + parts[1]
    };
    let held = a.values.len() - a.first.saturating_sub(1);
    let most = 31.min(held.saturating_sub(3)).max(1);
    (1..=most)
        .max_by(|&j, &k| taken(j).total_cmp(&taken(k)).then(k.cmp(&j)))
        .unwrap()
}

const LIMITS: Limits = Limits {
    allowance: 0.5,
    sum: 5.0,
    step: 4.0,
    mean: 3.0,
};
const KNOWN: [f64; 6] = [1e-4, 2e-4, 3e-4, 4e-4, 5e-4, 6e-4];

/// Windows of one turn whose harmonics wander, one of them far from the model from the start on,
/// one moving at window 45, and the zero jumping at window 30.
fn watched(seed: u64) -> (Vec<f64>, Vec<f64>, Vec<Closed>) {
    let mut next = uniform(seed);
    let (mut turns, mut errors) = (Vec::new(), Vec::new());
    let (mut drift, mut zero) = (vec![0.0; 6], 0.0);
    for window in 0..60 {
        zero += 0.1 * (next() - 0.5) + if window == 30 { 3.0 } else { 0.0 };
        for (i, d) in drift.iter_mut().enumerate() {
            *d = (if i < 2 { 0.7 } else { 0.0 }) * *d + 0.2 * (next() - 0.5);
        }
        for k in 0..360 {
            let turn = f64::from(k) / 360.0;
            let waves = row(turn);
            let moved = if window >= 45 {
                0.6 * waves[5] - 0.3 * waves[6]
            } else {
                0.0
            };
            let lost: f64 = waves[1..].iter().zip(&drift).map(|(x, d)| x * d).sum();
            turns.push(f64::from(window) + turn);
            errors.push(model(turn) + 1.2 * waves[4] + zero + lost + moved);
        }
    }
    let window = Window::new(&ORDERS, &COSINE, &SINE);
    let mut monitor = Monitor::new(360.0, window, KNOWN.to_vec(), 1.0, LIMITS);
    let angles: Vec<f64> = turns.iter().map(|x| 360.0 * x).collect();
    let closed = monitor.update(&angles, &errors, false);
    (turns, errors, closed)
}

/// Everything that is said follows from the coefficients of all windows so far.
#[test]
fn charts_are_those_of_all_windows() {
    for seed in 1..4 {
        let (turns, errors, closed) = watched(seed);
        assert!(closed.len() > 55);
        let mut zeros = Vec::new();
        let (mut charts, mut sums) = (vec![vec![Level::default()]; 6], [[0.0_f64; 2]; 6]);
        let (mut start, mut steps, mut told) = (0, vec![Level::default()], Vec::new());
        for (k, one) in closed.iter().enumerate() {
            let part = start..one.reading + 1;
            start = part.end;
            let (expected, variances) = dense(&turns[part.clone()], &errors[part.clone()]);
            assert_eq!(
                (one.window, one.readings),
                (k as u64 + 1, part.len() as f64)
            );
            for i in 0..7 {
                // Errors are taken about the first.
                let value = one.coefficients[i] + if i == 0 { errors[0] } else { 0.0 };
                assert!(
                    (value - expected[i]).abs() < 2.0 * BINNED,
                    "seed {seed}, {k}, {i}"
                );
            }
            zeros.push(one.coefficients[0]);
            for i in 0..6 {
                let value = (one.coefficients[i + 1], variances[i + 1]);
                charts[i].last_mut().unwrap().values.push(value);
                let z = standard(&charts[i]);
                for (sum, signed) in sums[i].iter_mut().zip([z, -z]) {
                    *sum = (*sum + signed - LIMITS.allowance).max(0.0);
                }
                let (found, own) = (one.statistics[i + 1], sums[i][0].max(sums[i][1]));
                assert!(
                    (found - own).abs() < 0.02 * (1.0 + own),
                    "seed {seed}, {k}, {i}: {found} {own}"
                );
            }
            let mut orders = Vec::new();
            for order in 0..3 {
                let (a, b) = (2 * order, 2 * order + 1);
                if one.statistics[a + 1].max(one.statistics[b + 1]) > LIMITS.sum {
                    orders.push(order + 1);
                    let said = one.moved.iter().find(|m| m.order == order + 1).unwrap();
                    let levels = [a, b].map(|i| charts[i].last().unwrap());
                    let back = since(levels[0], levels[1]);
                    assert_eq!(said.since, back as f64, "seed {seed}, window {k}");
                    let (mut size, mut variance) = (0.0, 0.0);
                    for i in [a, b] {
                        let old = charts[i].last_mut().unwrap();
                        let values = old.values.split_off(old.values.len() - back);
                        let (weight, mean) = old.all();
                        let c = correlation(&charts[i]);
                        let spread = factor(&charts[i]) * (1.0 + c) / (1.0 - c);
                        charts[i].push(Level {
                            values,
                            first: back,
                        });
                        let (own, middle) = charts[i].last().unwrap().all();
                        size += (middle - mean).powi(2);
                        variance += 0.5 * spread * (1.0 / (back as f64 * own) + 1.0 / weight);
                        sums[i] = [0.0; 2];
                    }
                    let off = (said.size - size.sqrt()).abs() + (said.std - variance.sqrt()).abs();
                    assert!(off < 1e-4, "seed {seed}, window {k}: {said:?}");
                }
            }
            if let [.., before, last] = zeros[..] {
                let (deviation, known) = (factor(&steps).sqrt(), steps[0].values.len());
                steps[0].values.push((last - before, 1.0));
                let size = standard(&steps).abs();
                assert!((one.statistics[0] - size).abs() < 1e-9 * (1.0 + size));
                if known > 8 && size > LIMITS.step {
                    orders.push(0);
                    let said = one.moved.last().unwrap();
                    assert!(
                        (said.size - (last - before)).abs() + (said.std - deviation).abs() < 1e-9
                    );
                    assert_eq!(said.since, 1.0);
                }
            }
            let found: Vec<usize> = one.moved.iter().map(|m| m.order).collect();
            assert_eq!(found, orders, "seed {seed}, window {k}");
            told.extend(orders);
            let mean = |i: usize| charts[i].last().unwrap().all().1;
            let spread =
                |i: usize| KNOWN[i] + factor(&charts[i]) / charts[i].last().unwrap().all().0;
            let unlike =
                |i: usize| normal_of_student(mean(i) / spread(i).sqrt(), 7.0).abs() > LIMITS.mean;
            let mut apart = Vec::new();
            for order in 0..3 {
                let (a, b) = (2 * order, 2 * order + 1);
                if k == 7 && !found.contains(&(order + 1)) && (unlike(a) || unlike(b)) {
                    apart.push(order + 1);
                    let said = one.unlike.iter().find(|m| m.order == order + 1).unwrap();
                    let size = mean(a).hypot(mean(b));
                    let std = (0.5 * (spread(a) + spread(b))).sqrt();
                    assert!((said.size - size).abs() + (said.std - std).abs() < 1e-9);
                    assert_eq!(said.since, 8.0);
                }
            }
            assert_eq!(
                one.unlike.iter().map(|m| m.order).collect::<Vec<_>>(),
                apart
            );
            if k == 7 {
                assert!(apart.contains(&2), "seed {seed}: {apart:?}");
            }
        }
        assert!(
            told.contains(&3) && told.contains(&0),
            "seed {seed}: {told:?}"
        );
    }
}

/// Bytes, as an allocator counts them; the extension has an allocator of its own.
#[cfg(not(feature = "python"))]
mod bytes {
    use std::alloc::{GlobalAlloc, Layout, System};
    use std::cell::Cell;

    use super::*;

    /// The system's allocator, which counts what a thread holds.
    struct Counting;

    #[global_allocator]
    static COUNTING: Counting = Counting;

    thread_local! {
        static HELD: Cell<usize> = const { Cell::new(0) };
    }

    // SAFETY: every piece comes from the system's allocator and goes back to it with its layout.
    unsafe impl GlobalAlloc for Counting {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            HELD.set(HELD.get().wrapping_add(layout.size()));
            // SAFETY: as promised by the caller, here and below.
            unsafe { System.alloc(layout) }
        }

        unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
            HELD.set(HELD.get().wrapping_sub(layout.size()));
            // SAFETY: as above.
            unsafe { System.dealloc(place, layout) };
        }
    }

    /// Of more coefficients a monitor says so many bytes more as the allocator gives it.
    #[test]
    fn a_monitor_says_how_many_bytes_its_coefficients_take() {
        let made = |size: usize| {
            let before = HELD.get();
            let window = Window::new(&ORDERS, &COSINE, &SINE);
            let monitor = Monitor::new(360.0, window, vec![0.0; size], 1.0, LIMITS);
            (monitor.bytes(), HELD.get().wrapping_sub(before))
        };
        let (said, held) = made(0);
        for size in [2, 6, 200] {
            let (more_said, more_held) = made(size);
            assert_eq!(more_said - said, more_held - held, "{size} coefficients");
        }
    }
}
