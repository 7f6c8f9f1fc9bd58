//! Tables of an angle's correction, evaluated as firmware evaluates them.
//!
//! An angle is an unsigned 32-bit fraction of a turn: it wraps by itself, a reading of `b`
//! bits is shifted left by `32 - b`, and a shaft that turns a whole number of times per turn
//! of the output is a wrapping product. A table holds `2^bits + 1` knots at equal distances,
//! the last one again the first, so that nothing here takes a remainder.
//!
//! The functions are what `trueangle export` writes into C and Rust, and what it runs over
//! every input to prove how far a table is from its model. Integers round to nearest; every
//! shift of a negative number is arithmetic. What an exporter must keep, for nothing here
//! checks it: `1 <= bits <= 16`, and of the knots what each function says.
//!
//! ```
//! let knots = [0, 100, 0, -100, 0];
//! assert_eq!(trueangle_table::linear_i32(&knots, 2, 1 << 29), 50);
//! ```

#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

mod cubic;
mod linear;

pub use cubic::{cubic_f32, cubic_i16, cubic_i32};
pub use linear::{linear_f32, linear_i16, linear_i32};

/// The sources of the functions, which an exported Rust program carries along unchanged.
pub mod source {
    /// Linear interpolation.
    pub const LINEAR: &str = include_str!("linear.rs");
    /// Cubic Hermite interpolation.
    pub const CUBIC: &str = include_str!("cubic.rs");
}
