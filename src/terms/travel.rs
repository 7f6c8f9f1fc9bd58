//! Travel since the last reversal and what it leaves in the springs of friction.

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

/// What travel so far has left behind.
#[derive(Clone, Debug)]
pub(super) struct Travel {
    /// The farthest angle reached in the present direction; NaN before the first sample.
    pub farthest: f64,
    /// -1 or +1; 0 before the first motion.
    pub direction: f64,
    /// State of every element there, in [-1, 1].
    state: Vec<f64>,
}

impl Travel {
    pub fn new(elements: usize) -> Self {
        Self {
            farthest: f64::NAN,
            direction: 0.0,
            state: vec![0.0; elements],
        }
    }

    /// Everything as plain numbers; `restored` takes them back.
    pub fn store(&self) -> Vec<f64> {
        let mut numbers = vec![self.farthest, self.direction];
        numbers.extend(&self.state);
        numbers
    }

    /// Travel with the numbers of another over as many elements; None when they are not.
    pub fn restored(&self, numbers: &[f64]) -> Option<Self> {
        let (&[farthest, direction], state) = numbers.split_first_chunk()?;
        (state.len() == self.state.len()).then(|| Self {
            farthest,
            direction,
            state: state.to_vec(),
        })
    }

    pub fn is_known(&self) -> bool {
        !self.farthest.is_nan()
    }

    /// Counts turns as `angle` does: steps between samples are below half a turn.
    pub fn align(&mut self, angle: f64, period: f64) {
        let turns = ((angle - self.farthest) / period).round_ties_even();
        if turns != 0.0 && !turns.is_nan() {
            self.farthest += turns * period;
        }
    }

    /// Heading for a signed direction signal; 0 keeps the last one.
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

    /// Error of all elements at angle `x`, and its slope.
    pub fn friction(&self, elements: &[Element], heading: Heading, x: f64) -> (f64, f64) {
        let (mut sum, mut slope) = (0.0, 0.0);
        let (way, towards) = self.way(heading, x);
        for (element, &state) in elements.iter().zip(&self.state) {
            let left = (towards - self.begun(element, state, heading)) * decay(way, element);
            sum += element.amplitude * (towards - left);
            slope += element.amplitude * left / element.length;
        }
        (sum, if way > 0.0 { slope * towards } else { 0.0 })
    }

    /// Moves on to angle `x`.
    pub fn advance(&mut self, elements: &[Element], heading: Heading, x: f64) {
        let (way, towards) = self.way(heading, x);
        for (i, element) in elements.iter().enumerate() {
            let state = self.begun(element, self.state[i], heading);
            self.state[i] = towards - (towards - state) * decay(way, element);
        }
        if way > 0.0 || !self.is_known() {
            self.farthest = x;
        }
        self.direction = heading.direction;
    }

    /// The state before this way: the first motion finds some wind-up in its direction.
    fn begun(&self, element: &Element, state: f64, heading: Heading) -> f64 {
        if self.direction == 0.0 {
            element.start * heading.direction
        } else {
            state
        }
    }

    /// Way from the farthest point to `x`, and the direction it pulls the elements to.
    ///
    /// Coming back without having turned is noise of the reading and counts as no way;
    /// going on while turning belongs to the old direction.
    fn way(&self, heading: Heading, x: f64) -> (f64, f64) {
        let way = (x - self.farthest) * heading.direction;
        if way > 0.0 {
            (way, heading.direction)
        } else if heading.turned && way < 0.0 {
            (-way, -heading.direction)
        } else {
            (0.0, heading.direction)
        }
    }
}

fn decay(way: f64, element: &Element) -> f64 {
    if way > 0.0 {
        (-way / element.length).exp()
    } else {
        1.0
    }
}
