//! One linear model of all readings: noise, orders and effects of runs by their evidence.
//!
//! For every run `r`, with `X` the columns of all groups (an order is its cosine and its sine):
//!
//! ```text
//! y_r  = z_r + X_r (b + d_r) + n_r
//! b_g  ~ 0 or N(0, tau_g I)            which groups are in (spike and slab)
//! d_rg ~ N(0, omega_g I)               what differs from run to run
//! n_r  ~ N(0, C),  C = w I + sum_j a_j exp(-|dt| / T_j)
//! z_r  flat                            the zero of the run
//! ```
//!
//! The correlation times `T_j` are fixed ([`CORRELATION_TIMES`]), in median steps of the run's time.
//! White noise, autoregressive noise, drift, 1/f noise and random walks are all in their span.
//!
//! One pass over the readings gives the Gram matrices of each run ([`Gram`]). From them follow,
//! without another pass, the evidence and the posterior of a model ([`Model::posterior`]) and the
//! search for groups and their variances ([`Search`]). The noise at the maximum of the evidence
//! ([`Readings::noise`]) takes about 6 steps, each of a few passes. [`Readings::estimate`] returns
//! the mixture over models and noises. Nothing is random: the same readings give the same bits on
//! the same processor, with any number of threads.

// Loops over small arrays read as the equations do.
#![allow(clippy::needless_range_loop)]

mod candidates;
mod estimate;
mod gains;
mod gram;
mod groups;
mod information;
mod model;
mod noise;
mod posterior;
mod prior;
mod readings;
mod rows;
mod search;
mod slopes;
mod whitening;

pub use estimate::{Estimate, Mixture};
pub use gains::{Candidate, Solved, Without};
pub use gram::{Gram, Sums};
pub use groups::{Changes, GroupSums};
pub use information::Information;
pub use model::Model;
pub use noise::NoiseFit;
pub use posterior::Posterior;
pub use prior::{NoisePrior, Prior};
pub use readings::{Readings, Run};
pub use rows::Rows;
pub use search::{Found, Search};
pub use whitening::{CORRELATION_TIMES, Factor, Noise, State, TERMS, VARIANCES, decays};
