//! The angle of two channels: an affine map to the unit circle, and its arc tangent.

use super::faults::OFF;
use crate::compensator::Compensator;
use crate::simd::{InstructionSet, Kernel, Lanes, dispatch};
use crate::{interrupt, threads};

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Readings that a thread takes at a time.
const PART: usize = 1 << 14;

/// Readings from which threads are worth starting.
const THREADED: usize = 1 << 16;

/// The tangent of an eighth of a turn's half: above it the argument is turned by `pi / 4`.
const TURNED: f64 = std::f64::consts::SQRT_2 - 1.0;

/// `atan(x) / x` as a polynomial in `x^2` up to [`TURNED`], interpolated at Chebyshev's points: off by
/// 4e-17 at most.
const ARC: [f64; 11] = [
    1.0,
    -0.333_333_333_333_284_4,
    0.199_999_999_988_551_1,
    -0.142_857_141_809_764_67,
    0.111_111_061_804_559_46,
    -0.090_907_730_748_084_14,
    0.076_899_534_963_068_57,
    -0.066_402_339_304_294_08,
    0.056_883_492_268_090_106,
    -0.043_480_522_157_164_63,
    0.021_135_373_157_693_246,
];

/// The affine map of two channels to the unit circle, and the unit of the angle.
///
/// `x = (cosine - offset_cosine) * per_cosine`, `y = (sine - offset_sine) * per_sine - x * slope`,
/// `angle = factor * atan2(y, x)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Middle of the cosine channel.
    pub offset_cosine: f64,
    /// Middle of the sine channel.
    pub offset_sine: f64,
    /// Inverse of the cosine's amplitude.
    pub per_cosine: f64,
    /// Inverse of the sine's amplitude along the sine.
    pub per_sine: f64,
    /// The part of the sine channel that follows the cosine, over that along the sine.
    pub slope: f64,
    /// Angle of a radian of the channels' phase; negative where that falls.
    pub factor: f64,
}

impl Angle {
    /// The angle of one reading; NaN where both channels are at their middle, or not finite.
    #[inline(always)]
    pub fn of(&self, sine: f64, cosine: f64) -> f64 {
        let x = (cosine - self.offset_cosine) * self.per_cosine;
        let y = (sine - self.offset_sine) * self.per_sine - x * self.slope;
        arc_tangent(y, x) * self.factor
    }

    /// The angles of many readings, the same to the last bit.
    pub fn all(&self, sine: &[f64], cosine: &[f64], out: &mut [f64]) {
        let count = if out.len() < THREADED {
            1
        } else {
            threads::available()
        };
        let set = InstructionSet::best();
        let parts: Vec<_> = out
            .chunks_mut(PART)
            .zip(sine.chunks(PART).zip(cosine.chunks(PART)))
            .map(|(out, (sine, cosine))| std::sync::Mutex::new((out, sine, cosine)))
            .collect();
        threads::for_each_part(parts.len(), count, |i| {
            let mut part = parts[i]
                .lock()
                .unwrap_or_else(std::sync::PoisonError::into_inner);
            let (out, sine, cosine) = &mut *part;
            let angle = self;
            dispatch(
                set,
                Angles {
                    angle,
                    sine,
                    cosine,
                    out,
                },
            );
            interrupt::point();
        });
    }
}

/// How readings of a log are off the circle that constants make of their ellipse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Off {
    /// Readings, those that are no numbers not counted.
    pub count: usize,
    /// Squares of the distances, in radii, and of those with sine and cosine exchanged.
    pub squares: [f64; 2],
    /// Sums of sine and cosine without their offsets, of their squares and of their product.
    pub sums: [f64; 5],
    /// Dropouts.
    pub far: usize,
    /// Place of the first dropout.
    pub first: Option<usize>,
}

impl Angle {
    /// Distances of readings to the circle, in radii.
    pub fn off(&self, sine: &[f64], cosine: &[f64]) -> Off {
        let mut found = Off::default();
        let distance = |s: f64, c: f64| {
            let x = (c - self.offset_cosine) * self.per_cosine;
            let y = (s - self.offset_sine) * self.per_sine - x * self.slope;
            x.hypot(y) - 1.0
        };
        for (i, (&s, &c)) in sine.iter().zip(cosine).enumerate() {
            let off = [distance(s, c), distance(c, s)];
            if !off[0].is_finite() {
                continue;
            }
            found.count += 1;
            for (sum, off) in found.squares.iter_mut().zip(off) {
                *sum += off * off;
            }
            let (y, x) = (s - self.offset_sine, c - self.offset_cosine);
            for (sum, product) in found.sums.iter_mut().zip([y, x, y * y, x * x, y * x]) {
                *sum += product;
            }
            if off[0].abs() > OFF {
                found.far += 1;
                found.first = found.first.or(Some(i));
            }
        }
        found
    }
}

struct Angles<'a> {
    angle: &'a Angle,
    sine: &'a [f64],
    cosine: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Angles<'_> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        // By value, and of one length: what is behind references is not known to stay, and the loop
        // would not become vectors.
        let (angle, n) = (*self.angle, self.out.len());
        let (sine, cosine) = (&self.sine[..n], &self.cosine[..n]);
        for i in 0..n {
            self.out[i] = angle.of(sine[i], cosine[i]);
        }
    }
}

/// `atan2(y, x)` without a branch, so that loops of it become vectors; off by 3e-16 at most.
///
/// NaN where both are zero, or one is not finite.
#[inline(always)]
fn arc_tangent(y: f64, x: f64) -> f64 {
    let (along, across) = (x.abs(), y.abs());
    let is_steep = across > along;
    let (most, least) = if is_steep {
        (across, along)
    } else {
        (along, across)
    };
    let is_turned = least > TURNED * most;
    let (over, under, base) = if is_turned {
        (least - most, least + most, FRAC_PI_4)
    } else {
        (least, most, 0.0)
    };
    let t = over / under;
    // Estrin's scheme: a single reading waits for the longest chain of operations.
    let w = t * t;
    let (w2, a) = (w * w, &ARC);
    let w4 = w2 * w2;
    let low = (a[0] + a[1] * w) + (a[2] + a[3] * w) * w2;
    let middle = (a[4] + a[5] * w) + (a[6] + a[7] * w) * w2;
    let high = (a[8] + a[9] * w) + a[10] * w2;
    let sum = low + (middle + high * w4) * w4;
    let octant = sum * t + base;
    let quadrant = if is_steep { FRAC_PI_2 - octant } else { octant };
    let half = if x < 0.0 { PI - quadrant } else { quadrant };
    half.copysign(y)
}

/// Two channels and the series of what is left, made ready for single samples.
#[derive(Clone, Debug)]
pub struct Decoder {
    /// The angle of the channels.
    pub angle: Angle,
    /// Its correction; None without harmonics.
    pub correction: Option<Compensator>,
}

impl Decoder {
    /// The corrected angle of one reading.
    #[inline]
    pub fn step(&self, sine: f64, cosine: f64) -> f64 {
        let angle = self.angle.of(sine, cosine);
        match &self.correction {
            Some(correction) => correction.step(angle),
            None => angle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_tangent_is_that_of_the_standard_library() {
        for i in 0..100_000 {
            let place = f64::from(i) * 0.000_062_9;
            let size = 10.0_f64.powi(i % 13 - 6);
            let (y, x) = (size * place.sin(), size * place.cos());
            assert!((arc_tangent(y, x) - y.atan2(x)).abs() < 4.5e-16, "{y} {x}");
        }
        assert_eq!(arc_tangent(0.0, -2.0), PI);
        assert_eq!(arc_tangent(3.0, 0.0), FRAC_PI_2);
        assert!(arc_tangent(0.0, 0.0).is_nan());
        assert!(arc_tangent(f64::NAN, 1.0).is_nan());
    }

    #[test]
    fn many_readings_are_each_to_the_last_bit() {
        let angle = Angle {
            offset_cosine: 0.3,
            offset_sine: -0.1,
            per_cosine: 1.25,
            per_sine: 0.75,
            slope: 0.1,
            factor: -57.3,
        };
        let sine: Vec<f64> = (0..70_001).map(|i| (f64::from(i) * 0.37).sin()).collect();
        let cosine: Vec<f64> = (0..70_001).map(|i| (f64::from(i) * 0.37).cos()).collect();
        let mut out = vec![0.0; sine.len()];
        angle.all(&sine, &cosine, &mut out);
        for i in 0..sine.len() {
            assert_eq!(out[i].to_bits(), angle.of(sine[i], cosine[i]).to_bits());
        }
    }
}
