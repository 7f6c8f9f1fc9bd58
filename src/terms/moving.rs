//! Readings that depend on the travel before them.
//!
//! A reading is solved by itself, with all that may become of it. Ahead of that a block is
//! solved as if the joint went on as it does; the readings are then gone through in their
//! order and taken as long as that was so.

use super::block::{BLOCK, Block, Given, padded};
use super::prepared::Terms;
use super::signals::Signal;
use super::travel::{Friction, Heading, NOWHERE, Pull, Travel};
use crate::kernel::Quantity;

/// Fewest readings that are worth solving together.
const LEAST: usize = 4;

impl Terms {
    /// The true angle behind one reading; `way` is the signal whose sign is the direction
    /// of travel.
    pub(super) fn correct_one(
        &self,
        travel: &mut Travel,
        indicated: f64,
        signals: &Given<1>,
        way: Option<Signal>,
    ) -> f64 {
        let (goal, delayed) = self.aim_one(indicated, signals);
        if goal.is_nan() {
            return f64::NAN;
        }
        if !self.has_travel {
            let pull = Pull {
                direction: &[0.0],
                friction: Friction::None,
            };
            return self.find_one(goal, &pull, signals) + delayed;
        }
        let constant = self.evaluator.series().constant();
        travel.align(indicated - constant, self.period());
        if let Some(signal) = way {
            let signal = signals.of(signal)[0];
            if signal.is_nan() {
                return f64::NAN;
            }
            let heading = travel.heading(signal);
            let mut x = self.ahead(travel, heading, goal, signals);
            if !self.elements.is_empty() && travel.is_known() && !travel.goes_on(heading, x) {
                x = self.behind(travel, heading, goal, signals);
            }
            if !x.is_nan() {
                travel.advance(&self.elements, heading, x);
            }
            return x + delayed;
        }
        if !travel.is_known() {
            let x = self.ahead(travel, NOWHERE, goal, signals);
            if !x.is_nan() {
                travel.advance(&self.elements, NOWHERE, x);
            }
            return x + delayed;
        }
        // Play: the joint has moved where the angle leaves the band of the play.
        let first = if travel.direction < 0.0 { -1.0 } else { 1.0 };
        for direction in [first, -first] {
            let heading = travel.heading(direction);
            let x = self.ahead(travel, heading, goal, signals);
            if x.is_nan() {
                return x;
            }
            if (x - travel.farthest) * direction >= 0.0 {
                travel.advance(&self.elements, heading, x);
                return x + delayed;
            }
        }
        travel.farthest + delayed
    }

    /// The angle of a reading, if the joint went on with a heading.
    fn ahead(&self, travel: &mut Travel, heading: Heading, goal: f64, signals: &Given<1>) -> f64 {
        let pull = Pull {
            direction: &[heading.direction],
            friction: travel.ahead(&self.elements, heading),
        };
        self.find_one(goal, &pull, signals)
    }

    /// The angle of a reading, if it did not: friction is what it was or, while turning,
    /// goes on in the old direction.
    fn behind(&self, travel: &Travel, heading: Heading, goal: f64, signals: &Given<1>) -> f64 {
        let held = [travel.held(&self.elements)];
        let pull = Pull {
            direction: &[heading.direction],
            friction: if heading.turned {
                travel.along()
            } else {
                Friction::Held(&held)
            },
        };
        self.find_one(goal, &pull, signals)
    }

    /// True angles behind the first `len` readings of a block.
    pub(super) fn correct_moving(
        &self,
        travel: &mut Travel,
        block: &mut Block<BLOCK>,
        len: usize,
        way: Option<Signal>,
    ) {
        block.goal.fill(f64::NAN);
        self.aim(block, len);
        let (mut i, mut most) = (0, len);
        while i < len {
            let some = most.min(len - i);
            let is_going = travel.is_known() && travel.direction != 0.0;
            block.signals.first = i;
            let done = match way {
                _ if some < LEAST || !is_going => 0,
                Some(signal) => self.correct_directed(travel, block, i, some, signal),
                None => self.correct_played(travel, block, i, some),
            };
            block.signals.first = 0;
            i += done;
            most = (2 * done).max(LEAST);
            if done < some {
                let signals = block.signals.at(i);
                block.out[i] = self.alone(travel, Quantity::Correction, block.x[i], &signals, way);
                i += 1;
            }
        }
    }

    /// As many of `some` readings from `first` on as a signal of direction lets solve at
    /// once: all without friction, else those in the present direction.
    fn correct_directed(
        &self,
        travel: &mut Travel,
        block: &mut Block<BLOCK>,
        first: usize,
        some: usize,
        signal: Signal,
    ) -> usize {
        let Block {
            signals,
            x,
            out,
            goal,
            delayed,
            direction,
            friction,
            onward,
            turned,
            work,
        } = block;
        let given = &signals.of(signal)[..some];
        let (goal, delayed) = (&goal[first..], &delayed[first..]);
        let (x, out) = (&x[first..], &mut out[first..]);
        let is_pulled = !self.elements.is_empty();
        let mut last = travel.direction;
        for i in 0..some {
            let stays = given[i] == 0.0 || goal[i].is_nan();
            last = if stays { last } else { given[i].signum() };
            direction[i] = last;
        }
        let mut stop = some;
        if is_pulled {
            let turns = |&i: &usize| direction[i] != travel.direction;
            stop = (0..some).find(turns).unwrap_or(some);
        }
        let n = padded::<BLOCK>(stop);
        let pull = Pull {
            direction: &direction[..n],
            friction: travel.along(),
        };
        self.find(&goal[..n], &pull, signals, &mut onward[..n], work);
        let (mut done, mut is_held) = (0, false);
        while done < stop {
            let (i, reached) = (done, onward[done]);
            if goal[i].is_nan() {
                out[i] = f64::NAN;
                done += 1;
                continue;
            }
            let constant = self.evaluator.series().constant();
            let is_aligned = travel.align(x[i] - constant, self.period());
            if reached.is_nan() || (is_pulled && is_aligned) {
                break;
            }
            let heading = travel.heading(given[i]);
            friction[i] = f64::NAN;
            if is_pulled && !travel.goes_on(heading, reached) {
                friction[i] = travel.held(&self.elements);
                is_held = true;
            }
            travel.advance(&self.elements, heading, reached);
            out[i] = reached + delayed[i];
            done += 1;
        }
        if is_held {
            let n = padded::<BLOCK>(done);
            let pull = Pull {
                direction: &direction[..n],
                friction: Friction::Held(&friction[..n]),
            };
            self.find(&goal[..n], &pull, signals, &mut turned[..n], work);
            for i in 0..done {
                if !friction[i].is_nan() {
                    out[i] = turned[i] + delayed[i];
                }
            }
        }
        done
    }

    /// As many of `some` readings from `first` on as can be solved at once where the angle
    /// itself tells the direction: all without friction, else those that go on.
    fn correct_played(
        &self,
        travel: &mut Travel,
        block: &mut Block<BLOCK>,
        first: usize,
        some: usize,
    ) -> usize {
        let Block {
            signals,
            x,
            out,
            goal,
            delayed,
            direction,
            onward,
            turned,
            work,
            ..
        } = block;
        let (goal, delayed) = (&goal[first..], &delayed[first..]);
        let (x, out) = (&x[first..], &mut out[first..]);
        let is_pulled = !self.elements.is_empty();
        let n = padded::<BLOCK>(some);
        let (goal, old) = (&goal[..n], travel.direction);
        let mut is_sure = is_pulled;
        for side in [1.0, -1.0] {
            // The other side is asked for where a reading is not beyond the one before.
            direction[..n].fill(side * old);
            let pull = Pull {
                direction: &direction[..n],
                friction: travel.along(),
            };
            let angles = if side > 0.0 {
                &mut *onward
            } else {
                &mut *turned
            };
            self.find(goal, &pull, signals, &mut angles[..n], work);
            is_sure = is_sure || goes_on(travel.farthest, old, &onward[..some]);
            if is_sure {
                break;
            }
        }
        let constant = self.evaluator.series().constant();
        for i in 0..some {
            let is_aligned = !goal[i].is_nan() && travel.align(x[i] - constant, self.period());
            if is_pulled && is_aligned {
                return i;
            }
            let sides = if travel.direction == old {
                [onward[i], turned[i]]
            } else {
                [turned[i], onward[i]]
            };
            let going = travel.direction;
            out[i] = travel.farthest + delayed[i];
            for (reached, direction) in [(sides[0], going), (sides[1], -going)] {
                if reached.is_nan() {
                    out[i] = reached;
                    break;
                }
                if (reached - travel.farthest) * direction >= 0.0 {
                    let heading = travel.heading(direction);
                    travel.advance(&self.elements, heading, reached);
                    out[i] = reached + delayed[i];
                    break;
                }
                if is_sure {
                    return i;
                }
            }
        }
        some
    }

    /// Adds to the errors of the first `len` readings of a block what travel adds: that of all, or
    /// of each its own.
    pub(super) fn error_moving<const N: usize>(
        &self,
        travels: &mut [Travel],
        block: &mut Block<N>,
        len: usize,
        way: Option<Signal>,
    ) {
        let Block {
            signals,
            out,
            direction,
            friction,
            onward: seen,
            work,
            ..
        } = block;
        let is_one = travels.len() == 1;
        for i in 0..len {
            let travel = &mut travels[if is_one { 0 } else { i }];
            (direction[i], friction[i]) = (0.0, 0.0);
            if !out[i].is_finite() {
                continue;
            }
            travel.align(seen[i], self.period());
            let way_on = seen[i] - travel.farthest;
            let moved = if way_on.is_nan() { 0.0 } else { way_on };
            let signal = way.map_or(moved, |signal| signals.of(signal)[i]);
            if signal.is_nan() {
                out[i] = f64::NAN;
                continue;
            }
            let heading = travel.heading(signal);
            travel.advance(&self.elements, heading, seen[i]);
            direction[i] = heading.direction;
            friction[i] = travel.held(&self.elements);
        }
        let n = padded::<N>(len);
        let value = work.rows(n).value;
        value.fill(0.0);
        if let Some(place) = &self.place {
            place.values(&seen[..n], value);
        }
        for i in 0..len {
            out[i] += direction[i] * (self.play + value[i]) + friction[i];
        }
    }
}

/// True where each angle is at least as far in a direction as the one before it.
#[inline(always)]
fn goes_on(mut farthest: f64, direction: f64, angles: &[f64]) -> bool {
    let mut is_on = true;
    for &angle in angles {
        is_on &= (angle - farthest) * direction >= 0.0;
        farthest = angle;
    }
    is_on
}
