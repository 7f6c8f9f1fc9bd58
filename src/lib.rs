#![doc = include_str!("../README.md")]

pub mod error;

pub mod angle;
pub mod channels;
pub mod chebyshev;
pub mod check;
pub mod circle;
pub mod readings;
pub mod series;

pub mod direct;

pub mod interrupt;
pub mod memory;
pub mod once;
pub mod reserve;
pub mod threads;

pub mod simd;

pub mod kernel;

pub mod compensator;
pub mod robot;
pub mod terms;

pub mod band;
pub mod banded;
pub mod design;
pub mod evidence;
pub mod fit;
pub mod linear;
pub mod lstsq;
pub mod mixture;
pub mod moments;
pub mod monitor;
pub mod outliers;
pub mod rank;
pub mod rounded;
pub mod spectrum;
pub mod waves;

#[cfg(feature = "python")]
mod python;

pub use error::Error;
pub use series::{HarmonicSeries, Shaft};
/// Tables as firmware evaluates them: no std, no allocation.
pub use trueangle_table as table;
