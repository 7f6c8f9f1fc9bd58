//! What a corrector needs beyond harmonics: errors that follow travel, velocity,
//! temperature and torque.
//!
//! With `phi(t) = theta(t - delay)` the angle the encoder saw,
//! `indicated = phi + series(phi) + sum of terms(phi, signals)`, and
//! `theta = phi + velocity * delay`.

mod corrector;
mod signals;
mod term;
mod travel;

pub use corrector::{Corrector, Terms};
pub use signals::{Columns, Signal, Signals};
pub use term::{Line, Term};
