//! Products of columns within blocks, at one reading and with the reading before: what follows
//! under noise of any correlation costs no pass over the readings.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use nalgebra::{RealField, convert};

use super::Correlated;
use crate::interrupt;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Columns whose sums are held at once.
const TILE: usize = 16;

/// Readings that are summed in the precision of the columns before their sum is added in double.
const ROWS: usize = 64;

/// Products within each block of columns, `width * width` for a block.
///
/// With the filter of a correlation rho they are `same + rho^2 inner - rho cross`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BlockProducts {
    /// At one reading.
    pub same: Vec<f64>,
    /// At readings that neither begin nor end a run.
    pub inner: Vec<f64>,
    /// With the reading before in the run, and the other way round.
    pub cross: Vec<f64>,
}

/// Products of so many columns, reading by reading, in blocks of so many.
pub fn block_products<T: RealField + Copy + Into<f64>>(
    noise: Correlated<'_>,
    x: &[T],
    columns: usize,
    width: usize,
) -> BlockProducts {
    let size = columns * width;
    let mut found = BlockProducts {
        same: vec![0.0; size],
        inner: vec![0.0; size],
        cross: vec![0.0; size],
    };
    let work = Work {
        noise,
        x,
        columns,
        width,
        found: &mut found,
    };
    dispatch(InstructionSet::best(), work);
    found
}

struct Work<'a, T> {
    noise: Correlated<'a>,
    x: &'a [T],
    columns: usize,
    width: usize,
    found: &'a mut BlockProducts,
}

impl<T: RealField + Copy + Into<f64>> Kernel for Work<'_, T> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        match self.width {
            1 => self.tiles::<1>(),
            2 => self.tiles::<2>(),
            _ => self.blocks(),
        }
        let inner = self.found.same.clone();
        self.found.inner = inner;
        for &(start, stop) in self.noise.bounds {
            if start < stop {
                self.take_off(start);
                self.take_off(stop - 1);
            }
        }
    }
}

impl<T: RealField + Copy + Into<f64>> Work<'_, T> {
    /// Blocks of one column or of two, many side by side.
    #[inline(always)]
    fn tiles<const W: usize>(&mut self) {
        for first in (0..self.columns).step_by(TILE) {
            interrupt::point();
            let count = TILE.min(self.columns - first);
            // Of every column with itself and with the other of its block: at one reading, and
            // with the reading before.
            let mut sums = [[0.0_f64; TILE]; 4];
            for &(start, stop) in self.noise.bounds {
                let mut before = [T::zero(); TILE];
                for from in (start..stop).step_by(ROWS) {
                    let [mut same, mut mixed, mut cross, mut turned] = [[T::zero(); TILE]; 4];
                    for i in from..stop.min(from + ROWS) {
                        let at = i * self.columns + first;
                        let mut row = [T::zero(); TILE];
                        if count == TILE {
                            let all: &[T; TILE] =
                                self.x[at..at + TILE].try_into().expect("as many");
                            row = *all;
                        } else {
                            row[..count].copy_from_slice(&self.x[at..at + count]);
                        }
                        if let Some(roots) = self.noise.roots {
                            let root: T = convert(roots[i]);
                            for l in 0..TILE {
                                row[l] *= root;
                            }
                        }
                        for l in 0..TILE {
                            same[l] += row[l] * row[l];
                            cross[l] += before[l] * row[l];
                        }
                        if W == 2 {
                            let mut other = [T::zero(); TILE];
                            for l in 0..TILE / 2 {
                                other[2 * l] = row[2 * l + 1];
                                other[2 * l + 1] = row[2 * l];
                            }
                            for l in 0..TILE {
                                mixed[l] += row[l] * other[l];
                                turned[l] += before[l] * other[l];
                            }
                        }
                        before = row;
                    }
                    for (sum, some) in sums.iter_mut().zip([same, mixed, cross, turned]) {
                        for l in 0..TILE {
                            sum[l] += some[l].into();
                        }
                    }
                }
            }
            let [same, mixed, cross, turned] = sums;
            for l in 0..count {
                // Of column l with itself and with the other of its block.
                let at = (first + l) * W;
                let (own, other) = (at + l % W, at + (l ^ 1) % W);
                self.found.same[own] = same[l];
                self.found.cross[own] = 2.0 * cross[l];
                if W == 2 {
                    self.found.same[other] = mixed[l];
                    self.found.cross[other] = turned[l] + turned[l ^ 1];
                }
            }
        }
    }

    /// Blocks of any width.
    #[inline(always)]
    fn blocks(&mut self) {
        for &(start, stop) in self.noise.bounds {
            interrupt::point();
            for i in start..stop {
                for at in (0..self.columns).step_by(self.width.max(1)) {
                    for a in at..at + self.width {
                        for b in at..at + self.width {
                            let to = a * self.width + b - at;
                            let (x, y) = (self.value(i, a), self.value(i, b));
                            self.found.same[to] += x * y;
                            if i > start {
                                let (u, v) = (self.value(i - 1, a), self.value(i - 1, b));
                                self.found.cross[to] += u * y + v * x;
                            }
                        }
                    }
                }
            }
        }
    }

    fn take_off(&mut self, i: usize) {
        for at in (0..self.columns).step_by(self.width.max(1)) {
            for a in at..at + self.width {
                for b in at..at + self.width {
                    let product = self.value(i, a) * self.value(i, b);
                    self.found.inner[a * self.width + b - at] -= product;
                }
            }
        }
    }

    #[inline(always)]
    fn value(&self, i: usize, column: usize) -> f64 {
        let root = self.noise.roots.map_or(1.0, |roots| roots[i]);
        root * self.x[i * self.columns + column].into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;

    /// Runs of many readings, of one, and of none.
    const BOUNDS: [(usize, usize); 5] = [(0, 0), (0, 130), (130, 131), (131, 131), (131, 300)];

    /// Rounding of sums of 300 products of at most 2: in single precision of 64 at a time.
    const DOUBLE: f64 = 1e-12;
    const SINGLE: f64 = 1e-4;

    #[test]
    fn products_under_a_correlation_are_those_of_filtered_columns() {
        let (n, columns) = (300, 36);
        let x: Vec<f64> = (0..n * columns).map(|i| ((i * i) as f64).sin()).collect();
        let single: Vec<f32> = x.iter().map(|&x| x as f32).collect();
        let roots: Vec<f64> = (0..n).map(|i| 1.0 + 0.3 * (i as f64).cos()).collect();
        for roots in [None, Some(roots.as_slice())] {
            for width in [1, 2, 3] {
                let noise = |rho| Correlated {
                    bounds: &BOUNDS,
                    rho,
                    roots,
                };
                let found = block_products(noise(0.0), &x, columns, width);
                let rough = block_products(noise(0.0), &single, columns, width);
                for rho in [0.0, 0.6] {
                    let mut white = vec![0.0; x.len()];
                    noise(rho).filtered(&x, columns, &mut white);
                    let white = DMatrix::from_row_slice(n, columns, &white);
                    for at in (0..columns).step_by(width) {
                        for (a, b) in
                            (at..at + width).flat_map(|a| (at..at + width).map(move |b| (a, b)))
                        {
                            let expected = white.column(a).dot(&white.column(b));
                            let k = a * width + b - at;
                            for (found, near) in [(&found, DOUBLE), (&rough, SINGLE)] {
                                let product = found.same[k] + rho * rho * found.inner[k]
                                    - rho * found.cross[k];
                                assert!((product - expected).abs() < near, "{width} {a} {b}");
                            }
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn no_columns_have_no_products() {
        let noise = Correlated {
            bounds: &BOUNDS,
            rho: 0.0,
            roots: None,
        };
        let none: [f64; 0] = [];
        assert_eq!(block_products(noise, &none, 0, 2), BlockProducts::default());
    }
}
