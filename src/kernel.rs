//! Evaluation and correction of many samples.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

mod batch;
mod counts;
mod cubics;
mod evaluator;
mod exact;
mod expansion;
mod inverse;
pub mod ladder;
pub mod lag;
pub mod lines;
mod pass;
mod route;
mod segments;
mod sincos;
mod stretch;
mod sweep;
mod table;
mod tables;

pub use crate::readings::Argument;
pub use crate::simd::InstructionSet;
pub use batch::{Batch, Real, Sample, Shared};
pub use cubics::Cubics;
pub use evaluator::{Evaluator, THREADED, TOLERANCE};
pub(crate) use pass::{Pass, Wave};
pub use route::{Path, Route};
pub use stretch::Stretch;
pub use table::{Scalar, Table, Together};

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
