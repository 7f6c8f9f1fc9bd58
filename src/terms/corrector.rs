//! Correction by a series and its terms, sample by sample, with the state it needs.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::form::{Form, Line, Smooth, Term, lines_of};
use super::signals::{Columns, Signal, Signals};
use super::travel::{Element, Heading, Travel};
use crate::compensator::Compensator;
use crate::error::Error;
use crate::kernel::{
    Argument, Batch, Evaluator, InstructionSet, Quantity, Real, Sample, Shared, Stretch,
};
use crate::series::HarmonicSeries;
use crate::{interrupt, threads};

/// Samples that are corrected between two looks at the clock, and by one thread at a time.
const PART: usize = 4096;

/// Samples from which threads are worth starting: each takes longer than by a table.
const THREADED: usize = 1 << 14;

/// Steps before the signals are taken to leave no unique angle; as a rule two or three do.
const MOST_STEPS: usize = 60;

/// Part of a period that steps yet to come may add up to; corrections promise 1e-12.
const SOLVED: f64 = 3e-13;

/// A series and its terms: immutable, shared by its correctors.
#[derive(Debug)]
pub struct Terms {
    evaluator: Arc<Evaluator>,
    plain: Compensator,
    smooth: Vec<Smooth>,
    is_shaped: bool,
    /// Half of the play, and how it varies with the place.
    play: f64,
    place: Option<HarmonicSeries>,
    elements: Vec<Element>,
    has_travel: bool,
    delay: f64,
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
        let slope = steepest + bound;
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

    fn level(&self, signals: &Signals) -> f64 {
        self.smooth.iter().map(|term| term.level(signals)).sum()
    }

    fn delayed(&self, signals: &Signals) -> f64 {
        match signals.velocity {
            Some(velocity) if self.delay != 0.0 => velocity * self.delay,
            _ => 0.0,
        }
    }

    fn check(&self, given: impl Fn(Signal) -> bool) -> Result<(), Error> {
        for &(signal, ref term) in &self.needs {
            let implied = signal == Signal::Direction && given(Signal::Velocity);
            if !implied && !given(signal) {
                return Err(Error::MissingSignal {
                    signal: signal.name(),
                    term: term.clone(),
                });
            }
        }
        Ok(())
    }
}

/// Corrects samples in the order they were taken.
#[derive(Clone, Debug)]
pub struct Corrector {
    terms: Arc<Terms>,
    travel: Travel,
}

impl Corrector {
    /// A corrector that knows nothing of the past.
    pub fn new(terms: Arc<Terms>) -> Self {
        let travel = Travel::new(terms.elements.len());
        Self { terms, travel }
    }

    /// The series and its terms.
    pub fn terms(&self) -> &Arc<Terms> {
        &self.terms
    }

    /// Forgets the past.
    pub fn reset(&mut self) {
        self.travel = Travel::new(self.terms.elements.len());
    }

    /// The past as plain numbers.
    pub fn store(&self) -> Vec<f64> {
        self.travel.store()
    }

    /// Takes over the past of a corrector of the same terms; false when it is not one.
    pub fn restore(&mut self, numbers: &[f64]) -> bool {
        let found = self.travel.restored(numbers);
        let is_one = found.is_some();
        self.travel = found.unwrap_or_else(|| self.travel.clone());
        is_one
    }

    /// The true angle behind an indicated one; NaN for what is not finite, which leaves
    /// the state alone.
    pub fn correct(&mut self, indicated: f64, signals: &Signals) -> Result<f64, Error> {
        self.terms.check(|signal| signals.get(signal).is_some())?;
        Ok(self.solve(indicated, signals))
    }

    /// Error at the true angle `theta` (at the indicated one where that is the argument).
    pub fn error(&mut self, theta: f64, signals: &Signals) -> Result<f64, Error> {
        self.terms.check(|signal| signals.get(signal).is_some())?;
        Ok(self.indicate(theta, signals))
    }

    /// `correct` of many samples, or `error` of them; returns how many results lie outside
    /// a stretch.
    ///
    /// Where the work is called off the state is that of before.
    pub fn run<X: Sample, Y: Real>(
        &mut self,
        quantity: Quantity,
        batch: Batch<'_, X, Y>,
        columns: &Columns<'_>,
        threads: Option<usize>,
        stretch: Option<&Stretch>,
    ) -> Result<usize, Error> {
        let len = batch.len();
        columns.check(len)?;
        self.terms.check(|signal| columns.of(signal).is_some())?;
        let outside = AtomicUsize::new(0);
        let shared = Shared::new(batch);
        let part = |corrector: &mut Self, i: usize| {
            let start = i * PART;
            let some = PART.min(len - start);
            // SAFETY: parts lie within the batch, and each is taken once.
            let (part, results) = unsafe {
                let batch = shared.get();
                (batch.part(start, some), batch.part(start, some))
            };
            corrector.run_part(quantity, part, columns, start);
            if let Some(stretch) = stretch {
                let count = stretch.outside(InstructionSet::best(), results);
                outside.fetch_add(count, Ordering::Relaxed);
            }
        };
        let parts = len.div_ceil(PART);
        if self.terms.has_travel {
            let mut own = self.clone();
            for i in 0..parts {
                part(&mut own, i);
                interrupt::point();
            }
            *self = own;
        } else {
            let few = || {
                if len < THREADED {
                    1
                } else {
                    threads::available()
                }
            };
            let threads = threads.unwrap_or_else(few);
            threads::for_each_part(parts, threads, |i| part(&mut self.clone(), i));
        }
        Ok(outside.into_inner())
    }

    /// Samples `start..` of all.
    fn run_part<X: Sample, Y: Real>(
        &mut self,
        quantity: Quantity,
        mut batch: Batch<'_, X, Y>,
        columns: &Columns<'_>,
        start: usize,
    ) {
        let terms = Arc::clone(&self.terms);
        let alone = !terms.has_travel && !terms.is_shaped && !terms.is_indicated();
        let mut at = start..;
        let mut next = || columns.at(at.next().unwrap_or_default());
        if quantity != Quantity::Correction {
            batch.map(|x| Y::narrow(self.indicate(x.widen(), &next())));
        } else if !alone {
            batch.map(|x| Y::narrow(self.solve(x.widen(), &next())));
        } else {
            // The terms do not depend on the angle: many samples at once.
            let mut done = start;
            batch.map_blocks(|x, y| {
                for (i, (x, y)) in x.iter().zip(y.iter_mut()).enumerate() {
                    *y = x - terms.level(&columns.at(done + i));
                }
                let all = Batch::in_place(&mut *y);
                let corrected = terms
                    .evaluator
                    .run(Quantity::Correction, None, Some(1), all);
                debug_assert!(
                    corrected.is_ok(),
                    "`Terms::new` refuses what cannot be inverted"
                );
                if terms.delay != 0.0 {
                    for (i, y) in y.iter_mut().enumerate() {
                        *y += terms.delayed(&columns.at(done + i));
                    }
                }
                done += x.len();
            });
        }
    }

    fn solve(&mut self, indicated: f64, signals: &Signals) -> f64 {
        let Self { terms, travel } = self;
        let (level, delayed) = (terms.level(signals), terms.delayed(signals));
        // The series is undone first where its argument is the indicated angle.
        let (goal, invert) = if terms.is_indicated() {
            (terms.plain.step(indicated) - level, false)
        } else {
            (indicated - level, true)
        };
        if !(goal + delayed).is_finite() {
            return f64::NAN;
        }
        if !terms.has_travel && !terms.is_shaped {
            return delayed + if invert { terms.plain.step(goal) } else { goal };
        }
        let find =
            |travel: &Travel, heading: Heading| terms.find(travel, heading, goal, invert, signals);
        if !terms.has_travel {
            return delayed + find(travel, NOWHERE);
        }
        let constant = terms.evaluator.series().constant();
        travel.align(indicated - constant, terms.period());
        if let Some(signal) = signals.direction.or(signals.velocity) {
            let heading = travel.heading(signal);
            let x = find(travel, heading);
            if x.is_nan() || signal.is_nan() {
                return f64::NAN;
            }
            travel.advance(&terms.elements, heading, x);
            return x + delayed;
        }
        if !travel.is_known() {
            let x = find(travel, NOWHERE);
            if !x.is_nan() {
                travel.advance(&terms.elements, NOWHERE, x);
            }
            return x + delayed;
        }
        // Play: the joint has moved where the angle leaves the band of the play.
        let first = if travel.direction < 0.0 { -1.0 } else { 1.0 };
        for direction in [first, -first] {
            let heading = travel.heading(direction);
            let x = find(travel, heading);
            if x.is_nan() {
                return x;
            }
            if (x - travel.farthest) * direction >= 0.0 {
                travel.advance(&terms.elements, heading, x);
                return x + delayed;
            }
        }
        travel.farthest + delayed
    }

    fn indicate(&mut self, theta: f64, signals: &Signals) -> f64 {
        if self.terms.is_indicated() {
            return theta - self.solve(theta, signals);
        }
        let Self { terms, travel } = self;
        let delayed = terms.delayed(signals);
        let x = theta - delayed;
        let mut value = [x];
        let done = terms
            .evaluator
            .run(Quantity::Error, None, Some(1), Batch::in_place(&mut value));
        debug_assert!(done.is_ok(), "an error can always be evaluated");
        let mut error = value[0] + terms.level(signals) + terms.shape(signals, x).0;
        if terms.has_travel && error.is_finite() {
            travel.align(x, terms.period());
            let way = x - travel.farthest;
            let moved = if way.is_nan() { 0.0 } else { way };
            let signal = signals.direction.or(signals.velocity).unwrap_or(moved);
            if signal.is_nan() {
                return f64::NAN;
            }
            let heading = travel.heading(signal);
            error += heading.direction * (terms.play + terms.place(x).0)
                + travel.friction(&terms.elements, heading, x).0;
            travel.advance(&terms.elements, heading, x);
        }
        error - delayed
    }
}

/// Before the first motion.
const NOWHERE: Heading = Heading {
    direction: 0.0,
    turned: false,
};

impl Terms {
    fn is_indicated(&self) -> bool {
        self.evaluator.argument() == Argument::Indicated
    }

    fn period(&self) -> f64 {
        self.evaluator.series().period().value()
    }

    fn shape(&self, signals: &Signals, x: f64) -> (f64, f64) {
        let series = self.evaluator.series();
        self.smooth
            .iter()
            .map(|term| term.shape(signals, series, x))
            .fold((0.0, 0.0), |(e, de), (f, df)| (e + f, de + df))
    }

    /// How much wider the play is at a place than on average, and its slope.
    fn place(&self, x: f64) -> (f64, f64) {
        self.place
            .as_ref()
            .map_or((0.0, 0.0), |place| place.evaluate(x))
    }

    /// `x` with `x + series(x) + terms(x) = goal`, NaN where the signals leave no unique
    /// angle.
    ///
    /// Newton steps on the terms around the inverse of the series shrink by the product of
    /// both slopes; the shrinking seen is carried on to its limit (Aitken).
    fn find(
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
