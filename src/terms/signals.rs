//! What is known at a sample beside the indicated angle.

use crate::error::Error;

/// A quantity that terms may need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Direction of travel; its sign counts, 0 keeps the last one.
    Direction,
    /// Output velocity, angle units per second.
    Velocity,
    /// Degrees Celsius.
    Temperature,
    /// Newton metres at the output.
    Torque,
}

impl Signal {
    /// All of them, in the order of [`Signals`].
    pub const ALL: [Self; 4] = [
        Self::Direction,
        Self::Velocity,
        Self::Temperature,
        Self::Torque,
    ];

    /// The keyword argument of this signal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direction => "direction",
            Self::Velocity => "velocity",
            Self::Temperature => "temperature",
            Self::Torque => "torque",
        }
    }

    /// The column of a log that holds the signal called `name`.
    pub fn column(name: &str) -> &'static str {
        match name {
            "velocity" => "velocity_deg_s",
            "temperature" => "temperature_C",
            "torque" => "torque_Nm",
            _ => "direction or velocity_deg_s",
        }
    }
}

/// Signals of one sample; `None` is not given.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signals {
    /// Direction of travel.
    pub direction: Option<f64>,
    /// Angle units per second.
    pub velocity: Option<f64>,
    /// Degrees Celsius.
    pub temperature: Option<f64>,
    /// Newton metres.
    pub torque: Option<f64>,
}

impl Signals {
    /// The value of one signal.
    pub fn get(&self, signal: Signal) -> Option<f64> {
        match signal {
            Signal::Direction => self.direction,
            Signal::Velocity => self.velocity,
            Signal::Temperature => self.temperature,
            Signal::Torque => self.torque,
        }
    }
}

/// Signals of many samples: one value per sample, or one for all.
#[derive(Clone, Copy, Debug, Default)]
pub struct Columns<'a> {
    /// Direction of travel.
    pub direction: Option<&'a [f64]>,
    /// Angle units per second.
    pub velocity: Option<&'a [f64]>,
    /// Degrees Celsius.
    pub temperature: Option<&'a [f64]>,
    /// Newton metres.
    pub torque: Option<&'a [f64]>,
}

impl Columns<'_> {
    /// Refuses columns that are neither of length `len` nor 1.
    pub fn check(&self, len: usize) -> Result<(), Error> {
        for signal in Signal::ALL {
            match self.of(signal) {
                Some(values) if values.len() != len && values.len() != 1 => {
                    return Err(Error::Length {
                        what: signal.name(),
                        got: values.len(),
                        other: "angle",
                        wanted: len,
                    });
                }
                _ => {}
            }
        }
        Ok(())
    }

    /// The column of one signal.
    pub fn of(&self, signal: Signal) -> Option<&[f64]> {
        match signal {
            Signal::Direction => self.direction,
            Signal::Velocity => self.velocity,
            Signal::Temperature => self.temperature,
            Signal::Torque => self.torque,
        }
    }

    /// Signals of sample `i`.
    pub fn at(&self, i: usize) -> Signals {
        let one = |column: Option<&[f64]>| match column {
            Some([all]) => Some(*all),
            Some(values) => Some(values[i]),
            None => None,
        };
        Signals {
            direction: one(self.direction),
            velocity: one(self.velocity),
            temperature: one(self.temperature),
            torque: one(self.torque),
        }
    }
}
