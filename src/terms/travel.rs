//! Travel since the last reversal and what it leaves in the springs of friction.

use super::exponential::exp;

/// What travel adds to the error.
pub(super) struct Pull<'a> {
    /// Of travel at each reading.
    pub direction: &'a [f64],
    /// Of the elements of friction.
    pub friction: Friction<'a>,
}

/// Error of the elements of friction.
pub(super) enum Friction<'a> {
    /// There are none.
    None,
    /// It follows the angle from a place on, and is there what it was.
    From {
        place: f64,
        direction: f64,
        state: &'a [f64],
    },
    /// At each reading, whatever the angle.
    Held(&'a [f64]),
}

/// One presliding element: `z` relaxes towards the direction of travel over a length.
#[derive(Clone, Copy, Debug)]
pub(super) struct Element {
    pub amplitude: f64,
    pub length: f64,
    /// Share of the wind-up that is there at the first motion.
    pub start: f64,
}

/// A direction of travel, and whether the joint has just turned into it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heading {
    pub direction: f64,
    pub turned: bool,
}

/// Before the first motion.
pub(super) const NOWHERE: Heading = Heading {
    direction: 0.0,
    turned: false,
};

/// What travel so far has left behind.
///
/// The elements change with the way from the last reversal alone, so that they are kept as
/// they were there: nothing adds up from reading to reading.
#[derive(Clone, Debug)]
pub(super) struct Travel {
    /// The farthest angle reached in the present direction; NaN before the first sample.
    pub farthest: f64,
    /// -1 or +1; 0 before the first motion.
    pub direction: f64,
    /// Where it was turned into.
    reversal: f64,
    /// State of every element there, in [-1, 1].
    state: Vec<f64>,
    /// Likewise of a stretch that may begin.
    next: Vec<f64>,
}

impl Travel {
    pub fn new(elements: usize) -> Self {
        Self {
            farthest: f64::NAN,
            direction: 0.0,
            reversal: f64::NAN,
            state: vec![0.0; elements],
            next: vec![0.0; elements],
        }
    }

    /// Everything as plain numbers; `restored` takes them back.
    pub fn store(&self) -> Vec<f64> {
        let mut numbers = vec![self.farthest, self.direction, self.reversal];
        numbers.extend(&self.state);
        numbers
    }

    /// Travel with the numbers of another over as many elements; None when they are not.
    pub fn restored(&self, numbers: &[f64]) -> Option<Self> {
        let (&[farthest, direction, reversal], state) = numbers.split_first_chunk()?;
        (state.len() == self.state.len()).then(|| Self {
            farthest,
            direction,
            reversal,
            state: state.to_vec(),
            next: self.next.clone(),
        })
    }

    pub fn is_known(&self) -> bool {
        !self.farthest.is_nan()
    }

    /// Counts turns as `angle` does: steps between samples are below half a turn. True
    /// where that moved what is known.
    #[inline]
    pub fn align(&mut self, angle: f64, period: f64) -> bool {
        let away = angle - self.farthest;
        if away.abs() <= 0.5 * period {
            return false;
        }
        let turns = (away / period).round_ties_even();
        let moves = turns != 0.0 && !turns.is_nan();
        if moves {
            self.farthest += turns * period;
            self.reversal += turns * period;
        }
        moves
    }

    /// Heading for a signed direction signal; 0 keeps the last one.
    #[inline]
    pub fn heading(&self, signal: f64) -> Heading {
        let direction = if signal == 0.0 {
            self.direction
        } else {
            signal.signum()
        };
        Heading {
            direction,
            turned: direction == -self.direction,
        }
    }

    /// True where `x` is beyond the farthest angle.
    #[inline]
    pub fn goes_on(&self, heading: Heading, x: f64) -> bool {
        (x - self.farthest) * heading.direction > 0.0
    }

    /// State of an element at `x` in the present stretch.
    #[inline]
    fn wound(&self, element: &Element, begun: f64, x: f64) -> f64 {
        let way = (x - self.reversal) * self.direction;
        let way = if way > 0.0 { way } else { 0.0 };
        self.direction - (self.direction - begun) * exp(-way * (1.0 / element.length))
    }

    /// Error of all elements at the farthest angle.
    #[inline]
    pub fn held(&self, elements: &[Element]) -> f64 {
        let mut sum = 0.0;
        for (element, &begun) in elements.iter().zip(&self.state) {
            sum += element.amplitude * self.wound(element, begun, self.farthest);
        }
        sum
    }

    /// Friction along the present stretch.
    #[inline]
    pub fn along(&self) -> Friction<'_> {
        if self.state.is_empty() {
            return Friction::None;
        }
        Friction::From {
            place: self.reversal,
            direction: self.direction,
            state: &self.state,
        }
    }

    /// Friction along the stretch that a heading goes on with, or begins at the farthest
    /// angle.
    #[inline]
    pub fn ahead(&mut self, elements: &[Element], heading: Heading) -> Friction<'_> {
        if self.state.is_empty() || heading.direction == self.direction {
            return self.along();
        }
        self.begin(elements, heading, self.farthest);
        Friction::From {
            place: self.farthest,
            direction: heading.direction,
            state: &self.next,
        }
    }

    /// States of a stretch that begins at `place`: those there, or the wind-up that the first
    /// motion finds in its direction.
    #[inline]
    fn begin(&mut self, elements: &[Element], heading: Heading, place: f64) {
        for (i, element) in elements.iter().enumerate() {
            self.next[i] = if self.direction == 0.0 {
                element.start * heading.direction
            } else {
                self.wound(element, self.state[i], place)
            };
        }
    }

    /// Moves on to angle `x`.
    ///
    /// Coming back without having turned is noise of the reading and counts as no way;
    /// going on while turning belongs to the old direction.
    #[inline]
    pub fn advance(&mut self, elements: &[Element], heading: Heading, x: f64) {
        let goes_on = self.goes_on(heading, x);
        if heading.direction != self.direction {
            let still_went_on = heading.turned && (x - self.farthest) * heading.direction < 0.0;
            if still_went_on || !self.is_known() {
                self.farthest = x;
            }
            self.begin(elements, heading, self.farthest);
            std::mem::swap(&mut self.state, &mut self.next);
            self.reversal = self.farthest;
            self.direction = heading.direction;
        }
        if goes_on || !self.is_known() {
            self.farthest = x;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of all angles whole turns off, the one within half a turn; the reversal goes along.
    #[test]
    fn turns_are_counted_as_the_angle_counts_them() {
        let period = 8.0;
        for step in -400..=400 {
            // Everything is exact in binary; half a turn either side is not told apart.
            let (angle, farthest) = (3.25 + 0.125 * f64::from(step), 2.5);
            let mut travel = Travel::new(0);
            (travel.farthest, travel.reversal) = (farthest, 1.0);
            let moved = travel.align(angle, period);
            let turns = (travel.farthest - farthest) / period;
            assert_eq!(turns, turns.round(), "{angle}");
            assert!((angle - travel.farthest).abs() <= 0.5 * period, "{angle}");
            assert_eq!(travel.reversal - 1.0, turns * period, "{angle}");
            assert_eq!(moved, turns != 0.0, "{angle}");
        }
    }

    #[test]
    fn an_angle_that_is_not_known_moves_nothing() {
        let mut unknown = Travel::new(0);
        assert!(!unknown.align(1e9, 360.0) && !unknown.is_known());
        unknown.farthest = 1.0;
        assert!(!unknown.align(f64::NAN, 360.0));
        assert_eq!(unknown.farthest, 1.0);
    }
}
