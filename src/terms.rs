//! What a corrector needs beyond harmonics: errors that follow travel, velocity,
//! temperature, torque and current.
//!
//! With `phi(t) = theta(t - delay)` the angle the encoder saw,
//! `indicated = phi + series(phi) + sum of terms(phi, signals)`, and
//! `theta = phi + velocity * delay`.

mod corrector;
mod form;
mod prepared;
mod signals;
mod travel;

pub use corrector::Corrector;
pub use form::{Form, Line, Term};
pub use prepared::Terms;
pub use signals::{BySignal, Columns, Signal, Signals};
