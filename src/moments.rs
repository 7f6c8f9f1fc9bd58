//! One-pass sums over readings: constant memory, mergeable, any orders afterwards.
//!
//! The circle is divided into segments, some six to the highest order; within one,
//! every harmonic is a polynomial of degree 11 to the last digit. Readings are added to
//! Chebyshev moments of their segment, at a cost that does not depend on the number of
//! orders; the sums that a fit needs are assembled from the segments once, at the end.

pub mod accumulate;
pub mod accumulator;
mod chunk;
mod combined;
pub mod expected;
pub mod factor;
pub mod normal;
pub mod place;
mod row;
pub mod segment;
pub mod spectrum;
pub mod stream;
pub mod waiting;
