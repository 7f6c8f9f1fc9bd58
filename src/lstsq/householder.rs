//! Householder's reflections of matrices of a few hundred columns at most, in the vectors of
//! the processor.

use nalgebra::DMatrix;

use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Numbers worked on side by side; columns are filled with zeros to a multiple of it.
pub(super) const BLOCK: usize = 8;

/// The upper triangle of the QR factorisation of rows, its diagonal not negative.
pub fn triangle(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let (height, columns) = rows.shape();
    let blocks = height.div_ceil(BLOCK);
    let mut matrix = vec![[0.0; BLOCK]; blocks * columns];
    if blocks > 0 {
        let pairs = matrix.chunks_exact_mut(blocks).zip(rows.column_iter());
        for (own, column) in pairs {
            own.as_flattened_mut()[..height].copy_from_slice(column.as_slice());
        }
    }
    let last = height.min(columns);
    let reflections = Reflections {
        matrix: &mut matrix,
        blocks,
        last,
    };
    dispatch(InstructionSet::best(), reflections);
    let values = matrix.as_flattened();
    DMatrix::from_fn(last, columns, |i, j| {
        if i <= j {
            values[j * blocks * BLOCK + i]
        } else {
            0.0
        }
    })
}

/// Reflects the first `last` columns of a matrix, column by column of so many blocks.
struct Reflections<'a> {
    matrix: &'a mut [[f64; BLOCK]],
    blocks: usize,
    last: usize,
}

impl Kernel for Reflections<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            matrix,
            blocks,
            last,
        } = self;
        // Of the column being reflected, zeros above its diagonal.
        let mut axis = vec![[0.0; BLOCK]; blocks];
        for k in 0..last {
            let (before, after) = matrix.split_at_mut((k + 1) * blocks);
            // Rows of the blocks before are done.
            let first = k / BLOCK;
            let column = &mut before[k * blocks + first..];
            let axis = &mut axis[first..];
            axis.copy_from_slice(column);
            axis[0][..k % BLOCK].fill(0.0);
            let norm = dot::<L>(axis, axis).sqrt();
            let pivot = axis[0][k % BLOCK];
            // A column that is dependent on those before it many times over is left at 1e-160:
            // the reciprocal of its square is infinite, and times zero not a number.
            if norm * norm < f64::MIN_POSITIVE {
                column[0][k % BLOCK] = norm;
                continue;
            }
            // Away from the pivot, so that nothing cancels; the sign is put back in the row.
            axis[0][k % BLOCK] = pivot + norm.copysign(pivot);
            let factor = -1.0 / (norm * (norm + pivot.abs()));
            column[0][k % BLOCK] = norm;
            for column in after.chunks_exact_mut(blocks) {
                let column = &mut column[first..];
                let share = factor * dot::<L>(axis, column);
                add::<L>(share, axis, column);
                if pivot.is_sign_positive() {
                    column[0][k % BLOCK] = -column[0][k % BLOCK];
                }
            }
        }
    }
}

#[inline(always)]
pub(super) fn dot<L: Lanes>(a: &[[f64; BLOCK]], b: &[[f64; BLOCK]]) -> f64 {
    let mut sums = [0.0; BLOCK];
    for (a, b) in a.iter().zip(b) {
        for i in 0..BLOCK {
            sums[i] = fused::<L>(a[i], b[i], sums[i]);
        }
    }
    ((sums[0] + sums[4]) + (sums[2] + sums[6])) + ((sums[1] + sums[5]) + (sums[3] + sums[7]))
}

/// `b += share a`.
#[inline(always)]
fn add<L: Lanes>(share: f64, a: &[[f64; BLOCK]], b: &mut [[f64; BLOCK]]) {
    for (a, b) in a.iter().zip(b) {
        for i in 0..BLOCK {
            b[i] = fused::<L>(share, a[i], b[i]);
        }
    }
}

/// `a * b + c`, in one instruction where the processor has it (a slow call elsewhere).
#[inline(always)]
fn fused<L: Lanes>(a: f64, b: f64, c: f64) -> f64 {
    if L::FUSED { a.mul_add(b, c) } else { a * b + c }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of elements of order 1 in sums of 100.
    const ROUNDING: f64 = 1e-13;

    #[test]
    fn the_triangle_is_that_of_nalgebra_and_has_the_gram_matrix_of_the_rows() {
        for (height, columns) in [
            (0, 4),
            (1, 1),
            (3, 5),
            (8, 8),
            (37, 12),
            (100, 37),
            (17, 30),
        ] {
            let rows = DMatrix::from_fn(height, columns, |i, j| {
                ((3 * i + 7 * j * j) as f64).sin() - f64::from(u8::from(i == j))
            });
            let found = triangle(&rows);
            assert_eq!(found.shape(), (height.min(columns), columns));
            let gram = rows.tr_mul(&rows) - found.tr_mul(&found);
            assert!(
                gram.amax() <= ROUNDING * height as f64,
                "{height} x {columns}"
            );
            let theirs = rows.qr().unpack_r();
            assert!(
                (found - theirs).amax() <= 100.0 * ROUNDING,
                "{height} x {columns}"
            );
        }
    }

    #[test]
    fn rows_of_one_place_beside_a_few_others_stay_finite() {
        // Most of 56 columns depend on those before: what is left of them underflows.
        for others in [1, 20, 43] {
            for same in [40, 80, 209] {
                let place = |i: usize| if i < others { 0.13 * i as f64 } else { 6.1 };
                let rows = DMatrix::from_fn(others + same, 56, |i, j| {
                    ((1 + j / 2) as f64 * place(i) + 1.6 * (j % 2) as f64).cos()
                });
                let found = triangle(&rows);
                assert!(found.iter().all(|value| value.is_finite()));
                assert!((0..found.nrows()).all(|i| found[(i, i)] >= 0.0));
                let gram = rows.tr_mul(&rows) - found.tr_mul(&found);
                assert!(gram.amax() <= ROUNDING * rows.nrows() as f64);
            }
        }
    }

    #[test]
    fn columns_of_zeros_stay() {
        let rows = DMatrix::from_fn(20, 3, |i, j| if j == 1 { 0.0 } else { (i + j) as f64 });
        let found = triangle(&rows);
        assert_eq!(found.column(1).amax(), 0.0);
        assert!(found.iter().all(|value| value.is_finite()));
        assert!((rows.tr_mul(&rows) - found.tr_mul(&found)).amax() < 1e-9);
    }
}
