//! One run of readings.

use crate::moments::readings::Readings;

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
