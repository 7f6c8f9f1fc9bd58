//! Readings: both angles of a run, and the angle and error that sums are taken of.

use std::f64::consts::TAU;

use crate::angle::{Period, two_sum};
use crate::circle::whole_number;

/// Readings that a circular centre is taken from, at even strides.
const CENTRE_READINGS: usize = 1024;

/// An angle and an error each, or the two angles that the error is the difference of.
#[derive(Clone, Copy, Debug)]
pub struct Readings<'a> {
    /// What the harmonics are functions of.
    pub angle: &'a [f64],
    /// The error, or the indicated angle.
    pub error: &'a [f64],
    /// The reference angle to be subtracted from the indicated one.
    pub reference: Option<&'a [f64]>,
    /// Weights; all 1 when absent.
    pub weights: Option<&'a [f64]>,
}

impl Readings<'_> {
    /// Readings `start..end`.
    pub fn part(&self, start: usize, end: usize) -> Readings<'_> {
        Readings {
            angle: &self.angle[start..end],
            error: &self.error[start..end],
            reference: self.reference.map(|values| &values[start..end]),
            weights: self.weights.map(|values| &values[start..end]),
        }
    }

    /// The readings at some places.
    pub fn pick(&self, places: &[usize]) -> Picked {
        let pick = |values: &[f64]| places.iter().map(|&i| values[i]).collect();
        Picked {
            angle: pick(self.angle),
            error: pick(self.error),
            reference: self.reference.map(pick),
            weights: self.weights.map(pick),
        }
    }

    /// Weight of reading `i`.
    pub fn weight(&self, i: usize) -> f64 {
        self.weights.map_or(1.0, |weights| weights[i])
    }

    /// Readings that count.
    pub fn count(&self) -> usize {
        match self.weights {
            Some(weights) => weights.iter().filter(|w| **w > 0.0).count(),
            None => self.angle.len(),
        }
    }

    /// Angles of the readings that count.
    pub fn angles(&self) -> impl Iterator<Item = f64> {
        let counts = |(i, x): (usize, &f64)| (self.weight(i) > 0.0).then_some(*x);
        self.angle.iter().enumerate().filter_map(counts)
    }

    /// `error - centre` of reading `i` in `(-period/2, period/2]`.
    #[inline(always)]
    pub fn error(&self, i: usize, centre: f64, period: Period) -> f64 {
        // The rounding of the difference matters after many turns: it is carried along.
        let reference = self.reference.map_or(0.0, |values| values[i]);
        let (difference, carry) = two_sum(self.error[i], -reference);
        period.wrap(period.wrap(difference) + carry - centre)
    }

    /// Circular mean of the errors: no error is cut in two when wrapped around it.
    pub fn centre(&self, period: Period) -> f64 {
        // Any angle near the mean will do: what the differences lose of far turns is no matter.
        let per_turn = 1.0 / period.value();
        let stride = self.angle.len().div_ceil(CENTRE_READINGS).max(1);
        let (mut sine, mut cosine) = (0.0, 0.0);
        for i in (0..self.angle.len()).step_by(stride) {
            let reference = self.reference.map_or(0.0, |values| values[i]);
            let turns = (self.error[i] - reference) * per_turn;
            let (s, c) = (TAU * (turns - whole_number(turns))).sin_cos();
            sine += self.weight(i) * s;
            cosine += self.weight(i) * c;
        }
        sine.atan2(cosine) / TAU * period.value()
    }
}

/// Some readings, apart from those that they were picked from.
#[derive(Clone, Debug)]
pub struct Picked {
    angle: Vec<f64>,
    error: Vec<f64>,
    reference: Option<Vec<f64>>,
    weights: Option<Vec<f64>>,
}

impl Picked {
    /// As readings.
    pub fn readings(&self) -> Readings<'_> {
        Readings {
            angle: &self.angle,
            error: &self.error,
            reference: self.reference.as_deref(),
            weights: self.weights.as_deref(),
        }
    }
}

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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// The true angle: correcting solves `theta + error(theta) = indicated`.
    Reference,
    /// The encoder's own angle: correcting subtracts.
    Indicated,
}

impl Argument {
    /// Both, by their names.
    const NAMES: [(&str, Self); 2] = [
        ("reference", Self::Reference),
        ("indicated", Self::Indicated),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reference => "reference",
            Self::Indicated => "indicated",
        }
    }

    /// The one of a name.
    pub fn named(name: &str) -> Option<Self> {
        let found = Self::NAMES.iter().find(|(own, _)| *own == name);
        found.map(|&(_, argument)| argument)
    }
}

impl<'a> Run<'a> {
    /// Readings `start..end`.
    pub fn part(&self, start: usize, end: usize) -> Self {
        Self {
            reference: &self.reference[start..end],
            indicated: &self.indicated[start..end],
            weights: self.weights.map(|weights| &weights[start..end]),
        }
    }

    /// The run as harmonics of its argument.
    pub fn readings(&self, argument: Argument) -> Readings<'a> {
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
}
