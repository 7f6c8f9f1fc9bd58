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
    /// Amperes of the motor.
    Current,
    /// Angles of other joints, in the unit of this one: which they are is the caller's.
    Other1,
    /// Likewise.
    Other2,
    /// Likewise.
    Other3,
    /// Likewise.
    Other4,
}

impl Signal {
    /// How many there are.
    pub const COUNT: usize = 9;

    /// All of them, in the order of [`BySignal`].
    pub const ALL: [Self; Self::COUNT] = [
        Self::Direction,
        Self::Velocity,
        Self::Temperature,
        Self::Torque,
        Self::Current,
        Self::Other1,
        Self::Other2,
        Self::Other3,
        Self::Other4,
    ];

    /// Those with a keyword argument of their own.
    pub const NAMED: &'static [Self] = Self::ALL.split_at(5).0;

    /// Those whose names their terms bring.
    pub const OTHERS: &'static [Self] = Self::ALL.split_at(5).1;

    /// The keyword argument of this signal.
    pub fn name(self) -> &'static str {
        match self {
            Self::Direction => "direction",
            Self::Velocity => "velocity",
            Self::Temperature => "temperature",
            Self::Torque => "torque",
            Self::Current => "current",
            Self::Other1 | Self::Other2 | Self::Other3 | Self::Other4 => {
                "the angle of another joint"
            }
        }
    }

    /// The signal of a keyword argument.
    pub fn named(name: &str) -> Option<Self> {
        let named = Self::NAMED.iter().copied();
        named.into_iter().find(|signal| signal.name() == name)
    }

    /// The column of a log that holds this signal.
    pub fn column(self) -> &'static str {
        match self {
            Self::Direction => "direction or velocity_deg_s",
            Self::Velocity => "velocity_deg_s",
            Self::Temperature => "temperature_C",
            Self::Torque => "torque_Nm",
            Self::Current => "current_A",
            Self::Other1 | Self::Other2 | Self::Other3 | Self::Other4 => "that holds it",
        }
    }
}

/// A value for each signal that is given.
#[derive(Clone, Copy, Debug)]
pub struct BySignal<T>([Option<T>; Signal::COUNT]);

/// Signals of one sample.
pub type Signals = BySignal<f64>;

/// Signals of many samples: one value per sample, or one for all.
pub type Columns<'a> = BySignal<&'a [f64]>;

impl<T> Default for BySignal<T> {
    fn default() -> Self {
        Self([const { None }; Signal::COUNT])
    }
}

impl<T: Copy> BySignal<T> {
    /// The value of one signal.
    #[inline]
    pub fn get(&self, signal: Signal) -> Option<T> {
        self.0[signal as usize]
    }

    /// The same with one signal given, or not given.
    #[must_use]
    pub fn with(mut self, signal: Signal, value: impl Into<Option<T>>) -> Self {
        self.0[signal as usize] = value.into();
        self
    }
}

impl Signals {
    /// All of them.
    pub(super) fn of(values: [f64; Signal::COUNT]) -> Self {
        Self(values.map(Some))
    }
}

impl Columns<'_> {
    /// Refuses columns that are neither of length `len` nor 1.
    pub fn check(&self, len: usize) -> Result<(), Error> {
        for signal in Signal::ALL {
            match self.get(signal) {
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

    /// Signals of sample `i`.
    pub fn at(&self, i: usize) -> Signals {
        BySignal(self.0.map(|column| match column {
            Some([all]) => Some(*all),
            Some(values) => Some(values[i]),
            None => None,
        }))
    }
}
