//! Standard deviation of a fitted series at any angle, from the covariance of its coefficients.

use crate::check::same_length;
use crate::design::Design;
use crate::error::Error;
use crate::kernel::{Batch, Shared};
use crate::threads;

/// Angles that a thread takes at a time.
const PART: usize = 1024;

/// Products summed side by side: one need not wait for the one before.
const LANES: usize = 8;

/// `sqrt(g' C g)` at every angle, `g = [1, cos, sin, ...]` and `C` the covariance, row by
/// row; NaN where the angle is no number. Memory is that of a row to a thread.
pub fn band(
    design: &Design,
    covariance: &[f64],
    angles: &[f64],
    threads: usize,
    out: &mut [f64],
) -> Result<(), Error> {
    let size = 1 + design.columns();
    same_length(
        "covariance",
        covariance.len(),
        "(1 + coefficients)^2",
        size * size,
    )?;
    let len = angles.len();
    let batch = Shared::new(Batch::apart(angles, out)?);
    threads::for_each_part(len.div_ceil(PART), threads, |i| {
        let start = i * PART;
        // SAFETY: parts lie within the batch, and each is handed out once.
        let mut part = unsafe { batch.get().part(start, PART.min(len - start)) };
        let mut row = Vec::with_capacity(size);
        part.map(|x| deviation(design, covariance, x, &mut row));
    });
    Ok(())
}

fn deviation(design: &Design, covariance: &[f64], x: f64, row: &mut Vec<f64>) -> f64 {
    row.clear();
    row.push(1.0);
    design.extend_row(row, x, 1.0);
    let lines = covariance.chunks_exact(row.len());
    let variance: f64 = row
        .iter()
        .zip(lines)
        .map(|(g, line)| g * dot(line, row))
        .sum();
    // Rounding may leave less than nothing of what cancels.
    if variance < 0.0 { 0.0 } else { variance.sqrt() }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    for (a, b) in a.iter().zip(b) {
        for i in 0..LANES {
            sums[i] += a[i] * b[i];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::design::Frequencies;

    #[test]
    fn the_band_is_the_root_of_the_quadratic_form() {
        let shafts = vec![Frequencies {
            cycles: 1.0,
            orders: vec![1, 7],
        }];
        let design = Design::new(360.0, shafts).unwrap();
        // A factor's product with itself: positive definite, nothing alike in it.
        let factor = |i: usize, j: usize| ((3 * i + 5 * j) as f64).sin();
        let entry = |i: usize, j: usize| (0..5).map(|k| factor(i, k) * factor(j, k)).sum::<f64>();
        let covariance: Vec<f64> = (0..25).map(|i| entry(i / 5, i % 5)).collect();
        let angles: Vec<f64> = (0..3000).map(|i| 0.37 * f64::from(i)).collect();
        let mut out = vec![0.0; angles.len()];
        band(&design, &covariance, &angles, 2, &mut out).unwrap();
        for (&x, &found) in angles.iter().zip(&out) {
            let (s1, c1) = x.to_radians().sin_cos();
            let (s7, c7) = (7.0 * x).to_radians().sin_cos();
            let g = [1.0, c1, s1, c7, s7];
            let squares = (0..5).map(|k| (0..5).map(|i| g[i] * factor(i, k)).sum::<f64>().powi(2));
            let wanted = squares.sum::<f64>().sqrt();
            assert!((found - wanted).abs() < 1e-9, "{x}: {found} {wanted}");
        }
        assert!(band(&design, &covariance[1..], &angles, 1, &mut out).is_err());
        band(&design, &[0.0; 25], &[f64::NAN], 1, &mut out[..1]).unwrap();
        assert!(out[0].is_nan());
    }
}
