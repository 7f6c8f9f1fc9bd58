//! A series and its terms, made ready: what they add, and the angle at which that adds up.

use std::sync::Arc;

use super::form::{Form, Line, Term};
use super::lines::Lines;
use super::signals::Signal;
use super::smooth::{KINK, Smooth};
use super::travel::Element;
use crate::error::Error;
use crate::kernel::{Argument, Evaluator, InstructionSet, Pass, Quantity};
use crate::once::Once;

/// A series and its terms: immutable, shared by its correctors.
#[derive(Debug)]
pub struct Terms {
    pub(super) evaluator: Arc<Evaluator>,
    /// The series' own corrections, and its errors once they are asked for.
    pub(super) corrections: Pass,
    errors: Once<Pass>,
    /// What is computed on.
    pub(super) set: InstructionSet,
    pub(super) smooth: Vec<Smooth>,
    pub(super) is_shaped: bool,
    /// Half of the play, and how it varies with the place.
    pub(super) play: f64,
    pub(super) place: Option<Lines>,
    pub(super) elements: Vec<Element>,
    pub(super) has_travel: bool,
    pub(super) delay: f64,
    /// Bound of the slope of the inverted series less 1.
    pub(super) steepness: f64,
    /// Signals needed, each with the first term that needs it.
    needs: Vec<(Signal, String)>,
}

impl Terms {
    /// Refuses numbers that are not finite, and terms that leave no unique correction.
    pub fn new(evaluator: Arc<Evaluator>, terms: &[Term]) -> Result<Self, Error> {
        let period = evaluator.series().period().value();
        evaluator.check_invertible()?;
        let mut ready = Self {
            errors: Once::default(),
            corrections: Pass::new(&evaluator, Quantity::Correction),
            evaluator,
            set: InstructionSet::best(),
            smooth: Vec::new(),
            is_shaped: false,
            play: 0.0,
            place: None,
            elements: Vec::new(),
            has_travel: false,
            delay: 0.0,
            steepness: 0.0,
            needs: Vec::new(),
        };
        let mut places: Vec<Line> = Vec::new();
        let mut ramps = 0.0;
        for Term { name, form } in terms {
            match form {
                Form::Play { half_width, lines } => {
                    ready.play += half_width;
                    places.extend(lines);
                    ready.has_travel = true;
                }
                &Form::Friction {
                    amplitude,
                    length,
                    start,
                } => {
                    ready.elements.push(Element {
                        amplitude,
                        length,
                        start,
                    });
                    ready.has_travel = true;
                }
                Form::Lag { delay } => ready.delay += delay,
                Form::Ramp { slope, .. } => ramps += slope.abs(),
                _ => {}
            }
            let series = ready.evaluator.series();
            ready
                .smooth
                .extend(Smooth::new(form, series, KINK * period)?);
            if let Some(signal) = form.needs()
                && ready.needs.iter().all(|(known, _)| *known != signal)
            {
                ready.needs.push((signal, name.clone()));
            }
        }
        ready.place = Lines::of(&places, period)?;
        ready.is_shaped = ready.smooth.iter().any(Smooth::is_shaped);
        // |dz/ds| reaches 2/length, just after a reversal.
        let steepest: f64 = ready
            .elements
            .iter()
            .map(|element| 2.0 * element.amplitude.abs() / element.length)
            .sum::<f64>()
            + ready.place.as_ref().map_or(0.0, |place| place.steepness);
        let bound = ready.evaluator.slope_bound();
        ready.steepness = bound / (1.0 - bound).max(f64::MIN_POSITIVE);
        let slope = steepest + bound + ramps;
        if ready.evaluator.argument() == Argument::Reference && slope >= 1.0 {
            return Err(Error::NotInvertible { slope });
        }
        Ok(ready)
    }

    /// The series.
    pub fn evaluator(&self) -> &Evaluator {
        &self.evaluator
    }

    /// True when corrections depend on samples before.
    pub fn has_state(&self) -> bool {
        self.has_travel
    }

    /// Signals that must be given, each with a term that needs it.
    pub fn needs(&self) -> &[(Signal, String)] {
        &self.needs
    }

    /// True when corrections depend on the signal where it is given.
    pub fn takes(&self, signal: Signal) -> bool {
        let travels = matches!(signal, Signal::Direction | Signal::Velocity) && self.has_travel;
        travels || self.needs.iter().any(|(needed, _)| *needed == signal)
    }

    pub(super) fn errors(&self) -> &Pass {
        let make = || Pass::new(&self.evaluator, Quantity::Error);
        self.errors.get_or_init(make)
    }

    /// The signal whose sign is the direction of travel, among those given.
    pub(super) fn way(&self, given: impl Fn(Signal) -> bool) -> Option<Signal> {
        let all = [Signal::Direction, Signal::Velocity];
        all.into_iter()
            .find(|&signal| self.has_travel && given(signal))
    }

    /// Refuses to go on without a signal that a term needs.
    pub fn check(&self, given: impl Fn(Signal) -> bool) -> Result<(), Error> {
        for &(signal, ref term) in &self.needs {
            let implied = signal == Signal::Direction && given(Signal::Velocity);
            if !implied && !given(signal) {
                return Err(Error::MissingSignal {
                    signal,
                    term: term.clone(),
                });
            }
        }
        Ok(())
    }

    pub(super) fn is_indicated(&self) -> bool {
        self.evaluator.argument() == Argument::Indicated
    }

    pub(super) fn period(&self) -> f64 {
        self.evaluator.series().period().value()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::series::{HarmonicSeries, Shaft};

    /// Where a line is steepest, its inverse is as steep as the bound says.
    #[test]
    fn the_steepness_is_that_of_the_inverse() {
        for slope in [0.05, 0.4f64] {
            let shaft = Shaft {
                cycles: 1.0,
                orders: vec![1],
                cosine: vec![0.0],
                sine: vec![-slope.to_degrees()],
            };
            let series = HarmonicSeries::new(360.0, 0.0, vec![shaft]).unwrap();
            let evaluator = Arc::new(Evaluator::new(series, Argument::Reference));
            let terms = Terms::new(Arc::clone(&evaluator), &[]).unwrap();
            // x - slope x around 0: its inverse rises by 1 / (1 - slope).
            let rise = evaluator.correct_one(1e-3) / 1e-3;
            assert!((terms.steepness / (rise - 1.0) - 1.0).abs() < 1e-6);
        }
    }
}
