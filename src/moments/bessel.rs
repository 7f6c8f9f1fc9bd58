//! `exp(i z u)` as a Chebyshev series (Jacobi and Anger).

/// Coefficients of `exp(i z u) = sum over j of i^j e_j T_j(u)`: `e_0 = J_0(z)`,
/// `e_j = 2 J_j(z)`, for `0 <= z <= 1`.
pub fn jacobi_anger<const TERMS: usize>(z: f64) -> [f64; TERMS] {
    let half = 0.5 * z;
    let mut leading = 1.0;
    std::array::from_fn(|j| {
        if j > 0 {
            leading *= half / j as f64;
        }
        let twice = if j == 0 { 1.0 } else { 2.0 };
        twice * leading * tail(half * half, j as f64)
    })
}

/// `sum over m of (-q)^m j! / (m! (m + j)!)`, for `q <= 1/4`.
fn tail(q: f64, j: f64) -> f64 {
    /// Terms after which the next is below `(1/4)^9 / (9!)^2 = 3e-17`.
    const TERMS: u32 = 9;
    (1..=TERMS).rev().fold(1.0, |sum, m| {
        let m = f64::from(m);
        1.0 - q / (m * (m + j)) * sum
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_sums_to_the_exponential() {
        /// Rounding of a dozen terms.
        const ROUNDING: f64 = 1e-15;
        for z in [0.0, 1e-9, 0.1, 0.5, 1.0] {
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
