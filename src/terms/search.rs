//! The angles at which the series and its terms add up to what is indicated.

use super::block::{Given, Rows, Work};
use super::exponential::exp;
use super::prepared::Terms;
use super::smooth::{KINK, NEAR};
use super::travel::{Friction, Pull};
use crate::simd::{InstructionSet, Kernel, Lanes, Portable, dispatch};

/// Steps before the signals are taken to leave no unique angle; as a rule two or three do.
const MOST_STEPS: usize = 60;

/// Part of a period that steps yet to come may add up to; corrections promise 1e-12.
const SOLVED: f64 = 3e-13;

/// Steepest error of which one step may be the last.
const GENTLE: f64 = 0.25;

/// Runs a pass over a block or, one lane wide, over a single reading.
pub(super) fn pass<const N: usize>(set: InstructionSet, kernel: impl Kernel) {
    if N == 1 {
        // No sum of products is rounded once here: it is the same on every processor.
        kernel.run::<Portable<1, false>>();
    } else {
        dispatch(set, kernel);
    }
}

impl Terms {
    /// Adds up what the terms are at every angle.
    pub(super) fn fill_level<const N: usize>(&self, signals: &Given<N>, level: &mut [f64]) {
        pass::<N>(
            self.set,
            Level {
                terms: self,
                signals,
                level,
            },
        );
    }

    /// Error of the terms at angles `x` beyond the level and travel, into `work`.
    pub(super) fn fill_shape<const N: usize>(
        &self,
        signals: &Given<N>,
        x: &[f64],
        work: &mut Work<N>,
    ) {
        pass::<N>(
            self.set,
            Shape {
                terms: self,
                signals,
                x,
                work,
            },
        );
    }

    /// Angles `x` with `x + series(x) + terms(x) = goal`, NaN where the signals leave no
    /// unique one.
    ///
    /// Newton steps on the terms around the inverse of the series shrink by the product of
    /// both slopes; the shrinking seen is carried on to its limit (Aitken). Every reading
    /// stands still once it is found, so that it does not depend on those beside it.
    pub(super) fn find<const N: usize>(
        &self,
        goal: &[f64],
        pull: &Pull<'_>,
        signals: &Given<N>,
        x: &mut [f64],
        work: &mut Work<N>,
    ) {
        let own = work.rows(x.len()).goal;
        if self.is_pulled_alone(goal, pull, own) {
            return self.invert(own, x);
        }
        let search = Search {
            terms: self,
            pull,
            signals,
            x,
            work,
        };
        pass::<N>(self.set, search);
    }

    /// The same of one reading.
    pub(super) fn find_one(&self, goal: f64, pull: &Pull<'_>, signals: &Given<1>) -> f64 {
        let (mut own, mut x) = ([0.0], [0.0]);
        if self.is_pulled_alone(&[goal], pull, &mut own) {
            self.invert(&own, &mut x);
        } else {
            self.find(&[goal], pull, signals, &mut x, &mut Work::new());
        }
        x[0]
    }

    /// Takes off a goal what travel adds at every angle; true where nothing else depends on
    /// the angle.
    #[inline]
    fn is_pulled_alone(&self, goal: &[f64], pull: &Pull<'_>, own: &mut [f64]) -> bool {
        let n = own.len();
        let (goal, direction) = (&goal[..n], &pull.direction[..n]);
        own.copy_from_slice(goal);
        if self.play != 0.0 {
            for i in 0..n {
                own[i] -= self.play * direction[i];
            }
        }
        if let Friction::Held(error) = pull.friction {
            let error = &error[..n];
            for i in 0..n {
                own[i] -= error[i];
            }
        }
        let is_free = !matches!(pull.friction, Friction::From { .. });
        is_free && !self.is_shaped && self.place.is_none()
    }

    /// The inverse of the series, where its argument is the true angle.
    fn invert(&self, goal: &[f64], x: &mut [f64]) {
        if self.is_indicated() {
            x.copy_from_slice(goal);
        } else {
            self.corrections.run(goal, x);
        }
    }
}

struct Level<'a, const N: usize> {
    terms: &'a Terms,
    signals: &'a Given<N>,
    level: &'a mut [f64],
}

impl<const N: usize> Kernel for Level<'_, N> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        self.level.fill(0.0);
        for term in &self.terms.smooth {
            term.add_level(self.signals, self.level);
        }
    }
}

struct Shape<'a, const N: usize> {
    terms: &'a Terms,
    signals: &'a Given<N>,
    x: &'a [f64],
    work: &'a mut Work<N>,
}

impl<const N: usize> Kernel for Shape<'_, N> {
    #[inline(always)]
    fn run<L: Lanes>(self) {
        let Self {
            terms,
            signals,
            x,
            work,
        } = self;
        work.rows(x.len()).error.fill(0.0);
        for term in &terms.smooth {
            term.add_shape(signals, x, false, work);
        }
    }
}

struct Search<'a, const N: usize> {
    terms: &'a Terms,
    pull: &'a Pull<'a>,
    signals: &'a Given<N>,
    x: &'a mut [f64],
    work: &'a mut Work<N>,
}

impl<const N: usize> Search<'_, N> {
    /// Error of terms and travel at the angles so far, and where `steep` its slope and a
    /// bound of its second derivative.
    #[inline(always)]
    fn fill(&mut self, steep: bool) {
        let Self {
            terms,
            pull,
            signals,
            x,
            work,
            ..
        } = self;
        let x: &[f64] = x;
        let n = x.len();
        let rows = work.rows(n);
        for row in [rows.error, rows.slope, rows.bend] {
            row.fill(0.0);
        }
        for term in &terms.smooth {
            term.add_shape(signals, x, steep, work);
        }
        if let Some(place) = &terms.place {
            work.rows(n).factor.copy_from_slice(pull.direction);
            work.add_lines(place, x, steep);
        }
        if let Friction::From {
            place,
            direction,
            state,
        } = pull.friction
        {
            let near = KINK * terms.period();
            let rows = work.rows(n);
            let (errors, slopes, bends) = (rows.error, rows.slope, rows.bend);
            for (element, &begun) in terms.elements.iter().zip(state) {
                let (size, per_length) = (element.amplitude, 1.0 / element.length);
                for i in 0..n {
                    let way = (x[i] - place) * direction;
                    let way = if way > 0.0 { way } else { 0.0 };
                    let left = (direction - begun) * exp(-way * per_length);
                    errors[i] += size * (direction - left);
                    let slope = size * left * per_length;
                    slopes[i] += if way > 0.0 { slope * direction } else { 0.0 };
                    bends[i] += if way > near {
                        slope.abs() * per_length
                    } else {
                        f64::INFINITY
                    };
                }
            }
        }
    }
}

impl<const N: usize> Kernel for Search<'_, N> {
    #[inline(always)]
    fn run<L: Lanes>(mut self) {
        let (terms, n) = (self.terms, self.x.len());
        // The series is small beside the lengths on which terms change: a good start.
        let constant = if terms.is_indicated() {
            0.0
        } else {
            terms.evaluator.series().constant()
        };
        let (x, Rows { goal, open, .. }) = (&mut self.x[..n], self.work.rows(n));
        for i in 0..n {
            x[i] = goal[i] - constant;
            open[i] = if goal[i].is_finite() { 1.0 } else { 0.0 };
        }
        self.fill(false);
        self.probe();
        self.x.copy_from_slice(self.work.rows(n).probe);
        for count in 0..MOST_STEPS {
            self.fill(true);
            self.probe();
            // Nothing has been seen at first, which saves two divisions.
            let is_open = if count == 0 {
                self.step(true)
            } else {
                self.step(false)
            };
            if !is_open {
                return;
            }
        }
        let open = self.work.rows(n).open;
        for i in 0..n {
            self.x[i] = if open[i] > 0.0 { f64::NAN } else { self.x[i] };
        }
    }
}

impl<const N: usize> Search<'_, N> {
    /// Angles at which the series makes up for the terms as they are.
    #[inline(always)]
    fn probe(&mut self) {
        let n = self.x.len();
        let Rows {
            error,
            value,
            goal,
            probe,
            ..
        } = self.work.rows(n);
        for i in 0..n {
            value[i] = goal[i] - error[i];
        }
        self.terms.invert(value, probe);
    }

    /// A step from each angle that is not found yet; true where one is not found then.
    #[inline(always)]
    fn step(&mut self, is_first: bool) -> bool {
        let (terms, period) = (self.terms, self.terms.period());
        let steepness = if terms.is_indicated() {
            0.0
        } else {
            terms.steepness
        };
        let (solved, near) = (SOLVED * period, NEAR * period);
        let n = self.x.len();
        let x = &mut self.x[..n];
        let Rows {
            slope,
            bend,
            goal,
            probe,
            last,
            open,
            ..
        } = self.work.rows(n);
        let mut is_open = false;
        for i in 0..n {
            let tolerance = solved + 4.0 * f64::EPSILON * goal[i].abs();
            let step = (probe[i] - x[i]) / (1.0 + slope[i]);
            let size = step.abs();
            let ratio = if is_first { f64::NAN } else { step / last[i] };
            let shrinks = ratio.abs() < 0.5;
            let further = if shrinks {
                step * ratio / (1.0 - ratio)
            } else {
                0.0
            };
            let next = x[i] + step + further;
            // What is left is smaller by both slopes, and as much as was seen (NaN at
            // first); or by a bound, four times as large as it need be.
            let both = slope[i].abs() * steepness;
            let most = if ratio.abs() > both {
                ratio.abs()
            } else {
                both
            };
            let is_seen = !ratio.is_nan() & (size * most <= tolerance);
            let is_gentle = (slope[i].abs() < GENTLE) & (steepness < 1.0) & (size < near);
            let is_bound = is_gentle & (4.0 * size * (both + size * bend[i]) <= tolerance);
            let is_done = (size <= tolerance) | is_seen | is_bound;
            let unique = if slope[i].abs() < 1.0 { next } else { f64::NAN };
            let next = if is_done { unique } else { next };
            let goes_on = !is_done & !next.is_nan();
            x[i] = if open[i] > 0.0 { next } else { x[i] };
            open[i] = if goes_on { open[i] } else { 0.0 };
            last[i] = step;
            is_open |= open[i] > 0.0;
        }
        is_open
    }
}

#[cfg(test)]
mod tests {
    use super::super::block::BLOCK;
    use super::*;

    /// Notes how many lanes it is run with and whether these round a product and sum once.
    struct Noting<'a>(&'a mut (usize, bool));

    impl Kernel for Noting<'_> {
        #[inline(always)]
        fn run<L: Lanes>(self) {
            *self.0 = (L::N, L::FUSED);
        }
    }

    /// A step is the same on every processor; a block is worked on as fast as this one can.
    #[test]
    fn one_reading_is_computed_alike_on_every_processor() {
        for set in [
            InstructionSet::Portable,
            InstructionSet::Avx2,
            InstructionSet::Avx512,
        ] {
            let (mut one, mut block, mut own) = ((0, true), (0, true), (0, true));
            pass::<1>(set, Noting(&mut one));
            pass::<BLOCK>(set, Noting(&mut block));
            dispatch(set, Noting(&mut own));
            assert_eq!(one, (1, false), "{set:?}");
            assert_eq!(block, own, "{set:?}");
            assert!(own.0 > 1, "{set:?}");
        }
    }
}
