//! Factors and the triangular inverse by halves and panels: products of matrices do the work,
//! and between two of them it may be called off.

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut};

use super::householder;
use crate::interrupt;

/// Size up to which a factorisation is done column by column; larger ones are halved, so
/// that nearly all of the work is in matrix products.
const UNBLOCKED: usize = 48;

/// Columns that are reflected together, where there are more than `WHOLE`.
const PANEL: usize = 64;
const WHOLE: usize = 256;

/// Columns of a product between two points where the work may stop: 0.1 s of the largest.
const COLUMNS: usize = 32;

/// `out += factor a b`, a few columns at a time where it takes long.
fn add_product(
    mut out: DMatrixViewMut<f64>,
    factor: f64,
    a: DMatrixView<f64>,
    b: DMatrixView<f64>,
) {
    let n = out.ncols();
    if n <= WHOLE {
        out.gemm(factor, &a, &b, 1.0);
        return;
    }
    for start in (0..n).step_by(COLUMNS) {
        interrupt::point();
        let width = COLUMNS.min(n - start);
        out.columns_mut(start, width)
            .gemm(factor, &a, &b.columns(start, width), 1.0);
    }
}

/// `a b`.
pub fn product(a: DMatrixView<f64>, b: DMatrixView<f64>) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(a.nrows(), b.ncols());
    add_product(out.as_view_mut(), 1.0, a, b);
    out
}

/// The upper triangle of the QR factorisation of rows, its diagonal not negative.
pub fn triangle(mut rows: DMatrix<f64>) -> DMatrix<f64> {
    let (height, columns) = rows.shape();
    if columns <= WHOLE {
        return householder::triangle(&rows);
    }
    let last = height.min(columns);
    for start in (0..last).step_by(PANEL) {
        interrupt::point();
        let width = PANEL.min(last - start);
        let panel = rows.view((start, start), (height - start, width));
        let panel = panel.into_owned().qr();
        let next = start + width;
        for from in (next..columns).step_by(PANEL) {
            interrupt::point();
            let some = PANEL.min(columns - from);
            panel.q_tr_mul(&mut rows.view_mut((start, from), (height - start, some)));
        }
        let mut own = rows.view_mut((start, start), (height - start, width));
        own.fill(0.0);
        let upper = panel.unpack_r();
        own.rows_mut(0, upper.nrows()).copy_from(&upper);
    }
    rows.resize_vertically(last, 0.0)
}

/// Lower Cholesky factor in place of the lower half; None when not positive definite to
/// working precision.
pub fn cholesky(a: DMatrixViewMut<f64>) -> Option<()> {
    let greatest = a.diagonal().iter().fold(0.0, |m: f64, d| m.max(*d));
    // What is left of a dependent column is the rounding of its length.
    let least = greatest * f64::EPSILON * a.ncols() as f64;
    factor(a, least)
}

fn factor(mut a: DMatrixViewMut<f64>, least: f64) -> Option<()> {
    let n = a.ncols();
    if n <= UNBLOCKED {
        for j in 0..n {
            let before = a.view((j, 0), (1, j)).norm_squared();
            let rest = a[(j, j)] - before;
            if rest.is_nan() || rest <= least {
                return None;
            }
            let pivot = rest.sqrt();
            a[(j, j)] = pivot;
            for i in j + 1..n {
                let before = a.view((i, 0), (1, j)).dot(&a.view((j, 0), (1, j)));
                a[(i, j)] = (a[(i, j)] - before) / pivot;
            }
        }
        return Some(());
    }
    let half = n / 2;
    factor(a.view_mut((0, 0), (half, half)), least)?;
    let upper_left = a.view((0, 0), (half, half)).into_owned();
    let mut below = a.view((half, 0), (n - half, half)).into_owned();
    divide_by_transpose(below.as_view_mut(), upper_left.as_view());
    let mut rest = a.view_mut((half, half), (n - half, n - half));
    add_product(
        rest.as_view_mut(),
        -1.0,
        below.as_view(),
        below.transpose().as_view(),
    );
    a.view_mut((half, 0), (n - half, half)).copy_from(&below);
    factor(a.view_mut((half, half), (n - half, n - half)), least)
}

/// `B L'^-1` in place of `B`, `L` lower triangular.
fn divide_by_transpose(mut b: DMatrixViewMut<f64>, l: DMatrixView<f64>) {
    let n = l.ncols();
    if n <= UNBLOCKED {
        for j in 0..n {
            for k in 0..j {
                let factor = l[(j, k)];
                let (before, mut own) = b.columns_range_pair_mut(k, j);
                own.axpy(-factor, &before, 1.0);
            }
            b.column_mut(j).unscale_mut(l[(j, j)]);
        }
        return;
    }
    let half = n / 2;
    let (mut left, mut right) = b.columns_range_pair_mut(..half, half..);
    divide_by_transpose(left.as_view_mut(), l.view((0, 0), (half, half)));
    let below = l.view((half, 0), (n - half, half));
    let below = below.transpose();
    add_product(right.as_view_mut(), -1.0, left.as_view(), below.as_view());
    divide_by_transpose(right, l.view((half, half), (n - half, n - half)));
}

/// Inverse of an upper triangle in its place; infinite where it is singular.
pub fn invert_upper(mut r: DMatrixViewMut<f64>) {
    let n = r.ncols();
    if n <= UNBLOCKED {
        for j in 0..n {
            let pivot = 1.0 / r[(j, j)];
            // The columns before are those of the inverse already.
            for k in 0..j {
                let (before, mut own) = r.columns_range_pair_mut(k, j);
                let share = own[k];
                own.rows_mut(0, k).axpy(share, &before.rows(0, k), 1.0);
                own[k] = share * before[k];
            }
            r.view_mut((0, j), (j, 1)).scale_mut(-pivot);
            r[(j, j)] = pivot;
        }
        return;
    }
    let half = n / 2;
    invert_upper(r.view_mut((0, 0), (half, half)));
    invert_upper(r.view_mut((half, half), (n - half, n - half)));
    let rest = n - half;
    let across = product(
        r.view((0, 0), (half, half)),
        r.view((0, half), (half, rest)),
    );
    let across = product(across.as_view(), r.view((half, half), (rest, rest)));
    r.view_mut((0, half), (half, rest)).copy_from(&(-across));
}

/// `U U'` of an upper triangle.
pub fn times_transpose(u: DMatrixView<f64>, mut out: DMatrixViewMut<f64>) {
    let n = u.ncols();
    if n <= UNBLOCKED {
        out.gemm(1.0, &u, &u.transpose(), 0.0);
        return;
    }
    let half = n / 2;
    let rest = n - half;
    let corner = u.view((0, half), (half, rest));
    let last = u.view((half, half), (rest, rest));
    times_transpose(
        u.view((0, 0), (half, half)),
        out.view_mut((0, 0), (half, half)),
    );
    let mut first = out.view_mut((0, 0), (half, half));
    let turned = corner.transpose();
    add_product(first.as_view_mut(), 1.0, corner, turned.as_view());
    let aside = product(corner, last.transpose().as_view());
    out.view_mut((0, half), (half, rest)).copy_from(&aside);
    out.view_mut((half, 0), (rest, half))
        .copy_from(&aside.transpose());
    times_transpose(last, out.view_mut((half, half), (rest, rest)));
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    /// Of elements of order 1 in sums of 200.
    const ROUNDING: f64 = 1e-12;

    /// Upper triangle with a heavy diagonal, larger than one block.
    fn upper() -> DMatrix<f64> {
        let n = 4 * UNBLOCKED + 7;
        DMatrix::from_fn(n, n, |i, j| match i.cmp(&j) {
            std::cmp::Ordering::Less => ((3 * i + 7 * j) as f64).sin() / n as f64,
            std::cmp::Ordering::Equal => 1.0 + (i as f64).cos().powi(2),
            std::cmp::Ordering::Greater => 0.0,
        })
    }

    #[test]
    fn factor_inverse_and_product_meet_their_definitions() {
        let u = upper();
        let n = u.ncols();
        let mut gram = u.tr_mul(&u);
        cholesky(gram.as_view_mut()).unwrap();
        let found = gram.lower_triangle().transpose();
        assert!((&found - &u).amax() < ROUNDING);

        let mut inverse = u.clone();
        invert_upper(inverse.as_view_mut());
        assert!((&inverse * &u - DMatrix::identity(n, n)).amax() < ROUNDING);

        let mut square = DMatrix::zeros(n, n);
        times_transpose(u.as_view(), square.as_view_mut());
        assert!((square - &u * u.transpose()).amax() < ROUNDING);
    }

    #[test]
    fn panels_give_the_triangle_of_the_whole() {
        for (height, columns) in [(700, WHOLE + 41), (WHOLE + 3, WHOLE + 200)] {
            let rows = DMatrix::from_fn(height, columns, |i, j| {
                ((3 * i + 7 * j) as f64).sin() + f64::from(u8::from(i == j))
            });
            let found = triangle(rows.clone());
            let whole = rows.qr().unpack_r();
            assert_eq!(found.shape(), whole.shape());
            assert!((found - &whole).amax() < ROUNDING * whole.amax());
        }
    }

    #[test]
    fn large_products_are_those_of_small_ones() {
        let a = DMatrix::from_fn(90, 70, |i, j| ((i + 5 * j) as f64).cos());
        let b = DMatrix::from_fn(70, 2 * WHOLE + 5, |i, j| ((2 * i + j) as f64).sin());
        assert!((product(a.as_view(), b.as_view()) - &a * &b).amax() < ROUNDING);
    }

    #[test]
    fn indefinite_matrices_have_no_factor() {
        let u = upper();
        let mut gram = u.tr_mul(&u);
        let last = gram.ncols() - 1;
        gram[(last, last)] -= u[(last, last)].powi(2);
        assert!(cholesky(gram.as_view_mut()).is_none());
    }
}
