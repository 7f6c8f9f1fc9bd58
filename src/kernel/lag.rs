//! Lines as a low-pass of first or second order changes them.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// Lines, of all readings one after the other, that are changed before they are added.
const CHUNK: usize = 256;

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
    let work = Lag {
        waves,
        frequency,
        cutoff,
        damping,
        out,
    };
    dispatch(InstructionSet::best(), work);
}

struct Lag<'a> {
    waves: &'a [f64],
    frequency: &'a [f64],
    cutoff: f64,
    damping: Option<f64>,
    out: &'a mut [f64],
}

impl Kernel for Lag<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let lines = self.frequency.len() / self.out.len().max(1);
        self.out.fill(0.0);
        let mut changed = [0.0; CHUNK];
        // The line of a reading that comes next.
        let (mut line, mut reading) = (0, 0);
        for start in (0..self.frequency.len()).step_by(CHUNK) {
            let frequency = &self.frequency[start..self.frequency.len().min(start + CHUNK)];
            let waves = &self.waves[2 * start..][..2 * frequency.len()];
            match self.damping {
                None => first_order(waves, frequency, self.cutoff, &mut changed),
                Some(damping) => second_order(waves, frequency, self.cutoff, damping, &mut changed),
            }
            for value in &changed[..frequency.len()] {
                self.out[reading] += value;
                line += 1;
                if line == lines {
                    (line, reading) = (0, reading + 1);
                }
            }
        }
    }
}

/// Real parts of waves times `-jw/(1 + jw)`.
#[inline(always)]
fn first_order(waves: &[f64], frequency: &[f64], cutoff: f64, out: &mut [f64; CHUNK]) {
    for k in 0..frequency.len() {
        let w = frequency[k] / cutoff;
        let square = w * w;
        out[k] = (waves[2 * k + 1] * w - waves[2 * k] * square) / (1.0 + square);
    }
}

/// Real parts of waves times `(w^2 - 2j zeta w)/(1 - w^2 + 2j zeta w)`.
#[inline(always)]
fn second_order(
    waves: &[f64],
    frequency: &[f64],
    cutoff: f64,
    damping: f64,
    out: &mut [f64; CHUNK],
) {
    for k in 0..frequency.len() {
        let w = frequency[k] / cutoff;
        let square = w * w;
        let w = 2.0 * damping * w;
        let lead = 1.0 - square - 4.0 * damping * damping;
        let free = 1.0 - square;
        out[k] = (waves[2 * k] * square * lead + waves[2 * k + 1] * w) / (free * free + w * w);
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

    #[test]
    fn readings_by_many_are_those_one_by_one() {
        let (lines, readings) = (3, 2 * CHUNK / 3 + 5);
        let wave = |k: usize| (k as f64 * 0.7).sin();
        let waves: Vec<f64> = (0..2 * lines * readings).map(wave).collect();
        let frequency: Vec<f64> = (0..lines * readings).map(|k| 9.0 * wave(k + 11)).collect();
        for damping in [None, Some(0.4)] {
            let mut out = vec![f64::NAN; readings];
            lagged(&waves, &frequency, 7.0, damping, &mut out);
            for (k, &found) in out.iter().enumerate() {
                let mut one = [f64::NAN];
                let (of_waves, of_frequency) = (2 * lines * k, lines * k);
                lagged(
                    &waves[of_waves..of_waves + 2 * lines],
                    &frequency[of_frequency..of_frequency + lines],
                    7.0,
                    damping,
                    &mut one,
                );
                assert!((found - one[0]).abs() < 1e-14, "{k}");
            }
        }
    }

    #[test]
    fn no_lines_are_not_changed() {
        let mut out = [f64::NAN; 3];
        lagged(&[], &[], 7.0, None, &mut out);
        assert_eq!(out, [0.0; 3]);
    }
}
