//! Products of columns under a noise with each other and with columns that are at hand.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use super::Correlated;
use crate::interrupt;
use crate::simd::{Kernel, Lanes, MOST_LANES};

/// Readings whose columns are held at once: they stay in the first cache.
const CHUNK: usize = 256;

/// Columns that one goes over together.
const TOGETHER: usize = 4;

/// Columns below which readings that none of them tells anything of are passed over.
const FEW: usize = 4;

/// A table of numbers and how many columns it has.
pub type Table<'a> = (&'a [f64], usize);

/// The numbers of a table, reading by reading or column by column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Columns of a reading side by side.
    Readings,
    /// Readings of a column one after the other.
    Columns,
}

/// Products of columns, mapped by a filter, with each other, and of the columns as they are with
/// others: added to those of each run or of all together.
pub struct Products<'a> {
    /// The filter.
    pub noise: Correlated<'a>,
    /// The columns.
    pub x: Table<'a>,
    /// How they stand.
    pub order: Order,
    /// The others, so many, column by column; as many numbers as a vector has follow the last.
    pub seen: Table<'a>,
    /// Of each run.
    pub each: bool,
    /// All products with each other, at least those of the upper triangle; else their powers.
    pub pairs: bool,
    /// Those of mapped columns with each other.
    pub grams: &'a mut [f64],
    /// Those of columns with the others, a row of these for each.
    pub moments: &'a mut [f64],
}

impl Kernel for Products<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let ((x, k), (seen, width)) = (self.x, self.seen);
        let (noise, bounds) = (self.noise, self.noise.bounds);
        let n = bounds.last().map_or(0, |&(_, stop)| stop);
        let size = CHUNK + MOST_LANES;
        let is_white = noise.is_white();
        let (of_reading, of_column) = match self.order {
            Order::Readings => (k, 1),
            Order::Columns => (1, n),
        };
        let (mut plain, mut white) = (vec![0.0; k * size], vec![0.0; k * size]);
        for run in 0..bounds.len() {
            interrupt::point();
            let (first, stop) = bounds[run];
            let place = if self.each { run } else { 0 };
            for start in (first..stop).step_by(CHUNK) {
                let some = CHUNK.min(stop - start);
                if of_reading == 1 {
                    for j in 0..k {
                        let column = &x[start + j * of_column..][..some];
                        plain[j * size..][..some].copy_from_slice(column);
                    }
                } else {
                    for i in 0..some {
                        for j in 0..k {
                            plain[j * size + i] = x[(start + i) * k + j];
                        }
                    }
                }
                if !is_white {
                    for j in 0..k {
                        let at = |i: usize| x[i * of_reading + j * of_column];
                        let before = (start > first).then(|| at(start - 1));
                        let out = &mut white[j * size..][..some];
                        filtered(noise, start, before, &plain[j * size..][..some], out);
                    }
                }
                let mapped = if is_white { &plain } else { &white };
                // Columns of one place or of a part of the time tell little of most readings.
                let (from, to) = match width {
                    0 => (0, 0),
                    _ if k < FEW => told(&plain, k, size, some),
                    _ => (0, some),
                };
                let others = (seen.get(start + from..).unwrap_or(&[]), n);
                // A few of the others at a time: they and all of the columns stay in the first cache.
                for first in (0..if from < to { width } else { 0 }).step_by(TOGETHER) {
                    let count = TOGETHER.min(width - first);
                    let some = (&others.0[first * n..], n);
                    for j in (0..k).step_by(2) {
                        let moments = &mut self.moments[(place * k + j) * width + first..];
                        let own = &plain[j * size + from..];
                        if j + 1 < k {
                            let rows = (to - from, size);
                            add::<L, true>(own, rows, some, count, (moments, width));
                        } else {
                            let rows = (to - from, 0);
                            add::<L, false>(own, rows, some, count, (moments, 0));
                        }
                    }
                }
                if self.pairs {
                    for first in (0..k).step_by(TOGETHER) {
                        let count = TOGETHER.min(k - first);
                        let some_columns = (&mapped[first * size..], size);
                        for j in (0..first + count).step_by(2) {
                            let grams = &mut self.grams[(place * k + j) * k + first..];
                            let own = &mapped[j * size..];
                            if j + 1 < k {
                                add::<L, true>(own, (some, size), some_columns, count, (grams, k));
                            } else {
                                add::<L, false>(own, (some, 0), some_columns, count, (grams, 0));
                            }
                        }
                    }
                } else {
                    for j in 0..k {
                        let (own, powers) = (&mapped[j * size..], &mut self.grams[place * k + j..]);
                        add::<L, false>(own, (some, 0), (own, size), 1, (powers, 0));
                    }
                }
            }
        }
    }
}

/// The readings of a chunk from the first to the last one of which a column is not zero.
#[inline(always)]
fn told(plain: &[f64], k: usize, size: usize, some: usize) -> (usize, usize) {
    let (mut from, mut to) = (some, 0);
    for j in 0..k {
        // What is not a number differs from zero, and stays in the sums.
        let column = &plain[j * size..][..some];
        let mut i = 0;
        while i < from && column[i] == 0.0 {
            i += 1;
        }
        from = i;
        let mut i = some;
        while i > to && column[i - 1] == 0.0 {
            i -= 1;
        }
        to = i;
    }
    (from, to)
}

/// A stretch of a column under the filter; `before` is the reading before it, if of the same run.
#[inline(always)]
fn filtered(noise: Correlated<'_>, start: usize, before: Option<f64>, x: &[f64], out: &mut [f64]) {
    let rho = noise.rho;
    let edge = (1.0 - rho * rho).sqrt();
    if let Some(all) = noise.roots {
        let roots = &all[start..start + x.len()];
        out[0] = match before {
            Some(before) => roots[0] * x[0] - rho * (all[start - 1] * before),
            None => edge * roots[0] * x[0],
        };
        for i in 1..x.len() {
            out[i] = roots[i] * x[i] - rho * (roots[i - 1] * x[i - 1]);
        }
    } else {
        out[0] = before.map_or(edge * x[0], |before| x[0] - rho * before);
        for i in 1..x.len() {
            out[i] = x[i] - rho * x[i - 1];
        }
    }
}

/// Adds products of so many rows of one column or of two, `apart` from each other, with columns
/// that stand `stride` apart: the second one's go `width` further.
#[inline(always)]
fn add<L: Lanes, const TWO: bool>(
    x: &[f64],
    (some, apart): (usize, usize),
    (others, stride): Table<'_>,
    count: usize,
    (sums, width): (&mut [f64], usize),
) {
    let whole = some - some % L::N;
    for first in (0..count).step_by(TOGETHER) {
        let last = TOGETHER.min(count - first) - 1;
        let mut at = [0; TOGETHER];
        for c in 0..TOGETHER {
            at[c] = (first + c.min(last)) * stride;
        }
        let mut totals = [L::splat(0.0); TOGETHER];
        let mut seconds = [L::splat(0.0); TOGETHER];
        for i in (0..whole).step_by(L::N) {
            let value = vector::<L>(x, i);
            let second = if TWO {
                vector::<L>(x, apart + i)
            } else {
                value
            };
            for c in 0..TOGETHER {
                let other = vector::<L>(others, at[c] + i);
                totals[c] = value.mul_add(other, totals[c]);
                if TWO {
                    seconds[c] = second.mul_add(other, seconds[c]);
                }
            }
        }
        let (found, beyond) = (L::totals(totals), L::totals(seconds));
        for c in 0..=last {
            let (mut sum, mut second) = (found[c], beyond[c]);
            for i in whole..some {
                sum += x[i] * others[at[c] + i];
                if TWO {
                    second += x[apart + i] * others[at[c] + i];
                }
            }
            sums[first + c] += sum;
            if TWO {
                sums[width + first + c] += second;
            }
        }
    }
}

/// Values from a place on; as many as the most lanes there are must follow it.
#[inline(always)]
fn vector<L: Lanes>(values: &[f64], at: usize) -> L {
    let some: &[f64; MOST_LANES] = values[at..at + MOST_LANES].try_into().expect("eight");
    L::from_array(some)
}
