//! Readings, noises and models, without a generator of random numbers.

use nalgebra::DMatrix;
use trueangle::evidence::{CORRELATION_TIMES, Model, Noise, Readings, Run};

/// Of some hundred products of order 1 times the condition of the covariance.
pub const SAME: f64 = 1e-10;

/// Numbers from 0 to 1 without a generator: the golden rotation.
pub fn even(i: usize, seed: usize) -> f64 {
    (0.618_033_988_749_895 * i as f64 + 0.414_213_562_373_095 * seed as f64 + 0.1).fract()
}

/// About normal: the sum of twelve scattered numbers.
pub fn normal(i: usize, seed: usize) -> f64 {
    let hash = |k: usize| {
        let mut x = (i * 1_000_003 + k * 7919 + seed * 104_729 + 17) as u64;
        for _ in 0..3 {
            x ^= x >> 33;
            x = x.wrapping_mul(0xff51_afd7_ed55_8ccd);
        }
        (x >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..12).map(hash).sum::<f64>() - 6.0
}

/// Irregular times with gaps and readings that share a time.
pub fn times(n: usize, seed: usize) -> Vec<f64> {
    let mut t = 3.0;
    (0..n)
        .map(|i| {
            t += match i % 17 {
                5 => 0.0,
                9 => 150.0,
                _ => 0.2 + 1.6 * even(i, seed),
            };
            t
        })
        .collect()
}

pub fn dense(noise: &Noise, time: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(time.len(), time.len(), |i, k| {
        let apart = (time[i] - time[k]).abs();
        let white = if i == k { noise.white } else { 0.0 };
        let terms = noise.terms.iter().zip(CORRELATION_TIMES);
        white
            + terms
                .map(|(a, length)| a * (-apart / length).exp())
                .sum::<f64>()
    })
}

pub fn noises() -> [Noise; 4] {
    [
        Noise::of([0.7, 0.2, 0.5, 0.1, 0.9, 2.0]),
        Noise::of([1.3, 0.0, 0.0, 0.0, 0.0, 0.0]),
        Noise::of([0.05, 0.0, 4.0, 0.0, 0.0, 0.3]),
        Noise::of([0.02, 1.0, 0.0, 0.0, 0.0, 30.0]),
    ]
}

pub fn in_steps(time: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = time.windows(2).map(|p| p[1] - p[0]).collect();
    steps.sort_by(f64::total_cmp);
    let n = steps.len();
    let step = if n == 0 {
        1.0
    } else {
        0.5 * (steps[n / 2] + steps[(n - 1) / 2])
    };
    time.iter().map(|t| t / step).collect()
}

pub fn harmonics(theta: &[f64], orders: &[f64]) -> DMatrix<f64> {
    DMatrix::from_fn(theta.len(), 2 * orders.len(), |i, c| {
        let angle = orders[c / 2] * theta[i];
        if c % 2 == 0 { angle.cos() } else { angle.sin() }
    })
}

#[derive(Clone)]
pub struct Case {
    pub theta: Vec<f64>,
    pub error: Vec<f64>,
    pub time: Vec<f64>,
}

/// Runs of different lengths, one of a single reading and one longer than a chunk.
pub fn cases(lengths: &[usize]) -> Vec<Case> {
    lengths
        .iter()
        .enumerate()
        .map(|(r, &n)| {
            let theta: Vec<f64> = (0..n).map(|i| 6.0 * even(i, r)).collect();
            let wave = |(i, x): (usize, &f64)| {
                5.0 * (x + 0.3).cos() + 2.0 * (3.0 * x).sin() + normal(i, r) + 40.0 * r as f64
            };
            let error = theta.iter().enumerate().map(wave).collect();
            Case {
                theta,
                error,
                time: times(n, r),
            }
        })
        .collect()
}

pub const LENGTHS: [usize; 4] = [90, 1, 300, 40];

pub const ORDERS: [f64; 4] = [1.0, 2.0, 3.0, 17.0];

pub fn readings(cases: &[Case], orders: &[f64]) -> Readings {
    let run = |case: &Case| Run::new(&case.theta, &case.error, Some(&case.time)).unwrap();
    Readings::new(cases.iter().map(run).collect(), orders.to_vec()).unwrap()
}

pub fn models() -> [Model; 4] {
    let of = |tau: [f64; 4], omega: [f64; 4]| Model {
        widths: vec![2; 4],
        tau: tau.to_vec(),
        omega: omega.to_vec(),
    };
    [
        of([30.0, 0.0, 2.0, 0.0], [0.0; 4]),
        of([30.0, 0.0, 2.0, 0.1], [0.5, 0.0, 0.0, 0.2]),
        // A line bound to time: it differs from run to run, and runs share nothing of it.
        of([50.0, 0.0, 0.0, 0.0], [0.0, 3.0, 0.0, 0.0]),
        of([0.0; 4], [0.0; 4]),
    ]
}
