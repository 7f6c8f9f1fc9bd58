//! Correction of one sample at a time, for control loops.

use std::sync::Arc;

use crate::error::Error;
use crate::kernel::{Evaluator, Scalar, Table, Together};

/// A series made ready for single samples: no state, no allocation, no lock.
///
/// The results are those of a batch, to the last bit.
#[derive(Clone, Debug)]
pub struct Compensator {
    evaluator: Arc<Evaluator>,
    table: Option<(Arc<Table>, Scalar)>,
}

impl Compensator {
    /// Builds the table; refuses a series whose correction is not unique.
    pub fn new(evaluator: Arc<Evaluator>) -> Result<Self, Error> {
        evaluator.check_invertible()?;
        let table = evaluator.scalar();
        Ok(Self { evaluator, table })
    }

    /// Its table, and what corrects by several of them at once; None without one.
    pub(crate) fn table(&self) -> Option<(&Arc<Table>, Together)> {
        let (table, _) = self.table.as_ref()?;
        Some((table, self.evaluator.together()))
    }

    /// The true angle of an indicated one.
    #[inline]
    pub fn step(&self, indicated: f64) -> f64 {
        match &self.table {
            // SAFETY: the function was chosen for this processor.
            Some((table, correct)) => unsafe { correct(table, indicated) },
            None => self.evaluator.correct_one(indicated),
        }
    }
}
