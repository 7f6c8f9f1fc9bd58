//! Linear models: the one solver of dense least squares, from rows or from sums of products.
//!
//! Columns are scaled to unit length, then directions are left out that rounding alone could
//! have made: [`rank_limit`] is the one limit. What is left out gets nothing, so that solution and
//! covariance are those of the pseudo-inverse in scaled columns.

mod axes;
mod beside;
mod blocks;
mod bump;
mod clipped;
mod clusters;
mod factor;
mod golden;
mod groups;
mod model;
mod neighbours;
mod noise;
mod products;
mod ratio;
mod ridge;
mod settled;
mod whitening;

pub use beside::{Beside, Powers};
pub use blocks::{BlockProducts, block_products};
pub use bump::Bumps;
pub(crate) use clipped::MAD_TO_SIGMA;
pub use clipped::{Clipped, clipped};
pub use clusters::{Robust, cluster_covariance};
pub use factor::{Factor, Fitted, left};
pub use groups::{Sums, left_out, others};
pub use model::LinearModel;
pub use neighbours::Neighbours;
pub use noise::{Noise, RunEffect};
pub use products::{Order, Table};
pub use ratio::{Left, RunProducts, best_ratio};
pub use ridge::{Fold, RidgePath, ridge_path};
pub use settled::{Observed, Settled, settled, short_stretches, without};
pub use whitening::Correlated;

/// Rounding of an element of a triangle or normal matrix of unit columns, in units of epsilon:
/// sums run a thousand terms in a row at most, blocks are added in pairs, and so many errors of
/// either sign make the root of their number.
const ROUNDINGS: f64 = 32.0;

/// Part of the greatest singular value (of rows) or eigenvalue (of sums) of a matrix of unit
/// columns up to which a direction is rounding: a change of every element by `ROUNDINGS` epsilon
/// moves none of them by more than `columns` times that.
pub fn rank_limit(columns: usize) -> f64 {
    ROUNDINGS * columns as f64 * f64::EPSILON
}
