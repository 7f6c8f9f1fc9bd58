//! Lines as a low-pass of first or second order changes them.

/// Change of a reading's lines by a low-pass of a cutoff, without a damping of first order.
///
/// `waves` are the real and imaginary parts of each line at each reading, one reading after the
/// other, and `frequency` what each line is at there; `out` has a place for every reading.
pub fn lagged(
    waves: &[f64],
    frequency: &[f64],
    cutoff: f64,
    damping: Option<f64>,
    out: &mut [f64],
) {
    let lines = frequency.len() / out.len().max(1);
    let rows = waves
        .chunks_exact(2 * lines.max(1))
        .zip(frequency.chunks_exact(lines.max(1)));
    for (sum, (waves, frequency)) in out.iter_mut().zip(rows) {
        *sum = 0.0;
        for (wave, f) in waves.chunks_exact(2).zip(frequency) {
            let w = f / cutoff;
            let square = w * w;
            // Real parts alone: of -jw/(1 + jw), and of (w^2 - 2j zeta w)/(1 - w^2 + 2j zeta w).
            *sum += match damping {
                None => (wave[1] * w - wave[0] * square) / (1.0 + square),
                Some(damping) => {
                    let w = 2.0 * damping * w;
                    let lead = 1.0 - square - 4.0 * damping * damping;
                    let free = 1.0 - square;
                    (wave[0] * square * lead + wave[1] * w) / (free * free + w * w)
                }
            };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A product of complex numbers.
    fn times(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
        [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]]
    }

    #[test]
    fn a_line_is_changed_by_the_answer_of_the_filter_less_one() {
        let (cutoff, frequency) = (7.0, [3.0, -40.0, 0.5, 11.0]);
        let waves = [0.3, -1.2, 2.0, 0.4, -0.7, 0.1, 1.0, 1.0];
        for damping in [None, Some(0.4), Some(1.1)] {
            let mut out = [0.0; 2];
            lagged(&waves, &frequency, cutoff, damping, &mut out);
            for reading in 0..2 {
                let parts = (2 * reading..2 * reading + 2).map(|k| {
                    let w = frequency[k] / cutoff;
                    let below = match damping {
                        None => [1.0, w],
                        Some(d) => [1.0 - w * w, 2.0 * d * w],
                    };
                    let size = below[0] * below[0] + below[1] * below[1];
                    let gain = [below[0] / size - 1.0, -below[1] / size];
                    times(gain, [waves[2 * k], waves[2 * k + 1]])[0]
                });
                // Two roundings of numbers up to 2.
                assert!((out[reading] - parts.sum::<f64>()).abs() < 1e-14);
            }
        }
    }
}
