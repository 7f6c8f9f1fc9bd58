//! Interpolation in Chebyshev's points, the zeros of `T_N` on -1 to 1, and the series of
//! `exp(i z u)` (Jacobi and Anger).

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

/// `J_0(z)..J_(N-1)(z)` for `0 <= z <= pi/2`, by the power series (DLMF 10.2.2).
pub fn bessel<const N: usize>(z: f64) -> [f64; N] {
    let half = 0.5 * z;
    let mut leading = 1.0;
    std::array::from_fn(|j| {
        if j > 0 {
            leading *= half / j as f64;
        }
        leading * tail(half * half, j as f64)
    })
}

/// `sum over m of (-q)^m j! / (m! (m + j)!)`, for `q <= (pi/4)^2`.
fn tail(q: f64, j: f64) -> f64 {
    /// Terms after which the next is below `0.62^11 / (11!)^2 = 3e-18`.
    const TERMS: u32 = 11;
    (1..=TERMS).rev().fold(1.0, |sum, m| {
        let m = f64::from(m);
        1.0 - q / (m * (m + j)) * sum
    })
}

/// Coefficients of `exp(i z u) = sum over j of i^j e_j T_j(u)`: `e_0 = J_0(z)`,
/// `e_j = 2 J_j(z)`.
pub fn jacobi_anger<const N: usize>(z: f64) -> [f64; N] {
    let mut terms = bessel(z);
    terms.iter_mut().skip(1).for_each(|term| *term *= 2.0);
    terms
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_sums_to_the_exponential() {
        /// Rounding of a dozen terms.
        const ROUNDING: f64 = 1e-15;
        for z in [0.0, 1e-9, 0.1, 0.5, 1.0, 1.57] {
            let terms: [f64; 24] = jacobi_anger(z);
            for angle in [0.0f64, 0.3, 1.2, 2.0, 3.1] {
                let (mut real, mut imaginary) = (0.0, 0.0);
                for (j, term) in terms.iter().enumerate() {
                    let value = term * (j as f64 * angle).cos();
                    match j % 4 {
                        0 => real += value,
                        1 => imaginary += value,
                        2 => real -= value,
                        _ => imaginary -= value,
                    }
                }
                let (sine, cosine) = (z * angle.cos()).sin_cos();
                assert!((real - cosine).abs() < ROUNDING, "z = {z}");
                assert!((imaginary - sine).abs() < ROUNDING, "z = {z}");
            }
        }
    }
}
