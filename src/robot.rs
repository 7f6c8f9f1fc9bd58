//! Correction of one sample of several joints at a time, for control loops.

use std::sync::Arc;

use crate::compensator::Compensator;
use crate::error::Error;
use crate::kernel::{Table, Together};
use crate::terms::{Columns, Corrector, Signal};

/// One joint of a robot.
#[derive(Clone, Debug)]
pub enum Joint {
    /// A series alone, without a past.
    Still(Compensator),
    /// A series and its terms.
    Moving(Box<Corrector>),
}

/// The angle of another joint that a joint's terms need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling {
    /// The joint that has the terms.
    pub joint: usize,
    /// What they know the angle as.
    pub signal: Signal,
    /// The other joint.
    pub other: usize,
    /// Its unit in that of the joint.
    pub scale: f64,
}

/// Joints whose samples are taken together: no allocation, no lock.
///
/// The results are those of every joint's own step, to the last bit.
#[derive(Clone, Debug)]
pub struct Robot {
    joints: Vec<Joint>,
    couplings: Vec<Coupling>,
    /// Room for the indicated angles that couplings are about.
    indicated: Vec<f64>,
    has_terms: bool,
    /// The tables of all joints, where that is all they are, and what corrects by them.
    tables: Option<(Vec<Arc<Table>>, Together)>,
}

/// A joint that cannot be corrected, and why.
#[derive(Clone, Debug, PartialEq)]
pub struct JointError {
    /// Place among the joints.
    pub joint: usize,
    /// What is wrong.
    pub error: Error,
}

impl Robot {
    /// Of joints in the order of their angles.
    pub fn new(joints: Vec<Joint>) -> Self {
        Self::coupled(joints, Vec::new())
    }

    /// The same, of joints that need the indicated angles of others.
    ///
    /// # Panics
    /// Where a coupling is of a joint that there is not.
    pub fn coupled(joints: Vec<Joint>, couplings: Vec<Coupling>) -> Self {
        let there = |c: &Coupling| c.joint.max(c.other) < joints.len();
        assert!(couplings.iter().all(there), "couplings of its joints");
        Self {
            indicated: vec![
                0.0;
                if couplings.is_empty() {
                    0
                } else {
                    joints.len()
                }
            ],
            has_terms: joints.iter().any(|joint| matches!(joint, Joint::Moving(_))),
            tables: tables(&joints),
            joints,
            couplings,
        }
    }

    /// The joints, in the order of their angles.
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The true angles in place of the indicated ones, one of every joint.
    ///
    /// `signals` hold one value per joint, or one for all. No joint moves where one lacks a
    /// signal.
    ///
    /// # Panics
    /// Where there are not as many angles as joints.
    #[inline]
    pub fn step(&mut self, angles: &mut [f64], signals: &Columns<'_>) -> Result<(), JointError> {
        assert_eq!(angles.len(), self.joints.len(), "one angle of every joint");
        if let Some((tables, correct)) = &self.tables {
            // SAFETY: the function was chosen for this processor.
            unsafe { correct(tables, angles) };
            return Ok(());
        }
        if self.has_terms {
            return self.step_terms(angles, signals);
        }
        for (joint, angle) in self.joints.iter().zip(angles) {
            if let Joint::Still(compensator) = joint {
                *angle = compensator.step(*angle);
            }
        }
        Ok(())
    }

    fn step_terms(&mut self, angles: &mut [f64], signals: &Columns<'_>) -> Result<(), JointError> {
        for (joint, moving) in self.moving() {
            let is_coupled = |signal| {
                let about = |c: &Coupling| c.joint == joint && c.signal == signal;
                self.couplings.iter().any(about)
            };
            let given = |signal: Signal| signals.get(signal).is_some() || is_coupled(signal);
            let checked = moving.terms().check(given);
            checked.map_err(|error| JointError { joint, error })?;
        }
        if !self.couplings.is_empty() {
            self.indicated.copy_from_slice(angles);
        }
        for (i, (joint, angle)) in self.joints.iter_mut().zip(angles).enumerate() {
            *angle = match joint {
                Joint::Still(compensator) => compensator.step(*angle),
                Joint::Moving(corrector) => {
                    let mut own = signals.at(i);
                    for coupling in self.couplings.iter().filter(|c| c.joint == i) {
                        let value = self.indicated[coupling.other] * coupling.scale;
                        own = own.with(coupling.signal, value);
                    }
                    let corrected = corrector.correct(*angle, &own);
                    corrected.map_err(|error| JointError { joint: i, error })?
                }
            };
        }
        Ok(())
    }

    /// Forgets the past of all joints.
    pub fn reset(&mut self) {
        for joint in &mut self.joints {
            if let Joint::Moving(corrector) = joint {
                corrector.reset();
            }
        }
    }

    /// The past of every joint as plain numbers.
    pub fn store(&self) -> Vec<Vec<f64>> {
        let past = |joint: &Joint| match joint {
            Joint::Still(_) => Vec::new(),
            Joint::Moving(corrector) => corrector.store(),
        };
        self.joints.iter().map(past).collect()
    }

    /// Takes over the past of a robot of the same joints; false when it is not one.
    pub fn restore(&mut self, past: &[Vec<f64>]) -> bool {
        let mut restored = self.joints.clone();
        let fits = past.len() == restored.len()
            && restored
                .iter_mut()
                .zip(past)
                .all(|(joint, numbers)| match joint {
                    Joint::Still(_) => numbers.is_empty(),
                    Joint::Moving(corrector) => corrector.restore(numbers),
                });
        if fits {
            self.joints = restored;
        }
        fits
    }

    fn moving(&self) -> impl Iterator<Item = (usize, &Corrector)> {
        self.joints
            .iter()
            .enumerate()
            .filter_map(|(i, joint)| match joint {
                Joint::Still(_) => None,
                Joint::Moving(corrector) => Some((i, &**corrector)),
            })
    }
}

/// Tables of joints that are nothing else.
fn tables(joints: &[Joint]) -> Option<(Vec<Arc<Table>>, Together)> {
    let mut found = Vec::with_capacity(joints.len());
    let mut correct = None;
    for joint in joints {
        let Joint::Still(compensator) = joint else {
            return None;
        };
        let (table, together) = compensator.table()?;
        found.push(Arc::clone(table));
        correct = Some(together);
    }
    Some((found, correct?))
}
