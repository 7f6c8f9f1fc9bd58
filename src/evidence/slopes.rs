//! Slopes of `log|C|` in the variances of the noise: the factorisation, differentiated forward.

use super::whitening::{Noise, TERMS, Terms, VARIANCES};
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};

/// `a_j tr(C^-1 K_j)`: slopes of `log|C|` in the logarithms of the variances.
pub(super) fn determinant_slopes(noise: Noise, decays: &[Terms]) -> [f64; VARIANCES] {
    let mut slopes = [0.0; TERMS];
    let slopes_of = &mut slopes;
    dispatch(
        InstructionSet::best(),
        Slopes {
            noise,
            decays,
            slopes: slopes_of,
        },
    );
    let mut out = [0.0; VARIANCES];
    // A common factor of all variances is to the power of the readings.
    out[0] = decays.len() as f64;
    for j in 0..TERMS {
        out[j + 1] = noise.terms[j] * slopes[j];
        out[0] -= out[j + 1];
    }
    out
}

/// The factorisation with its derivatives in every `a_l`, carried along.
struct Slopes<'a> {
    noise: Noise,
    decays: &'a [Terms],
    slopes: &'a mut Terms,
}

impl Kernel for Slopes<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let (a, total) = (self.noise.terms, self.noise.total());
        let mut s = [[0.0; TERMS]; TERMS];
        let mut ds = [[[0.0; TERMS]; TERMS]; TERMS];
        // `v` and its derivatives times the root of `d`, so that `d v v'` is a product of two.
        let (mut v, mut dv) = ([0.0; TERMS], [[0.0; TERMS]; TERMS]);
        let (mut d, mut dd) = (0.0, [0.0; TERMS]);
        for decay in self.decays {
            for j in 0..TERMS {
                for k in 0..TERMS {
                    let both = decay[j] * decay[k];
                    s[j][k] = (s[j][k] + d * (v[j] * v[k])) * both;
                    for l in 0..TERMS {
                        let own = d * (dv[j][l] * v[k] + v[j] * dv[k][l]);
                        ds[j][k][l] = (ds[j][k][l] + dd[l] * (v[j] * v[k]) + own) * both;
                    }
                }
            }
            let (mut known, mut slope) = ([0.0; TERMS], [[0.0; TERMS]; TERMS]);
            (d, dd) = (total, [1.0; TERMS]);
            for j in 0..TERMS {
                for k in 0..TERMS {
                    known[j] += s[j][k] * a[k];
                    for l in 0..TERMS {
                        slope[j][l] += ds[j][k][l] * a[k];
                    }
                }
                d -= a[j] * known[j];
                for l in 0..TERMS {
                    dd[l] -= a[j] * (slope[j][l] + s[j][l]);
                }
            }
            for l in 0..TERMS {
                dd[l] -= known[l];
                self.slopes[l] += dd[l] / d;
            }
            for j in 0..TERMS {
                v[j] = (1.0 - known[j]) / d;
                for l in 0..TERMS {
                    dv[j][l] = (-slope[j][l] - s[j][l] - v[j] * dd[l]) / d;
                }
            }
        }
    }
}
