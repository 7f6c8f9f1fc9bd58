//! The evidence of models of all readings.

mod cases;
mod dense;
mod search;
