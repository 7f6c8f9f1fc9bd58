//! One-pass sums over readings: constant memory, mergeable, any orders afterwards.
//!
//! The circle is divided into segments, some six to the highest order; within one,
//! every harmonic is a polynomial of degree 11 to the last digit. Readings are added to
//! Chebyshev moments of their segment, at a cost that does not depend on the number of
//! orders; the sums that a fit needs are assembled from the segments once, at the end.

pub mod accumulator;
mod bessel;
pub mod factor;
pub mod frame;
pub mod kernel;
pub mod known;
pub mod normal;
pub mod readings;
pub mod segment;
pub mod spectrum;
