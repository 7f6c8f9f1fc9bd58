//! Lines of any order at angles in radians: their columns, their sum, sums over them.
//!
//! What a search over orders asks for: every function goes over the readings once, several
//! of them in a vector. A product of order and angle is rounded as `order * angle` is
//! anywhere; its cosine and sine are exact to about 1e-16.

use super::sincos::{Phase, sin_cos};
use crate::angle::Period;
use crate::check::same_length;
use crate::error::Error;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// Readings whose waves are turned from order to order together: they stay in the cache.
const BLOCK: usize = 256;

/// A block with room to load a whole vector from its last places.
type Places = [f64; BLOCK + MOST_LANES];

/// What a column is stored as.
pub trait Stored: Copy {
    /// Rounded to it.
    fn of(value: f64) -> Self;
}

impl Stored for f64 {
    fn of(value: f64) -> Self {
        value
    }
}

impl Stored for f32 {
    fn of(value: f64) -> Self {
        value as f32
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

/// Orders at equal steps: `first`, `first + step` ... `count` of them.
#[derive(Clone, Copy, Debug)]
pub struct Ladder {
    /// The lowest.
    pub first: f64,
    /// From one to the next.
    pub step: f64,
    /// How many.
    pub count: usize,
}

/// Sums of `value exp(-i order angle)` over every unit of readings, for orders of a ladder.
///
/// `values` holds whole columns one after the other, `starts` the first reading of each
/// unit. Real and imaginary parts go to `out`, by order, then unit, then column. Waves are
/// turned from order to order, which loses about 1e-16 an order.
pub fn unit_sums(
    theta: &[f64],
    values: &[f64],
    starts: &[usize],
    orders: Ladder,
    out: &mut [f64],
) -> Result<(), Error> {
    let columns = if theta.is_empty() {
        0
    } else {
        values.len() / theta.len()
    };
    same_length(
        "values",
        values.len(),
        "angles and columns",
        columns * theta.len(),
    )?;
    let wanted = 2 * orders.count * starts.len() * columns;
    same_length("out", out.len(), "orders, units and columns", wanted)?;
    out.fill(0.0);
    let work = UnitSums {
        theta,
        values,
        columns,
        starts,
        orders,
        out,
    };
    dispatch(InstructionSet::best(), work);
    Ok(())
}

struct UnitSums<'a> {
    theta: &'a [f64],
    values: &'a [f64],
    columns: usize,
    starts: &'a [usize],
    orders: Ladder,
    out: &'a mut [f64],
}

/// Waves of a block of readings and what turns them to the next order.
struct Waves {
    real: Places,
    imaginary: Places,
    turn_real: Places,
    turn_imaginary: Places,
}

impl Kernel for UnitSums<'_> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let zeros = [0.0; BLOCK + MOST_LANES];
        let mut waves = Waves {
            real: zeros,
            imaginary: zeros,
            turn_real: zeros,
            turn_imaginary: zeros,
        };
        let mut block = vec![zeros; self.columns];
        for unit in 0..self.starts.len() {
            let stop = self.starts.get(unit + 1).copied();
            let stop = stop.unwrap_or(self.theta.len()).min(self.theta.len());
            for first in (self.starts[unit].min(stop)..stop).step_by(BLOCK) {
                let some = BLOCK.min(stop - first);
                self.fill::<L>(&mut waves, &mut block, first, some);
                self.climb::<L>(&mut waves, &block, unit, some.div_ceil(L::N));
            }
        }
    }
}

impl UnitSums<'_> {
    /// The waves of the lowest order and the values of some readings; zeros beyond them.
    #[inline(always)]
    fn fill<L: Lanes>(&self, waves: &mut Waves, block: &mut [Places], first: usize, some: usize) {
        for i in (0..some).step_by(L::N) {
            let theta = vector::<L>(self.theta, first + i, L::N.min(some - i));
            let (sine, cosine) = of_radians(theta * L::splat(self.orders.first));
            store(cosine, &mut waves.real, i);
            store(L::splat(0.0) - sine, &mut waves.imaginary, i);
            let (sine, cosine) = of_radians(theta * L::splat(self.orders.step));
            store(cosine, &mut waves.turn_real, i);
            store(L::splat(0.0) - sine, &mut waves.turn_imaginary, i);
        }
        for column in 0..self.columns {
            let from = column * self.theta.len() + first;
            block[column][..some].copy_from_slice(&self.values[from..from + some]);
            block[column][some..].fill(0.0);
        }
    }

    /// Adds a block to the sums of its unit, order by order.
    #[inline(always)]
    fn climb<L: Lanes>(
        &mut self,
        waves: &mut Waves,
        block: &[Places],
        unit: usize,
        vectors: usize,
    ) {
        let mut lanes = [0.0; MOST_LANES];
        for k in 0..self.orders.count {
            let place = 2 * (k * self.starts.len() + unit) * self.columns;
            for column in 0..self.columns {
                let (mut real, mut imaginary) = (L::splat(0.0), L::splat(0.0));
                for v in 0..vectors {
                    let value = load::<L>(&block[column], v * L::N);
                    real = value.mul_add(load::<L>(&waves.real, v * L::N), real);
                    imaginary = value.mul_add(load::<L>(&waves.imaginary, v * L::N), imaginary);
                }
                for (part, total) in [real, imaginary].into_iter().enumerate() {
                    total.to_array(&mut lanes);
                    let total: f64 = lanes[..L::N].iter().sum();
                    self.out[place + 2 * column + part] += total;
                }
            }
            for v in 0..vectors {
                let i = v * L::N;
                let (real, imaginary) = (load::<L>(&waves.real, i), load::<L>(&waves.imaginary, i));
                let (c, s) = (
                    load::<L>(&waves.turn_real, i),
                    load(&waves.turn_imaginary, i),
                );
                store(imaginary.neg_mul_add(s, real * c), &mut waves.real, i);
                store(real.mul_add(s, imaginary * c), &mut waves.imaginary, i);
            }
        }
    }
}

/// Sine and cosine of angles in radians.
#[inline(always)]
fn of_radians<L: Lanes>(x: L) -> (L, L) {
    sin_cos(Phase::new(Period::RADIANS, x, 1.0))
}

/// Up to a vector's worth of values, with zeros where there are fewer.
#[inline(always)]
fn vector<L: Lanes>(values: &[f64], first: usize, some: usize) -> L {
    let mut lanes = [0.0; MOST_LANES];
    lanes[..some].copy_from_slice(&values[first..first + some]);
    L::from_array(&lanes)
}

#[inline(always)]
fn load<L: Lanes>(places: &Places, i: usize) -> L {
    let mut lanes = [0.0; MOST_LANES];
    lanes.copy_from_slice(&places[i..i + MOST_LANES]);
    L::from_array(&lanes)
}

#[inline(always)]
fn store<L: Lanes>(vector: L, places: &mut Places, i: usize) {
    let mut lanes = [0.0; MOST_LANES];
    vector.to_array(&mut lanes);
    places[i..i + L::N].copy_from_slice(&lanes[..L::N]);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rounding of a cosine, of a sum of a few hundred, of as many turns.
    const ROUNDING: f64 = 4e-15;
    const SUMMED: f64 = 1e-11;

    fn angles() -> Vec<f64> {
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
    fn sums_over_units_are_those_of_one_order_after_the_other() {
        let theta = angles();
        let n = theta.len();
        let values: Vec<f64> = (0..2 * n).map(|i| (i as f64 * 0.377).cos()).collect();
        let starts = [0, 5, 700];
        let orders = Ladder {
            first: 0.4,
            step: 0.75,
            count: 60,
        };
        let mut out = vec![f64::NAN; 2 * orders.count * starts.len() * 2];
        unit_sums(&theta, &values, &starts, orders, &mut out).unwrap();
        for k in 0..orders.count {
            let order = orders.first + k as f64 * orders.step;
            for (unit, &start) in starts.iter().enumerate() {
                let stop = starts.get(unit + 1).copied().unwrap_or(n);
                for column in 0..2 {
                    let (mut real, mut imaginary) = (0.0, 0.0);
                    for i in start..stop {
                        real += values[column * n + i] * (order * theta[i]).cos();
                        imaginary -= values[column * n + i] * (order * theta[i]).sin();
                    }
                    let place = 2 * ((k * starts.len() + unit) * 2 + column);
                    assert!((out[place] - real).abs() < SUMMED);
                    assert!((out[place + 1] - imaginary).abs() < SUMMED);
                }
            }
        }
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
        let orders = Ladder {
            first: 1.0,
            step: 1.0,
            count: 2,
        };
        assert!(unit_sums(&[0.0], &[1.0], &[0], orders, &mut [0.0; 3]).is_err());
    }
}
