//! A series and its terms, made ready: what they add, and the angle at which that adds up.

use std::sync::Arc;

use super::form::{Form, Line, Smooth, Term, lines_of};
use super::signals::{Signal, Signals};
use super::travel::{Element, Heading, Travel};
use crate::compensator::Compensator;
use crate::error::Error;
use crate::kernel::{Argument, Evaluator};
use crate::series::HarmonicSeries;

/// Steps before the signals are taken to leave no unique angle; as a rule two or three do.
const MOST_STEPS: usize = 60;

/// Part of a period that steps yet to come may add up to; corrections promise 1e-12.
const SOLVED: f64 = 3e-13;

/// A series and its terms: immutable, shared by its correctors.
#[derive(Debug)]
pub struct Terms {
    pub(super) evaluator: Arc<Evaluator>,
    pub(super) plain: Compensator,
    smooth: Vec<Smooth>,
    pub(super) is_shaped: bool,
    /// Half of the play, and how it varies with the place.
    pub(super) play: f64,
    place: Option<HarmonicSeries>,
    pub(super) elements: Vec<Element>,
    pub(super) has_travel: bool,
    pub(super) delay: f64,
    /// Bound of the slope of the inverted series less 1.
    steepness: f64,
    /// Signals needed, each with the first term that needs it.
    needs: Vec<(Signal, String)>,
}

impl Terms {
    /// Refuses numbers that are not finite, and terms that leave no unique correction.
    pub fn new(evaluator: Arc<Evaluator>, terms: &[Term]) -> Result<Self, Error> {
        let period = evaluator.series().period().value();
        let mut ready = Self {
            plain: Compensator::new(Arc::clone(&evaluator))?,
            evaluator,
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
            ready.smooth.extend(Smooth::new(form, period)?);
            if let Some(signal) = form.needs()
                && ready.needs.iter().all(|(known, _)| *known != signal)
            {
                ready.needs.push((signal, name.clone()));
            }
        }
        ready.place = lines_of(&places, period)?;
        ready.is_shaped = ready.smooth.iter().any(Smooth::is_shaped);
        // |dz/ds| reaches 2/length, just after a reversal.
        let steepest: f64 = ready
            .elements
            .iter()
            .map(|element| 2.0 * element.amplitude.abs() / element.length)
            .sum::<f64>()
            + ready
                .place
                .as_ref()
                .map_or(0.0, HarmonicSeries::slope_bound);
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

    pub(super) fn level(&self, signals: &Signals) -> f64 {
        self.smooth.iter().map(|term| term.level(signals)).sum()
    }

    pub(super) fn delayed(&self, signals: &Signals) -> f64 {
        match signals.get(Signal::Velocity) {
            Some(velocity) if self.delay != 0.0 => velocity * self.delay,
            _ => 0.0,
        }
    }

    pub(super) fn check(&self, given: impl Fn(Signal) -> bool) -> Result<(), Error> {
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

    pub(super) fn shape(&self, signals: &Signals, x: f64) -> (f64, f64) {
        let series = self.evaluator.series();
        self.smooth
            .iter()
            .map(|term| term.shape(signals, series, x))
            .fold((0.0, 0.0), |(e, de), (f, df)| (e + f, de + df))
    }

    /// How much wider the play is at a place than on average, and its slope.
    pub(super) fn place(&self, x: f64) -> (f64, f64) {
        self.place
            .as_ref()
            .map_or((0.0, 0.0), |place| place.evaluate(x))
    }

    /// `x` with `x + series(x) + terms(x) = goal`, NaN where the signals leave no unique
    /// angle.
    ///
    /// Newton steps on the terms around the inverse of the series shrink by the product of
    /// both slopes; the shrinking seen is carried on to its limit (Aitken).
    pub(super) fn find(
        &self,
        travel: &Travel,
        heading: Heading,
        goal: f64,
        invert: bool,
        signals: &Signals,
    ) -> f64 {
        let goal = goal - self.play * heading.direction;
        let inverse = |goal: f64| if invert { self.plain.step(goal) } else { goal };
        if !self.is_shaped && self.elements.is_empty() && self.place.is_none() {
            return inverse(goal);
        }
        let at = |x: f64| {
            let (mut error, mut slope) = self.shape(signals, x);
            if self.place.is_some() {
                let (wider, rise) = self.place(x);
                error += heading.direction * wider;
                slope += heading.direction * rise;
            }
            if !self.elements.is_empty() {
                let (friction, rise) = travel.friction(&self.elements, heading, x);
                error += friction;
                slope += rise;
            }
            (error, slope)
        };
        let tolerance = SOLVED * self.period() + 4.0 * f64::EPSILON * goal.abs();
        let mut x = goal;
        if invert {
            // The series is small beside the lengths on which terms change: a good start.
            x = inverse(goal - at(goal - self.evaluator.series().constant()).0);
        }
        let mut last = f64::NAN;
        for _ in 0..MOST_STEPS {
            let (error, slope) = at(x);
            let step = (inverse(goal - error) - x) / (1.0 + slope);
            let ratio = step / last;
            x += step;
            if ratio.abs() < 0.5 {
                x += step * ratio / (1.0 - ratio);
            }
            // What is left is smaller by both slopes, and as much as was seen (NaN at first).
            let shrink = (slope * self.steepness).abs().max(ratio.abs());
            let seen = !ratio.is_nan();
            if step.abs() <= tolerance || (seen && step.abs() * shrink <= tolerance) {
                return if slope.abs() < 1.0 { x } else { f64::NAN };
            }
            last = step;
        }
        f64::NAN
    }
}
