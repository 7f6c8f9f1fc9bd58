//! Rows of columns, wide enough for any vector of the processor.

use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// Columns that a product holds in registers at once.
const TILE: usize = 4;

/// Rows of columns, each padded with zeros to whole vectors.
#[derive(Clone, Debug)]
pub struct Rows {
    values: Vec<f64>,
    stride: usize,
    columns: usize,
}

impl Rows {
    /// Numbers that follow the last row: a vector may be read beyond it.
    pub(super) const SLACK: usize = MOST_LANES;

    /// Zeros.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let stride = Self::width(columns);
        let values = vec![0.0; rows * stride + Self::SLACK];
        Self {
            values,
            stride,
            columns,
        }
    }

    /// Distance of rows with this number of columns.
    pub(super) fn width(columns: usize) -> usize {
        columns.next_multiple_of(MOST_LANES)
    }

    /// Distance of rows.
    pub(super) fn stride(&self) -> usize {
        self.stride
    }

    /// Columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Rows.
    pub fn len(&self) -> usize {
        (self.values.len() - Self::SLACK) / self.stride.max(1)
    }

    /// True without a row.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// A copy of some rows.
    pub(super) fn part(&self, start: usize, count: usize) -> Self {
        let (from, to) = (start * self.stride, (start + count) * self.stride);
        Self {
            values: self.values[from..to + Self::SLACK].to_vec(),
            stride: self.stride,
            columns: self.columns,
        }
    }

    /// One row and what a vector may read beyond it.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.stride..(i + 1) * self.stride + Self::SLACK]
    }

    /// One row and what a vector may read beyond it, to be written.
    pub fn row_mut(&mut self, i: usize) -> &mut [f64] {
        &mut self.values[i * self.stride..(i + 1) * self.stride + Self::SLACK]
    }

    /// Adds `self' other` to `sums`, whose rows are as far apart as those of `other`.
    ///
    /// With itself, the upper triangle alone is complete.
    pub fn add_products(&self, other: &Self, sums: &mut [f64]) {
        let work = Products {
            left: self,
            right: other,
            sums,
        };
        dispatch(InstructionSet::best(), work);
    }

    /// Adds the square of each column to the first row of `sums`, and its product with the next one to
    /// the second.
    pub(super) fn add_squares(&self, sums: &mut [f64]) {
        dispatch(InstructionSet::best(), Squares { rows: self, sums });
    }

    #[inline(always)]
    pub(super) fn load<L: Lanes>(values: &[f64], at: usize) -> L {
        let some: &[f64; MOST_LANES] = values[at..at + MOST_LANES].try_into().expect("eight");
        L::from_array(some)
    }

    #[inline(always)]
    pub(super) fn store<L: Lanes>(vector: L, values: &mut [f64], at: usize) {
        let some: &mut [f64; MOST_LANES] = (&mut values[at..at + MOST_LANES])
            .try_into()
            .expect("eight");
        vector.to_array(some);
    }
}

struct Products<'a> {
    left: &'a Rows,
    right: &'a Rows,
    sums: &'a mut [f64],
}

impl Kernel for Products<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { left, right, sums } = self;
        let (rows, stride) = (left.len(), right.stride);
        let is_gram = std::ptr::eq(left, right);
        for c in (0..left.columns).step_by(TILE) {
            let first = if is_gram { c - c % L::N } else { 0 };
            for d in (first..right.columns).step_by(2 * L::N) {
                // Two vectors at once, so that sums do not wait for one another. The second may be
                // the start of the next row, and is not kept then.
                let mut totals = [[L::splat(0.0); 2]; TILE];
                for i in 0..rows {
                    // A tile is within a row: strides are multiples of it.
                    let own = &left.values[i * left.stride + c..][..TILE];
                    let at = i * stride + d;
                    let both = [
                        Rows::load::<L>(&right.values, at),
                        Rows::load::<L>(&right.values, at + L::N),
                    ];
                    for k in 0..TILE {
                        let factor = L::splat(own[k]);
                        for v in 0..2 {
                            totals[k][v] = factor.mul_add(both[v], totals[k][v]);
                        }
                    }
                }
                for k in 0..TILE.min(left.columns - c) {
                    for v in 0..2 {
                        let at = d + v * L::N;
                        let mut found = [0.0; MOST_LANES];
                        totals[k][v].to_array(&mut found);
                        if at < stride {
                            let sums = &mut sums[(c + k) * stride + at..];
                            for lane in 0..L::N {
                                sums[lane] += found[lane];
                            }
                        }
                    }
                }
            }
        }
    }
}

struct Squares<'a> {
    rows: &'a Rows,
    sums: &'a mut [f64],
}

impl Kernel for Squares<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self { rows, sums } = self;
        for c in (0..rows.stride).step_by(L::N) {
            let mut totals = [L::splat(0.0); 2];
            for i in 0..rows.len() {
                let own = Rows::load::<L>(&rows.values, i * rows.stride + c);
                let next = Rows::load::<L>(rows.row(i), c + 1);
                totals = [own.mul_add(own, totals[0]), own.mul_add(next, totals[1])];
            }
            for k in 0..2 {
                let mut found = [0.0; MOST_LANES];
                totals[k].to_array(&mut found);
                for lane in 0..L::N {
                    sums[k * rows.stride + c + lane] += found[lane];
                }
            }
        }
    }
}
