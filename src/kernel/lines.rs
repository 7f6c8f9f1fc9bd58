//! Lines of any order at angles in radians: their columns and their sum.
//!
//! What a search over orders asks for: every function goes over the readings once, several
//! of them in a vector. A product of order and angle is rounded as `order * angle` is
//! anywhere; its cosine and sine are exact to about 1e-16.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use super::sincos::{Phase, sin_cos};
use crate::angle::Period;
use crate::check::same_length;
use crate::error::Error;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// What a column is stored as.
pub trait Stored: Copy {
    /// Rounded to it.
    fn of(value: f64) -> Self;
}

impl Stored for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }
}

impl Stored for f32 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value as f32
    }
}

/// Readings looked at before all of a column are: nearly every column is told not to vanish.
const FIRST: usize = 8;

/// Columns that are smaller than `limit` times their order, at least 1, at every reading become
/// zeros: what is left of the sine of order 18 at 36 positions is rounding.
pub fn vanished(orders: &[f64], limit: f64, rows: &mut [f64]) {
    let width = 2 * orders.len();
    for column in 0..width {
        let limit = limit * orders[column / 2].max(1.0);
        let is_small = |row: &[f64]| row[column].abs() < limit;
        let mut first = rows.chunks_exact(width);
        if first.by_ref().take(FIRST).all(is_small) && first.all(is_small) {
            rows.iter_mut()
                .skip(column)
                .step_by(width)
                .for_each(|x| *x = 0.0);
        }
    }
}

/// Cosines and sines of `order * angle`, side by side, one row of `2 orders` a reading.
pub fn columns<T: Stored>(theta: &[f64], orders: &[f64], out: &mut [T]) -> Result<(), Error> {
    same_length(
        "out",
        out.len(),
        "angles and orders",
        2 * theta.len() * orders.len(),
    )?;
    let work = Columns { theta, orders, out };
    dispatch(InstructionSet::best(), work);
    Ok(())
}

struct Columns<'a, T> {
    theta: &'a [f64],
    orders: &'a [f64],
    out: &'a mut [T],
}

impl<T: Stored> Kernel for Columns<'_, T> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let width = 2 * self.orders.len();
        let (mut sines, mut cosines) = ([0.0; MOST_LANES], [0.0; MOST_LANES]);
        for first in (0..self.theta.len()).step_by(L::N) {
            let some = L::N.min(self.theta.len() - first);
            let theta = vector::<L>(self.theta, first, some);
            let rows = &mut self.out[first * width..(first + some) * width];
            for j in 0..self.orders.len() {
                let (sine, cosine) = of_radians(theta * L::splat(self.orders[j]));
                sine.to_array(&mut sines);
                cosine.to_array(&mut cosines);
                for i in 0..some {
                    rows[i * width + 2 * j] = T::of(cosines[i]);
                    rows[i * width + 2 * j + 1] = T::of(sines[i]);
                }
            }
        }
    }
}

/// Lines of some orders: `sum_k cosine_k cos(order_k angle) + sine_k sin(order_k angle)`.
#[derive(Clone, Copy, Debug)]
pub struct Lines<'a> {
    /// Of any value.
    pub orders: &'a [f64],
    /// As many.
    pub cosine: &'a [f64],
    /// As many.
    pub sine: &'a [f64],
}

impl Lines<'_> {
    fn check(&self) -> Result<(), Error> {
        same_length("cosine", self.cosine.len(), "orders", self.orders.len())?;
        same_length("sine", self.sine.len(), "orders", self.orders.len())
    }
}

/// Their sum at every angle.
pub fn sum(theta: &[f64], lines: Lines, out: &mut [f64]) -> Result<(), Error> {
    lines.check()?;
    same_length("out", out.len(), "angles", theta.len())?;
    dispatch(
        InstructionSet::best(),
        Sum::<false> {
            theta,
            lines,
            out,
            slope: &mut [],
        },
    );
    Ok(())
}

/// Their sum and its derivative at every angle, by the same cosines and sines.
pub fn sum_and_slope(
    theta: &[f64],
    lines: Lines,
    out: &mut [f64],
    slope: &mut [f64],
) -> Result<(), Error> {
    lines.check()?;
    same_length("out", out.len(), "angles", theta.len())?;
    same_length("slope", slope.len(), "angles", theta.len())?;
    dispatch(
        InstructionSet::best(),
        Sum::<true> {
            theta,
            lines,
            out,
            slope,
        },
    );
    Ok(())
}

struct Sum<'a, const SLOPE: bool> {
    theta: &'a [f64],
    lines: Lines<'a>,
    out: &'a mut [f64],
    slope: &'a mut [f64],
}

impl<const SLOPE: bool> Kernel for Sum<'_, SLOPE> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Lines {
            orders,
            cosine: a,
            sine: b,
        } = self.lines;
        let mut values = [0.0; MOST_LANES];
        for first in (0..self.theta.len()).step_by(L::N) {
            let some = L::N.min(self.theta.len() - first);
            let theta = vector::<L>(self.theta, first, some);
            let (mut total, mut slope) = (L::splat(0.0), L::splat(0.0));
            for j in 0..orders.len() {
                let (sine, cosine) = of_radians(theta * L::splat(orders[j]));
                total = cosine.mul_add(L::splat(a[j]), total);
                total = sine.mul_add(L::splat(b[j]), total);
                if SLOPE {
                    slope = cosine.mul_add(L::splat(orders[j] * b[j]), slope);
                    slope = sine.mul_add(L::splat(-orders[j] * a[j]), slope);
                }
            }
            total.to_array(&mut values);
            self.out[first..first + some].copy_from_slice(&values[..some]);
            if SLOPE {
                slope.to_array(&mut values);
                self.slope[first..first + some].copy_from_slice(&values[..some]);
            }
        }
    }
}

/// Sine and cosine of angles in radians.
#[inline(always)]
pub(super) fn of_radians<L: Lanes>(x: L) -> (L, L) {
    sin_cos(Phase::new(Period::RADIANS, x, 1.0))
}

/// Up to a vector's worth of values, with zeros where there are fewer.
#[inline(always)]
pub(super) fn vector<L: Lanes>(values: &[f64], first: usize, some: usize) -> L {
    if let Some(all) = values.get(first..first + MOST_LANES)
        && some == L::N
    {
        return L::from_array(all.try_into().expect("as many"));
    }
    let mut lanes = [0.0; MOST_LANES];
    lanes[..some].copy_from_slice(&values[first..first + some]);
    L::from_array(&lanes)
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Rounding of a cosine.
    const ROUNDING: f64 = 4e-15;

    pub(in crate::kernel) fn angles() -> Vec<f64> {
        (0..1003)
            .map(|i| (f64::from(i) * 0.731).sin() * 40.0)
            .collect()
    }

    #[test]
    fn columns_and_sums_are_those_of_plain_cosines_and_sines() {
        let theta = angles();
        let orders = [1.0, 2.5, 102.0];
        let (cosine, sine) = ([0.3, -1.0, 2.0], [0.0, 0.7, -0.2]);
        let mut wide = vec![0.0_f64; 6 * theta.len()];
        let mut single = vec![0.0_f32; 6 * theta.len()];
        let mut total = vec![0.0; theta.len()];
        columns(&theta, &orders, &mut wide).unwrap();
        columns(&theta, &orders, &mut single).unwrap();
        let (mut again, mut slope) = (total.clone(), total.clone());
        let lines = Lines {
            orders: &orders,
            cosine: &cosine,
            sine: &sine,
        };
        sum(&theta, lines, &mut total).unwrap();
        sum_and_slope(&theta, lines, &mut again, &mut slope).unwrap();
        assert_eq!(again, total);
        for (i, &x) in theta.iter().enumerate() {
            let (mut expected, mut steep) = (0.0, 0.0);
            for (j, &order) in orders.iter().enumerate() {
                let (s, c) = (order * x).sin_cos();
                assert!((wide[6 * i + 2 * j] - c).abs() < ROUNDING);
                assert!((wide[6 * i + 2 * j + 1] - s).abs() < ROUNDING);
                assert_eq!(single[6 * i + 2 * j], wide[6 * i + 2 * j] as f32);
                expected += cosine[j] * c + sine[j] * s;
                steep += order * (sine[j] * c - cosine[j] * s);
            }
            assert!((total[i] - expected).abs() < 10.0 * ROUNDING);
            let most: f64 = orders.iter().sum();
            assert!((slope[i] - steep).abs() < 10.0 * ROUNDING * most);
        }
    }

    #[test]
    fn columns_of_rounding_become_zeros_and_others_stay() {
        let theta: Vec<f64> = (0..36)
            .map(|i| f64::from(i) * 10_f64.to_radians())
            .collect();
        let orders = [18.0, 36.0, 0.5, 7.0];
        let mut rows = vec![0.0; 8 * theta.len()];
        columns(&theta, &orders, &mut rows).unwrap();
        let before = rows.clone();
        vanished(&orders, 1e-11, &mut rows);
        for (i, (&is, was)) in rows.iter().zip(before).enumerate() {
            let expected = if [1, 3].contains(&(i % 8)) { 0.0 } else { was };
            assert_eq!(is, expected, "{i}");
        }
        // Small at the first readings and not at those after them.
        let mut late = vec![1e-13; 40];
        late[31] = 0.3;
        vanished(&[1.0], 1e-11, &mut late);
        assert_eq!((late[0], late[30], late[31]), (0.0, 0.0, 0.3));
    }

    #[test]
    fn lengths_that_do_not_match_are_told() {
        assert!(columns(&[0.0], &[1.0], &mut [0.0_f64; 3]).is_err());
        let lines = Lines {
            orders: &[1.0],
            cosine: &[1.0],
            sine: &[],
        };
        assert!(sum(&[0.0], lines, &mut [0.0]).is_err());
        let lines = Lines {
            sine: &[1.0],
            ..lines
        };
        assert!(sum(&[0.0], lines, &mut [0.0; 2]).is_err());
        assert!(sum_and_slope(&[0.0], lines, &mut [0.0], &mut []).is_err());
    }
}
