//! Correction of one sample at a time, for control loops.

use std::sync::Arc;

use crate::error::Error;
use crate::kernel::{Batch, Evaluator, Quantity};

/// A series made ready for single samples: no state, no allocation, no lock.
#[derive(Clone, Debug)]
pub struct Compensator {
    evaluator: Arc<Evaluator>,
}

impl Compensator {
    /// Refuses a series whose correction is not unique.
    pub fn new(evaluator: Arc<Evaluator>) -> Result<Self, Error> {
        evaluator.check_invertible()?;
        Ok(Self { evaluator })
    }

    /// The true angle of an indicated one.
    pub fn step(&self, indicated: f64) -> f64 {
        let mut sample = [indicated];
        let done = self.evaluator.run(
            Quantity::Correction,
            None,
            Some(1),
            Batch::in_place(&mut sample),
        );
        debug_assert!(done.is_ok(), "checked when the compensator was made");
        sample[0]
    }
}
