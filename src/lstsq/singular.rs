//! Singular values by Jacobi's rotations of columns, each as exact as its own size.
//!
//! nalgebra's take steps of a size that values far below the greatest do not survive: of 34
//! columns of a condition of 1e9 they left twenty times the squares that the readings do.

use nalgebra::DMatrix;

use super::householder::{BLOCK, dot};
use crate::interrupt;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Some ten sweeps are usual: each squares what is left of the cosines between columns.
const SWEEPS: usize = 60;

/// `X = U S V'` of a matrix with as many rows as columns or more.
pub struct Singular {
    /// From the greatest on.
    pub values: Vec<f64>,
    /// `U`, of a value of zero a column of zeros.
    pub left: DMatrix<f64>,
    /// `V`.
    pub turns: DMatrix<f64>,
}

/// Singular values and vectors of finite numbers.
pub fn singular(matrix: &DMatrix<f64>) -> Singular {
    let (height, n) = matrix.shape();
    let (upper, blocks) = (
        height.div_ceil(BLOCK),
        height.div_ceil(BLOCK) + n.div_ceil(BLOCK),
    );
    let mut columns = vec![[0.0; BLOCK]; blocks * n];
    for (j, column) in columns.chunks_exact_mut(blocks.max(1)).enumerate() {
        let (above, below) = column.split_at_mut(upper);
        above.as_flattened_mut()[..height].copy_from_slice(matrix.column(j).as_slice());
        below.as_flattened_mut()[j] = 1.0;
    }
    for _ in 0..SWEEPS {
        interrupt::point();
        let mut turned = false;
        let sweep = Sweep {
            columns: &mut columns,
            blocks,
            upper,
            turned: &mut turned,
        };
        dispatch(InstructionSet::best(), sweep);
        if !turned {
            break;
        }
    }
    let mut found: Vec<_> = columns
        .chunks_exact(blocks.max(1))
        .map(|column| {
            let (above, below) = column.split_at(upper);
            let (above, below) = (&above.as_flattened()[..height], &below.as_flattened()[..n]);
            (
                above.iter().map(|x| x * x).sum::<f64>().sqrt(),
                above,
                below,
            )
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    Singular {
        values: found.iter().map(|&(value, ..)| value).collect(),
        left: DMatrix::from_fn(height, n, |i, j| {
            let (value, above, _) = found[j];
            if value > 0.0 { above[i] / value } else { 0.0 }
        }),
        turns: DMatrix::from_fn(n, n, |i, j| found[j].2[i]),
    }
}

/// One rotation of every pair of columns that are not at right angles.
///
/// A column is `upper` blocks of the matrix above those of what has been rotated so far.
struct Sweep<'a> {
    columns: &'a mut [[f64; BLOCK]],
    blocks: usize,
    upper: usize,
    turned: &'a mut bool,
}

impl Kernel for Sweep<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            columns,
            blocks,
            upper,
            turned,
        } = self;
        let n = columns.len() / blocks.max(1);
        let mut squares: Vec<f64> = columns
            .chunks_exact(blocks.max(1))
            .map(|column| dot::<L>(&column[..upper], &column[..upper]))
            .collect();
        let limit = f64::EPSILON * ((upper * BLOCK) as f64).sqrt();
        for i in 0..n {
            for j in i + 1..n {
                let (before, after) = columns.split_at_mut(j * blocks);
                let (a, b) = (
                    &mut before[i * blocks..(i + 1) * blocks],
                    &mut after[..blocks],
                );
                let common = dot::<L>(&a[..upper], &b[..upper]);
                if common.abs() <= limit * squares[i].sqrt() * squares[j].sqrt() {
                    continue;
                }
                *turned = true;
                let half = (squares[j] - squares[i]) / (2.0 * common);
                let tangent = 1.0_f64.copysign(half) / (half.abs() + (1.0 + half * half).sqrt());
                let cosine = 1.0 / (1.0 + tangent * tangent).sqrt();
                rotate(a, b, cosine, cosine * tangent);
                squares[i] = dot::<L>(&a[..upper], &a[..upper]);
                squares[j] = dot::<L>(&b[..upper], &b[..upper]);
            }
        }
    }
}

#[inline(always)]
fn rotate(a: &mut [[f64; BLOCK]], b: &mut [[f64; BLOCK]], cosine: f64, sine: f64) {
    for (a, b) in a.iter_mut().zip(b) {
        for i in 0..BLOCK {
            let (x, y) = (a[i], b[i]);
            a[i] = cosine * x - sine * y;
            b[i] = sine * x + cosine * y;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Powers of numbers in a quarter: neighbouring columns are nearly alike.
    fn powers(height: usize, columns: usize) -> DMatrix<f64> {
        DMatrix::from_fn(height, columns, |i, j| {
            (0.7 + 0.3 * i as f64 / height as f64).powi(j as i32)
        })
    }

    #[test]
    fn rotations_give_the_matrix_back_of_columns_at_right_angles() {
        let mut alike = powers(24, 9);
        let first = alike.column(0).into_owned();
        alike.set_column(4, &first);
        alike.column_mut(7).fill(0.0);
        for matrix in [
            powers(1, 1),
            powers(13, 5),
            powers(36, 34),
            alike,
            DMatrix::zeros(0, 0),
        ] {
            let n = matrix.ncols();
            let found = singular(&matrix);
            assert!(found.values.is_sorted_by(|a, b| a >= b));
            let values = DMatrix::from_diagonal(&found.values.clone().into());
            let back = &found.left * values * found.turns.transpose();
            assert!((back - &matrix).amax() < 1e-13);
            let turns = found.turns.tr_mul(&found.turns);
            assert!((turns - DMatrix::identity(n, n)).amax() < 1e-13);
            let seen = found.values.iter().filter(|&value| *value > 0.0).count();
            let left = found
                .left
                .columns(0, seen)
                .tr_mul(&found.left.columns(0, seen));
            assert!((left - DMatrix::identity(seen, seen)).amax() < 1e-8);
        }
    }

    #[test]
    fn small_values_are_as_exact_as_great_ones() {
        // Of a rotation with its columns scaled, the scales: to 1e-300 of the greatest.
        let turn = DMatrix::from_row_slice(2, 2, &[0.6, -0.8, 0.8, 0.6]);
        let scaled = &turn * DMatrix::from_row_slice(2, 2, &[1e-150, 0.0, 0.0, 3.0]);
        let found = singular(&scaled).values;
        assert!((found[0] / 3.0 - 1.0).abs() < 1e-15 && (found[1] / 1e-150 - 1.0).abs() < 1e-15);
    }
}
