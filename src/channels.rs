//! Two channels of a sensor, sine and cosine: the closed curve that they draw, and the angle.
//!
//! `cosine + i sine = sum_k z_k exp(i k phi)`. Readings alone show the curve, not the angle at
//! which it is passed: the sum `z_(1+k) + conj(z_(1-k))`, not the difference. So the curve has
//! `z_1`, the offset `z_0`, gain and phase in `z_(-1)`, and harmonics `z_(-2)`, `z_(-3)` ... .

mod angle;
mod curve;
mod faults;
mod likelihood;
mod resolver;
mod start;

pub use angle::{Angle, Decoder, Off};
pub use curve::{Curve, angle_slopes};
pub use faults::{faults, wraps_at};
pub use likelihood::{CurveFit, Readings, fit};
pub use resolver::{Demodulated, demodulate};
