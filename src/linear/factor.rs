//! Columns under a noise, and targets fitted by them.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::Noise;
use super::products::{Order, Products};
use crate::lstsq::{Singular, cholesky, invert_upper, product, singular, triangle};
use crate::simd::{InstructionSet, Kernel, Lanes, MOST_LANES, dispatch};

/// Singular values below this share of the largest do not count.
const DISTINCT: f64 = 1e-7;

/// Condition up to which the triangle of the Gram matrix is as good as one of the columns: its
/// square costs half of the digits. Up to the smaller one a single pass leaves 1e-13.
const WELL: f64 = 1e4;
const VERY_WELL: f64 = 10.0;

/// Readings of which a residual is made at a time: they stay in the first cache.
const CHUNK: usize = 1024;

/// Columns `X` under a noise that `M` makes white: `Q = M X B` has orthonormal columns.
///
/// The columns themselves are given again with every question.
#[derive(Debug)]
pub struct Factor {
    noise: Arc<Noise>,
    back: DMatrix<f64>,
    /// Made when it is asked for, where coefficients are as good without.
    basis: OnceLock<DMatrix<f64>>,
    is_plain: bool,
}

/// A target fitted by columns.
#[derive(Clone, Debug)]
pub struct Fitted {
    /// Of the columns: of least norm in columns of length 1 where some are alike.
    pub coefficients: Vec<f64>,
    /// What is left, under the map.
    pub residual: Vec<f64>,
    /// Its sum of squares.
    pub squares: f64,
}

impl Factor {
    /// Of columns one after the other; None where a number is not finite.
    pub fn of(noise: Arc<Noise>, design: &[f64]) -> Option<Self> {
        let n = noise.readings();
        let p = design.len() / n.max(1);
        let mapped = if noise.has_effects() {
            Cow::Owned(noise.map(design))
        } else {
            Cow::Borrowed(design)
        };
        let filter = if noise.has_effects() {
            noise.white()
        } else {
            noise.correlated()
        };
        let mut gram = vec![0.0; p * p];
        let work = Products {
            noise: filter,
            x: (&mapped, p),
            order: Order::Columns,
            seen: (&[], 0),
            each: false,
            pairs: true,
            grams: &mut gram,
            moments: &mut [],
        };
        dispatch(InstructionSet::best(), work);
        let lengths: Vec<f64> = (0..p).map(|j| gram[j * p + j].sqrt()).collect();
        let unit = |i: usize, j: usize| gram[i.min(j) * p + i.max(j)] / (lengths[i] * lengths[j]);
        let unit = DMatrix::from_fn(p, p, unit);
        if let Some((mut back, condition)) = inverse_root(unit) {
            for (mut row, length) in back.row_iter_mut().zip(&lengths) {
                row.unscale_mut(*length);
            }
            if condition <= VERY_WELL {
                return Some(Self {
                    noise,
                    back,
                    basis: OnceLock::new(),
                    is_plain: true,
                });
            }
            if condition < WELL {
                return Self::made(noise, design, back);
            }
        }
        drop(mapped);
        let back = Self::singular(&noise, design, &lengths)?;
        Self::made(noise, design, back)
    }

    /// Of columns that are alike, or nearly: by the singular values of their triangle.
    fn singular(noise: &Noise, design: &[f64], lengths: &[f64]) -> Option<DMatrix<f64>> {
        let p = lengths.len();
        let mut x = DMatrix::from_vec(noise.readings(), p, noise.map(design));
        let lengths = lengths
            .iter()
            .map(|&length| if length > 0.0 { length } else { 1.0 });
        let lengths: Vec<f64> = lengths.collect();
        for (mut column, length) in x.column_iter_mut().zip(&lengths) {
            column.unscale_mut(*length);
        }
        if x.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let Singular { values, turns, .. } = singular(&triangle(x));
        let kept = values
            .iter()
            .filter(|&value| *value > DISTINCT * values[0])
            .count();
        let mut back = turns.columns(0, kept).into_owned();
        for (mut column, value) in back.column_iter_mut().zip(&values) {
            column.unscale_mut(*value);
        }
        for (mut row, length) in back.row_iter_mut().zip(&lengths) {
            row.unscale_mut(*length);
        }
        Some(back)
    }

    /// With a basis that is nearly orthonormal made so.
    fn made(noise: Arc<Noise>, design: &[f64], back: DMatrix<f64>) -> Option<Self> {
        let near = spanned(&noise, design, &back);
        let gram = product(near.transpose().as_view(), near.as_view());
        let (again, _) = inverse_root(gram).unwrap_or_default();
        if again.ncols() < back.ncols() {
            return None;
        }
        let basis = OnceLock::from(product(near.as_view(), again.as_view()));
        Some(Self {
            noise,
            back: back * again,
            basis,
            is_plain: false,
        })
    }

    /// The noise.
    pub fn noise(&self) -> &Arc<Noise> {
        &self.noise
    }

    /// `B`.
    pub fn back(&self) -> &DMatrix<f64> {
        &self.back
    }

    /// `Q`.
    pub fn basis(&self, design: &[f64]) -> &DMatrix<f64> {
        self.basis
            .get_or_init(|| spanned(&self.noise, design, &self.back))
    }

    /// Coefficients of the columns for a target.
    pub fn coefficients(&self, design: &[f64], target: &[f64]) -> DVector<f64> {
        let mapped = self.noise.map(target);
        if !self.is_plain {
            let mapped = DVector::from_vec(mapped);
            return &self.back * self.basis(design).tr_mul(&mapped);
        }
        let n = target.len();
        let mut seen = self.noise.map_back(&mapped);
        seen.resize(n + MOST_LANES, 0.0);
        let p = self.back.nrows();
        let (mut powers, mut moments) = (vec![0.0; p], vec![0.0; p]);
        let work = Products {
            noise: self.noise.white(),
            x: (design, p),
            order: Order::Columns,
            seen: (&seen, 1),
            each: false,
            pairs: false,
            grams: &mut powers,
            moments: &mut moments,
        };
        dispatch(InstructionSet::best(), work);
        &self.back * self.back.tr_mul(&DVector::from_vec(moments))
    }

    /// A target fitted by the columns.
    pub fn fitted(&self, design: &[f64], target: &[f64]) -> Fitted {
        let coefficients = self.coefficients(design, target);
        let left = left(design, coefficients.as_slice(), target);
        let residual = self.noise.map(&left);
        let squares = residual.iter().map(|r| r * r).sum::<f64>().max(1e-300);
        Fitted {
            coefficients: coefficients.as_slice().to_vec(),
            residual,
            squares,
        }
    }
}

/// What coefficients of columns leave of a target.
pub fn left(design: &[f64], coefficients: &[f64], target: &[f64]) -> Vec<f64> {
    let mut out = target.to_vec();
    let work = Left {
        design,
        coefficients,
        out: &mut out,
    };
    dispatch(InstructionSet::best(), work);
    out
}

struct Left<'a> {
    design: &'a [f64],
    coefficients: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Left<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let n = self.out.len();
        for start in (0..n).step_by(CHUNK) {
            let out = &mut self.out[start..n.min(start + CHUNK)];
            for j in 0..self.coefficients.len() {
                let (size, column) = (self.coefficients[j], &self.design[j * n + start..]);
                let column = &column[..out.len()];
                for i in 0..out.len() {
                    out[i] -= size * column[i];
                }
            }
        }
    }
}

/// `M X B`.
fn spanned(noise: &Noise, design: &[f64], back: &DMatrix<f64>) -> DMatrix<f64> {
    let mapped = noise.map(design);
    let mapped = DMatrixView::from_slice(&mapped, noise.readings(), back.nrows());
    product(mapped, back.as_view())
}

/// The upper triangle `B` with `B' G B` the unit matrix, and its norm; None where `G` is not
/// positive definite.
fn inverse_root(mut gram: DMatrix<f64>) -> Option<(DMatrix<f64>, f64)> {
    if gram.iter().any(|value| !value.is_finite()) {
        return None;
    }
    cholesky(gram.as_view_mut())?;
    let mut root = gram.lower_triangle().transpose();
    invert_upper(root.as_view_mut());
    let condition = root.norm();
    Some((root, condition))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::linear::RunEffect;

    const BOUNDS: [(usize, usize); 2] = [(0, 37), (37, 60)];
    const N: usize = 60;

    fn wave(i: usize, k: usize) -> f64 {
        ((2 * i * i + 3 * i * (k + 2)) as f64).sin()
    }

    fn noises() -> Vec<Arc<Noise>> {
        let shapes: Vec<f64> = (0..N).map(|i| wave(i, 20)).collect();
        let roots: Vec<f64> = (0..N).map(|i| 1.0 + 0.01 * i as f64).collect();
        let effect = [RunEffect {
            shapes: &shapes,
            ratio: 30.0,
        }];
        let made = |rho, roots, effects| {
            Arc::new(Noise::new(BOUNDS.to_vec(), rho, roots, effects).unwrap())
        };
        vec![
            made(0.0, None, &[]),
            made(0.6, Some(roots), &[]),
            made(0.4, None, &effect),
        ]
    }

    /// Columns of several lengths; with one that is nearly another, one that is, and one of zeros.
    fn designs() -> [(DMatrix<f64>, usize); 4] {
        let plain = DMatrix::from_fn(N, 5, |i, j| 10.0_f64.powi(j as i32 - 2) * wave(i, j));
        let with = |column: DVector<f64>| {
            let mut design = plain.clone().insert_column(2, 0.0);
            design.set_column(2, &column);
            design
        };
        let further = DVector::from_fn(N, |i, _| wave(i, 9));
        [
            (plain.clone(), 5),
            (with(plain.column(4) + 1e-2 * further), 6),
            (with(2.0 * plain.column(1) - plain.column(4)), 5),
            (with(DVector::zeros(N)), 5),
        ]
    }

    #[test]
    fn a_fit_is_that_of_the_mapped_columns_by_their_singular_values() {
        let y: Vec<f64> = (0..N).map(|i| wave(i, 30)).collect();
        for noise in noises() {
            for (design, rank) in designs() {
                let columns = design.as_slice();
                let factor = Factor::of(noise.clone(), columns).unwrap();
                let q = factor.basis(columns);
                assert_eq!(q.shape(), (N, rank));
                assert!((q.tr_mul(q) - DMatrix::identity(rank, rank)).amax() < 1e-12);
                let mapped = DMatrix::from_vec(N, design.ncols(), noise.map(columns));
                let lengths = mapped.column_iter().map(|c| c.norm());
                let lengths: Vec<f64> = lengths.map(|l| if l > 0.0 { l } else { 1.0 }).collect();
                let mut unit = mapped.clone();
                for (mut column, length) in unit.column_iter_mut().zip(&lengths) {
                    column.unscale_mut(*length);
                }
                let white = DVector::from_vec(noise.map(&y));
                let slow = unit.svd(true, true).solve(&white, 1e-7).unwrap();
                let found = factor.fitted(columns, &y);
                for (k, length) in lengths.iter().enumerate() {
                    let close = (found.coefficients[k] * length - slow[k]).abs();
                    assert!(close < 1e-9 * (1.0 + slow.amax()), "{close}");
                }
                let residual = white - mapped * DVector::from_vec(found.coefficients);
                for (r, expected) in found.residual.iter().zip(&residual) {
                    assert!((r - expected).abs() < 1e-9);
                }
                assert!((found.squares - residual.norm_squared()).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn no_columns_fit_nothing_and_what_is_not_finite_has_no_factor() {
        let noise = noises().remove(1);
        let y: Vec<f64> = (0..N).map(|i| wave(i, 30)).collect();
        let factor = Factor::of(noise.clone(), &[]).unwrap();
        let found = factor.fitted(&[], &y);
        assert!(found.coefficients.is_empty());
        assert_eq!(found.residual, noise.map(&y));
        assert!(Factor::of(noise, &[f64::NAN; N]).is_none());
    }
}
