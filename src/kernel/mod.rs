//! Evaluation and correction of many samples.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

mod batch;
mod chebyshev;
mod counts;
mod cubics;
mod evaluator;
mod exact;
mod expansion;
mod inverse;
pub(crate) mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
mod route;
mod segments;
mod sincos;
mod stretch;
mod sweep;
mod table;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use batch::{Batch, Real, Sample, Shared};
pub use cubics::Cubics;
pub use evaluator::{Evaluator, THREADED, TOLERANCE};
pub use lanes::InstructionSet;
pub use route::{Path, Route};
pub use stretch::Stretch;
pub use table::{Scalar, Table};

/// Which angle the series takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// The true angle: correcting solves `theta + error(theta) = indicated`.
    Reference,
    /// The encoder's angle: correcting subtracts.
    Indicated,
}

/// What to compute from each sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `error(x)`.
    Error,
    /// `d error / dx`.
    Slope,
    /// The true angle of an indicated one.
    Correction,
}
