//! What can be wrong with an argument: one variant per broken precondition.

use thiserror::Error;

use crate::terms::Signal;

/// A precondition that did not hold: which argument, what was got, what is wanted.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum Error {
    /// A turn must be a positive finite number.
    #[error(
        "period must be a positive finite number (2*pi, 360, 1 or the counts per turn; \
         1e-30 to 1e30), got {0}"
    )]
    Period(f64),

    /// A number that decides about work or memory is beyond what is done for anybody.
    #[error("{what} must be at most {most}, got {got}")]
    Limit {
        /// What is limited.
        what: String,
        /// The limit.
        most: f64,
        /// The offending number.
        got: f64,
    },

    /// There is no memory for what was asked.
    #[error("not enough memory: {bytes} bytes are needed at once")]
    Memory {
        /// What was asked of the system.
        bytes: usize,
    },

    /// A number that must be finite was not.
    #[error("{what}[{index}] must be finite, got {got}")]
    NotFinite {
        /// The argument's name.
        what: &'static str,
        /// Its first offending element.
        index: usize,
        /// The offending value.
        got: f64,
    },

    /// Two arguments that belong together differ in length.
    #[error("{what} has {got} elements, {other} has {wanted}: they must be equally long")]
    Length {
        /// The argument's name.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The argument it belongs to.
        other: &'static str,
        /// The length wanted.
        wanted: usize,
    },

    /// No run, or one without a reading.
    #[error("at least 1 run is required, and each must have at least 1 reading")]
    NoReadings,

    /// What is wrong with one of several runs.
    #[error("runs[{run}]: {cause}")]
    InRun {
        /// Its place.
        run: usize,
        /// What is wrong.
        cause: Box<Error>,
    },

    /// Times of a run decrease, or all are the same.
    #[error(
        "time[{index}] must not be smaller than the one before, and the times of a run must \
         differ: got {got} after {previous}; pass no time for equally spaced readings"
    )]
    Time {
        /// The reading at fault.
        index: usize,
        /// Its time.
        got: f64,
        /// The time before.
        previous: f64,
    },

    /// Shaft speeds are positive finite cycles per output turn.
    #[error(
        "cycles_per_turn of shaft {shaft} must be positive and finite (1e-9 to 1e9), got {got}"
    )]
    Cycles {
        /// Index of the shaft.
        shaft: usize,
        /// The offending value.
        got: f64,
    },

    /// Orders are whole numbers from 1, strictly increasing within a shaft.
    #[error(
        "orders of shaft {shaft} must be whole numbers from 1 in increasing order, got {previous} before {got}"
    )]
    Orders {
        /// Index of the shaft.
        shaft: usize,
        /// The order before (0 at the start).
        previous: u32,
        /// The offending order.
        got: u32,
    },

    /// Orders are positive and finite, in increasing order.
    #[error(
        "orders must be positive, finite and in increasing order, got orders[{index}] = {got} after {previous}"
    )]
    OrderValue {
        /// Its position.
        index: usize,
        /// The order before (0 at the start).
        previous: f64,
        /// The offending order.
        got: f64,
    },

    /// A weight or a penalty is negative or not finite.
    #[error("{what}[{index}] must be finite and not negative, got {got}")]
    Weight {
        /// The argument's name.
        what: &'static str,
        /// Its position.
        index: usize,
        /// The offending value.
        got: f64,
    },

    /// A method that cannot solve this problem was asked for.
    #[error(
        "this problem cannot be solved by the method asked for: \"moments\" and \"qr\" need \
         orders of shafts that come back to their start together, and readings that are not \
         too ill-conditioned for the method; \"counts\" needs an argument of whole numbers, at \
         most 131072 to a turn and eight readings to each; use method \"plain\", or none to \
         have one chosen"
    )]
    Method,

    /// The readings cannot tell these unknowns apart.
    #[error("{reason}")]
    Rank {
        /// Numerical rank of the design.
        rank: usize,
        /// Unknowns asked for.
        unknowns: usize,
        /// `(shaft, order)` at fault.
        orders: Vec<(usize, u32)>,
        /// Why, and what to do, in a sentence.
        reason: String,
    },

    /// `indicated = theta + error(theta)` cannot be inverted.
    #[error(
        "the error's slope reaches {slope:.6}: at 1 or more one indicated angle has several true angles and cannot be corrected"
    )]
    NotInvertible {
        /// A bound of `|d error / d angle|` that the model may reach.
        slope: f64,
    },

    /// A tolerance beyond what doubles, or anybody, can use.
    #[error("tolerance must be from 2e-15 to 1e-2 of the sum of amplitudes, got {0}")]
    Tolerance(f64),

    /// A path of evaluation that is not there.
    #[error("path {path:?} cannot be taken: {reason}")]
    Path {
        /// As asked for.
        path: String,
        /// Why not.
        reason: &'static str,
    },

    /// Accumulators over different series cannot be merged.
    #[error("cannot merge moments of different {0}")]
    Merge(&'static str),

    /// A term of the correction lacks a signal.
    #[error(
        "the model's term '{term}' needs {name}, which was not given: pass {name}=, in a log the column {column}",
        name = signal.name(),
        column = signal.column()
    )]
    MissingSignal {
        /// Which.
        signal: Signal,
        /// What the term is called.
        term: String,
    },
}
