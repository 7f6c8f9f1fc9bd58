//! Sums over readings at a ladder of orders, as a search over orders asks for.

use super::lines::{of_radians, vector};
use crate::check::same_length;
use crate::error::Error;
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// Readings whose waves are turned from order to order together: they stay in the cache.
const BLOCK: usize = 256;

/// A block with room to load a whole vector from its last places.
type Places = [f64; BLOCK + MOST_LANES];

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
    use super::super::lines::tests::angles;
    use super::*;

    /// Rounding of a sum of a few hundred values, of as many turns.
    const SUMMED: f64 = 1e-11;

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

    /// A unit ends within a vector: what lies beyond is no part of it, whatever it is.
    #[test]
    fn a_unit_knows_nothing_of_the_next() {
        let orders = Ladder {
            first: 0.5,
            step: 1.0,
            count: 3,
        };
        for len in 1..2 * MOST_LANES {
            let mut theta = angles()[..len].to_vec();
            let values = vec![1.0; len + MOST_LANES];
            let mut alone = vec![0.0; 2 * orders.count];
            unit_sums(&theta, &values[..len], &[0], orders, &mut alone).unwrap();
            theta.extend([f64::NAN; MOST_LANES]);
            let mut both = vec![0.0; 4 * orders.count];
            unit_sums(&theta, &values, &[0, len], orders, &mut both).unwrap();
            for (own, pair) in alone.chunks_exact(2).zip(both.chunks_exact(4)) {
                assert_eq!(own, &pair[..2], "{len} readings");
            }
        }
    }

    #[test]
    fn lengths_that_do_not_match_are_told() {
        let orders = Ladder {
            first: 1.0,
            step: 1.0,
            count: 2,
        };
        assert!(unit_sums(&[0.0], &[1.0], &[0], orders, &mut [0.0; 3]).is_err());
    }
}
