//! Interpolation in Chebyshev's points: the zeros of `T_N` on -1 to 1.

use std::f64::consts::PI;

/// `cos(m pi / 2N)`: the zeros of T_N for odd m, and the values of T_j there.
fn cosine<const N: usize>(m: usize) -> f64 {
    (PI * m as f64 / (2 * N) as f64).cos()
}

/// The points.
pub fn points<const N: usize>() -> [f64; N] {
    std::array::from_fn(|i| cosine::<N>(2 * i + 1))
}

/// From values at the points to the Chebyshev coefficients of their polynomial.
pub fn transform<const N: usize>() -> [[f64; N]; N] {
    let n = N as f64;
    std::array::from_fn(|j| {
        let scale = if j == 0 { 1.0 / n } else { 2.0 / n };
        std::array::from_fn(|i| scale * cosine::<N>(j * (2 * i + 1)))
    })
}

/// A matrix times a vector.
pub fn apply<const N: usize>(matrix: &[[f64; N]; N], values: &[f64; N]) -> [f64; N] {
    matrix.map(|row| row.iter().zip(values).map(|(t, v)| t * v).sum())
}
