//! Vectors of doubles on whatever processor there is; knows nothing of encoders.
//!
//! A kernel is one generic function over [`Lanes`]. [`dispatch()`] compiles it once per
//! instruction set and runs the one asked for, so no build needs to know the processor
//! it will run on.

// Kernels index arrays instead of chaining closures: a closure is compiled for the
// baseline processor and would call every vector instruction as a function.
#![allow(clippy::needless_range_loop)]

mod dispatch;
mod lanes;
#[cfg(target_arch = "aarch64")]
mod neon;
mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use dispatch::{InstructionSet, Kernel, dispatch, dispatch_any};
pub use lanes::{Lanes, MOST_LANES, Quad, ROUNDER, Row};
pub use portable::{Portable, TARGET_FUSES};
