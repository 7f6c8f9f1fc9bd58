//! One run of readings.

use crate::angle::{Period, two_sum};
use crate::moments::kernel::Readings;

/// Readings that a run's circular centre is taken from, at even strides.
const CENTRE_READINGS: usize = 4096;

/// Readings of one run, in any one unit.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// True output angles.
    pub reference: &'a [f64],
    /// What the joint's own encoder says.
    pub indicated: &'a [f64],
    /// Reciprocal variances up to a factor; a reading of weight 0 does not count.
    pub weights: Option<&'a [f64]>,
}

/// Which angle the harmonics are functions of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Argument {
    /// The true angle.
    Reference,
    /// The indicated angle.
    Indicated,
}

impl<'a> Run<'a> {
    /// As the moments take them.
    pub(super) fn readings(&self, argument: Argument) -> Readings<'a> {
        Readings {
            angle: match argument {
                Argument::Reference => self.reference,
                Argument::Indicated => self.indicated,
            },
            error: self.indicated,
            reference: Some(self.reference),
            weights: self.weights,
        }
    }

    pub(super) fn weight(&self, i: usize) -> f64 {
        self.weights.map_or(1.0, |weights| weights[i])
    }

    /// Readings that count.
    pub(super) fn count(&self) -> usize {
        match self.weights {
            Some(weights) => weights.iter().filter(|w| **w > 0.0).count(),
            None => self.reference.len(),
        }
    }

    /// Regressor angles of the readings that count.
    pub(super) fn angles(&self, argument: Argument) -> impl Iterator<Item = f64> {
        let counts = |(i, x): (usize, &f64)| (self.weight(i) > 0.0).then_some(*x);
        let angles = self.readings(argument).angle;
        angles.iter().enumerate().filter_map(counts)
    }

    /// `indicated - reference - centre` in `(-period/2, period/2]`.
    pub(super) fn error(&self, i: usize, centre: f64, period: Period) -> f64 {
        // The rounding of the difference matters after many turns: it is carried along.
        let (difference, carry) = two_sum(self.indicated[i], -self.reference[i]);
        period.wrap(period.wrap(difference) + carry - centre)
    }

    /// Circular mean of the errors: no error is cut in two when wrapped around it.
    pub(super) fn centre(&self, period: Period) -> f64 {
        let turn = std::f64::consts::TAU / period.value();
        let stride = self.reference.len().div_ceil(CENTRE_READINGS).max(1);
        let (mut sine, mut cosine) = (0.0, 0.0);
        for i in (0..self.reference.len()).step_by(stride) {
            let (s, c) = (turn * self.error(i, 0.0, period)).sin_cos();
            sine += self.weight(i) * s;
            cosine += self.weight(i) * c;
        }
        sine.atan2(cosine) / turn
    }
}
