//! Correction of one sample of several joints at a time, for control loops.

use crate::compensator::Compensator;
use crate::error::Error;
use crate::terms::{Columns, Corrector, Signal};

/// One joint of a robot.
#[derive(Clone, Debug)]
pub enum Joint {
    /// A series alone, without a past.
    Still(Compensator),
    /// A series and its terms.
    Moving(Box<Corrector>),
}

/// Joints whose samples are taken together: no allocation, no lock.
///
/// The results are those of every joint's own step, to the last bit.
#[derive(Clone, Debug)]
pub struct Robot {
    joints: Vec<Joint>,
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
        Self { joints }
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
        let given = |signal: Signal| signals.get(signal).is_some();
        for (joint, moving) in self.moving() {
            let checked = moving.terms().check(given);
            checked.map_err(|error| JointError { joint, error })?;
        }
        for (i, (joint, angle)) in self.joints.iter_mut().zip(angles).enumerate() {
            *angle = match joint {
                Joint::Still(compensator) => compensator.step(*angle),
                Joint::Moving(corrector) => {
                    let corrected = corrector.correct(*angle, &signals.at(i));
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
