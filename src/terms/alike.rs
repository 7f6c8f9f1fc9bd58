//! Joints of one kind whose samples are taken together, each with a past of its own.

use std::sync::Arc;

use super::block::{BLOCK, Block};
use super::prepared::Terms;
use super::signals::Columns;
use super::travel::Travel;
use crate::error::Error;
use crate::kernel::Quantity;

/// Joints alike: of the environments of a simulator, the same joint in each.
#[derive(Clone, Debug)]
pub struct Alike {
    terms: Arc<Terms>,
    travels: Vec<Travel>,
}

impl Alike {
    /// So many of them, which know nothing of the past.
    pub fn new(terms: Arc<Terms>, count: usize) -> Self {
        let travels = vec![Travel::new(terms.elements.len()); count];
        Self { terms, travels }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.travels.len()
    }

    /// True without any.
    pub fn is_empty(&self) -> bool {
        self.travels.is_empty()
    }

    /// Forgets the past of one.
    ///
    /// # Panics
    /// Where there is none of this number.
    pub fn reset(&mut self, joint: usize) {
        self.travels[joint] = Travel::new(self.terms.elements.len());
    }

    /// The error of every joint at its angle (the indicated one where that is the argument), as
    /// [`super::Corrector::error`] has it to the last bit.
    pub fn errors(
        &mut self,
        angles: &[f64],
        columns: &Columns<'_>,
        errors: &mut [f64],
    ) -> Result<(), Error> {
        for got in [angles.len(), errors.len()] {
            if got != self.len() {
                return Err(Error::Length {
                    what: "angles",
                    got,
                    other: "joint",
                    wanted: self.len(),
                });
            }
        }
        columns.check(angles.len())?;
        let Self { terms, travels } = self;
        terms.check(|signal| columns.get(signal).is_some())?;
        let way = terms.way(|signal| columns.get(signal).is_some());
        if terms.is_indicated() {
            for (i, travel) in travels.iter_mut().enumerate() {
                errors[i] = terms.alone(travel, Quantity::Error, angles[i], &columns.at(i), way);
            }
            return Ok(());
        }
        let mut block: Block<BLOCK> = Block::new();
        for first in (0..angles.len()).step_by(Block::<BLOCK>::MOST) {
            let len = Block::<BLOCK>::MOST.min(angles.len() - first);
            let some = first..first + len;
            block.x.fill(f64::NAN);
            block.x[..len].copy_from_slice(&angles[some.clone()]);
            block.signals.load(columns, first, len);
            terms.error_still(&mut block, len);
            if terms.has_travel {
                terms.error_moving(&mut travels[some.clone()], &mut block, len, way);
            }
            errors[some].copy_from_slice(&block.out[..len]);
        }
        Ok(())
    }
}
