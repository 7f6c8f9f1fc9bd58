//! What a corrector needs beyond harmonics: errors that follow travel, velocity,
//! temperature, torque and current.
//!
//! With `phi(t) = theta(t - delay)` the angle the encoder saw,
//! `indicated = phi + series(phi) + sum of terms(phi, signals)`, and
//! `theta = phi + velocity * delay`.

// Passes index slices instead of chaining closures, as kernels do.
#![allow(clippy::needless_range_loop)]

mod alike;
mod block;
mod corrector;
mod exponential;
mod form;
mod lines;
mod lowpass;
mod moving;
mod prepared;
mod search;
mod signals;
mod smooth;
mod still;
mod travel;

pub use alike::Alike;
pub use corrector::Corrector;
pub use form::{Form, Line, Term};
pub use prepared::Terms;
pub use signals::{BySignal, Columns, Signal, Signals};
