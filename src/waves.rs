//! Harmonics of many angles, order by order: rows of a design, and sums of them.
//!
//! A row may be scaled reading by reading and turned by `lead / k`, the phase by which the
//! answer of order `k` runs ahead. Readings of one lead share its sines.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use crate::check::same_length;
use crate::error::Error;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Readings whose powers are held at once: they stay in the first cache.
const CHUNK: usize = 256;

/// Scale and lead of every reading; none is 1 and 0.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answer<'a> {
    /// Factor of each reading.
    pub factor: Option<&'a [f64]>,
    /// Lead of order 1 at each reading, radians.
    pub lead: Option<&'a [f64]>,
}

impl Answer<'_> {
    fn check(&self, n: usize) -> Result<(), Error> {
        for (name, values) in [("factor", self.factor), ("lead", self.lead)] {
            if let Some(values) = values {
                same_length(name, values.len(), "theta", n)?;
            }
        }
        Ok(())
    }
}

/// `out` becomes, for each order in turn, the cosines of all readings and then the sines.
///
/// Neighbouring orders are made by one complex product each: within `k` roundings.
pub fn rows(
    theta: &[f64],
    orders: &[u32],
    answer: Answer<'_>,
    out: &mut [f64],
) -> Result<(), Error> {
    let n = theta.len();
    answer.check(n)?;
    same_length("out", out.len(), "2 * orders * theta", 2 * orders.len() * n)?;
    dispatch(
        InstructionSet::best(),
        Rows {
            theta,
            orders,
            answer,
            out,
        },
    );
    Ok(())
}

/// `out` becomes the sum of the rows, each times its coefficient: cosine and sine of each
/// order in turn.
pub fn sum(
    theta: &[f64],
    orders: &[u32],
    coefficients: &[f64],
    answer: Answer<'_>,
    out: &mut [f64],
) -> Result<(), Error> {
    answer.check(theta.len())?;
    same_length("out", out.len(), "theta", theta.len())?;
    same_length(
        "coefficients",
        coefficients.len(),
        "2 * orders",
        2 * orders.len(),
    )?;
    dispatch(
        InstructionSet::best(),
        Sum {
            theta,
            orders,
            coefficients,
            answer,
            out,
        },
    );
    Ok(())
}

/// Powers of `exp(i theta)` of a chunk of readings.
struct Powers {
    unit: [[f64; CHUNK]; 2],
    power: [[f64; CHUNK]; 2],
    reached: u32,
}

impl Powers {
    #[inline(always)]
    fn of(theta: &[f64]) -> Self {
        let mut unit = [[0.0; CHUNK]; 2];
        for (i, x) in theta.iter().enumerate() {
            (unit[1][i], unit[0][i]) = x.sin_cos();
        }
        let power = [[1.0; CHUNK], [0.0; CHUNK]];
        Self {
            unit,
            power,
            reached: 0,
        }
    }

    /// On to `order`.
    #[inline(always)]
    fn advance(&mut self, theta: &[f64], order: u32) {
        let [c, s] = &mut self.power;
        if order == self.reached + 1 {
            let [u, v] = &self.unit;
            for i in 0..CHUNK {
                let (x, y) = (c[i] * u[i] - s[i] * v[i], c[i] * v[i] + s[i] * u[i]);
                (c[i], s[i]) = (x, y);
            }
        } else {
            for (i, x) in theta.iter().enumerate() {
                (s[i], c[i]) = (f64::from(order) * x).sin_cos();
            }
        }
        self.reached = order;
    }
}

/// Turns values of one order by `lead / order`, readings of one lead at a time.
#[inline(always)]
fn lead_on(cosine: &mut [f64], sine: &mut [f64], lead: &[f64], order: u32) {
    let mut start = 0;
    while start < lead.len() {
        let value = lead[start];
        let mut stop = start + 1;
        while stop < lead.len() && lead[stop] == value {
            stop += 1;
        }
        let (v, u) = (value / f64::from(order)).sin_cos();
        for i in start..stop {
            let (x, y) = (cosine[i], sine[i]);
            cosine[i] = x * u - y * v;
            sine[i] = x * v + y * u;
        }
        start = stop;
    }
}

/// A part of the scales or leads.
fn part(values: Option<&[f64]>, start: usize, len: usize) -> Option<&[f64]> {
    values.map(|values| &values[start..start + len])
}

struct Rows<'a> {
    theta: &'a [f64],
    orders: &'a [u32],
    answer: Answer<'a>,
    out: &'a mut [f64],
}

impl Kernel for Rows<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let n = self.theta.len();
        for (number, theta) in self.theta.chunks(CHUNK).enumerate() {
            let (start, len) = (number * CHUNK, theta.len());
            let mut powers = Powers::of(theta);
            for (row, &order) in self.orders.iter().enumerate() {
                powers.advance(theta, order);
                let (above, below) = self.out[2 * row * n..].split_at_mut(n);
                let cosine = &mut above[start..start + len];
                let sine = &mut below[start..start + len];
                cosine.copy_from_slice(&powers.power[0][..len]);
                sine.copy_from_slice(&powers.power[1][..len]);
                if let Some(lead) = part(self.answer.lead, start, len) {
                    lead_on(cosine, sine, lead, order);
                }
                if let Some(factor) = part(self.answer.factor, start, len) {
                    for i in 0..len {
                        cosine[i] *= factor[i];
                        sine[i] *= factor[i];
                    }
                }
            }
        }
    }
}

struct Sum<'a> {
    theta: &'a [f64],
    orders: &'a [u32],
    coefficients: &'a [f64],
    answer: Answer<'a>,
    out: &'a mut [f64],
}

impl Kernel for Sum<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        for (number, theta) in self.theta.chunks(CHUNK).enumerate() {
            let (start, len) = (number * CHUNK, theta.len());
            let mut powers = Powers::of(theta);
            let (mut cosine, mut sine) = ([0.0; CHUNK], [0.0; CHUNK]);
            let mut total = [0.0; CHUNK];
            for (pair, &order) in self.coefficients.chunks_exact(2).zip(self.orders) {
                powers.advance(theta, order);
                let (a, b) = (pair[0], pair[1]);
                if let Some(lead) = part(self.answer.lead, start, len) {
                    cosine.copy_from_slice(&powers.power[0]);
                    sine.copy_from_slice(&powers.power[1]);
                    lead_on(&mut cosine[..len], &mut sine[..len], lead, order);
                    for i in 0..CHUNK {
                        total[i] += a * cosine[i] + b * sine[i];
                    }
                } else {
                    let [c, s] = &powers.power;
                    for i in 0..CHUNK {
                        total[i] += a * c[i] + b * s[i];
                    }
                }
            }
            let out = &mut self.out[start..start + len];
            out.copy_from_slice(&total[..len]);
            if let Some(factor) = part(self.answer.factor, start, len) {
                for i in 0..len {
                    out[i] *= factor[i];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `order` complex products after each other, each of two roundings.
    fn tolerance(order: u32) -> f64 {
        4.0 * f64::from(order) * f64::EPSILON
    }

    fn angles(n: usize) -> Vec<f64> {
        (0..n).map(|i| 0.37 * i as f64 - 40.0).collect()
    }

    #[test]
    fn rows_are_the_harmonics_one_by_one() {
        let orders = [1, 2, 3, 7, 8, 30];
        for n in [0, 1, 255, 256, 700] {
            let theta = angles(n);
            let factor: Vec<f64> = (0..n).map(|i| 1.0 + 0.01 * i as f64).collect();
            let lead: Vec<f64> = (0..n).map(|i| 0.2 * (i / 10) as f64).collect();
            let answer = Answer {
                factor: Some(&factor),
                lead: Some(&lead),
            };
            let mut out = vec![f64::NAN; 2 * orders.len() * n];
            rows(&theta, &orders, answer, &mut out).unwrap();
            let coefficients: Vec<f64> = (0..12).map(|j| 1.0 - 0.3 * f64::from(j)).collect();
            let mut total = vec![f64::NAN; n];
            sum(&theta, &orders, &coefficients, answer, &mut total).unwrap();
            for i in 0..n {
                let mut expected = 0.0;
                for (row, &k) in orders.iter().enumerate() {
                    let k64 = f64::from(k);
                    let (s, c) = (k64 * theta[i] + lead[i] / k64).sin_cos();
                    let (cosine, sine) = (out[2 * row * n + i], out[(2 * row + 1) * n + i]);
                    // The angle itself is rounded before its sine is taken.
                    let near = factor[i] * (tolerance(k) + 2.0 * f64::EPSILON * k64 * 300.0);
                    assert!((cosine - factor[i] * c).abs() <= near, "order {k}");
                    assert!((sine - factor[i] * s).abs() <= near, "order {k}");
                    expected += coefficients[2 * row] * cosine + coefficients[2 * row + 1] * sine;
                }
                assert!((total[i] - expected).abs() <= 1e-13 * factor[i]);
            }
        }
    }

    #[test]
    fn lengths_are_checked() {
        let answer = Answer {
            factor: Some(&[1.0]),
            lead: None,
        };
        assert!(rows(&[0.0, 1.0], &[1], answer, &mut [0.0; 4]).is_err());
        assert!(rows(&[0.0, 1.0], &[1], Answer::default(), &mut [0.0; 3]).is_err());
        assert!(sum(&[0.0], &[1], &[1.0], Answer::default(), &mut [0.0]).is_err());
    }
}
