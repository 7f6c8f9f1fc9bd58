//! Slopes of `log|C|` in the variances of the noise: the factorisation, differentiated backward.
//!
//! With `u = 1 - S a` and `d` of each reading ([`super::whitening`]), and a bar for the slope of
//! `log|C|` in what it is over, from the last reading to the first:
//!
//! ```text
//! Z_i = P (S-bar of the next) P,    u-bar = 2 Z u / d,    d-bar = (1 - u' Z u / d) / d
//! a-bar += -S u-bar - 2 d-bar S a,  t-bar += d-bar        (t = w + sum a)
//! S-bar = Z - (u-bar a' + a u-bar') / 2 - d-bar a a'
//! ```

use super::readings::CHUNK;
use super::whitening::{Factor, TERMS, Terms, VARIANCES};
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// A symmetric matrix of terms, all of it.
type Square = [Terms; TERMS];

/// `a_j tr(C^-1 K_j)`: slopes of `log|C|` in the logarithms of the variances.
pub(super) fn determinant_slopes(factor: &Factor) -> [f64; VARIANCES] {
    let mut slopes = [0.0; TERMS];
    let work = Slopes {
        factor,
        slopes: &mut slopes,
    };
    dispatch(InstructionSet::best(), work);
    let mut out = [0.0; VARIANCES];
    // A common factor of all variances is to the power of the readings.
    out[0] = factor.len() as f64;
    for j in 0..TERMS {
        out[j + 1] = factor.noise().terms[j] * slopes[j];
        out[0] -= out[j + 1];
    }
    out
}

struct Slopes<'a> {
    factor: &'a Factor<'a>,
    slopes: &'a mut Terms,
}

impl Kernel for Slopes<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (n, a) = (self.factor.len(), self.factor.noise().terms);
        // `S` before each chunk, from which the chunk's own are made again.
        let mut starts = Vec::with_capacity(n.div_ceil(CHUNK));
        let mut s = [[0.0; TERMS]; TERMS];
        for i in 0..n {
            if i % CHUNK == 0 {
                starts.push(s);
            }
            forward(self.factor, i, &mut s);
        }
        let mut bar: Square = [[0.0; TERMS]; TERMS];
        let (mut slopes, mut total) = ([0.0; TERMS], 0.0);
        let mut each = Vec::with_capacity(CHUNK);
        for (chunk, mut s) in starts.into_iter().enumerate().rev() {
            let start = chunk * CHUNK;
            each.clear();
            for i in start..n.min(start + CHUNK) {
                forward(self.factor, i, &mut s);
                each.push(s);
            }
            for (k, s) in each.iter().enumerate().rev() {
                let (gains, scale) = self.factor.step(start + k);
                // `g = u / root d`, `h = Z g`: `u-bar = 2 h / root d`, `u' Z u / d = g' h`.
                let mut h = [0.0; TERMS];
                let mut square = 0.0;
                for j in 0..TERMS {
                    for l in 0..TERMS {
                        h[j] += bar[j][l] * gains[l];
                    }
                    square += h[j] * gains[j];
                }
                let d_bar = (1.0 - square) * scale * scale;
                total += d_bar;
                // `S u-bar + 2 d-bar S a = 2 S (h / root d + d-bar a)`.
                let both: Terms = std::array::from_fn(|j| h[j] * scale + d_bar * a[j]);
                for j in 0..TERMS {
                    for l in 0..TERMS {
                        slopes[j] -= 2.0 * s[j][l] * both[l];
                    }
                }
                let decay = self.factor.decay(start + k);
                let cross: Terms = std::array::from_fn(|j| h[j] * scale + 0.5 * d_bar * a[j]);
                for j in 0..TERMS {
                    for l in 0..TERMS {
                        let taken = cross[j] * a[l] + a[j] * cross[l];
                        bar[j][l] = (bar[j][l] - taken) * (decay[j] * decay[l]);
                    }
                }
            }
        }
        for j in 0..TERMS {
            self.slopes[j] = slopes[j] + total;
        }
    }
}

/// `S` of a reading from that of the reading before.
#[inline(always)]
fn forward(factor: &Factor, i: usize, s: &mut Square) {
    let last = match i {
        0 => [0.0; TERMS],
        _ => factor.step(i - 1).0,
    };
    let decay = factor.decay(i);
    for j in 0..TERMS {
        for l in 0..TERMS {
            s[j][l] = (s[j][l] + last[j] * last[l]) * (decay[j] * decay[l]);
        }
    }
}
