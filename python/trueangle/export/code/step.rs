// Parts of a step at run time (ruststep.py), each behind the line with its name.

//@ helpers
fn pattern(place: i64) -> i64 {
    correct_unwrapped((place >> 32) as i32, place as u32)
}

#[allow(dead_code)]
fn to_turns(angle: i64) -> f32 {
    angle as f32 * 2.328_306_4e-10
}

/// Turns as an angle.
fn to_angle(turns: f32) -> i64 {
    let units = turns * 4_294_967_296.0;
    (if units < 0.0 { units - 0.5 } else { units + 0.5 }) as i64
}

/// A place of a shaft: turns per turn and per 2^-32 turns, modulo one, times 2^64.
#[allow(dead_code)]
fn place(x: i64, turns: u64, fraction: u64) -> u32 {
    let whole = ((x >> 32) as u64).wrapping_mul(turns);
    (whole.wrapping_add(u64::from(x as u32).wrapping_mul(fraction)) >> 32) as u32
}

/// The sine of 2^-32 turns: a polynomial over the quarters beside the zero.
#[allow(dead_code)]
fn sine(phase: u32) -> f32 {
    let far = phase.wrapping_add(0x4000_0000) & 0x8000_0000 != 0;
    let folded = if far { 0x8000_0000_u32.wrapping_sub(phase) } else { phase };
    let t = folded as i32 as f32 * 1.462_918_1e-9;
    let s = t * t;
    t + t * s
        * (-0.166_666_67
            + s * (8.333_333e-3
                + s * (-1.984_127e-4 + s * (2.755_731_9e-6 + s * -2.505_210_8e-8))))
}

//@ decay
/// `exp(-way)` of a way that is not negative.
fn decay(way: f32) -> f32 {
    if !(way < 80.0) {
        return 0.0;
    }
    let mut n = (way * 1.442_695 + 0.5) as i32;
    let rest = (n as f32 * 0.693_145_75 - way) + n as f32 * 1.428_606_8e-6;
    let mut value = 1.0
        + rest * (1.0
            + rest * (0.5
                + rest * (0.166_666_67
                    + rest * (4.166_666_7e-2
                        + rest * (8.333_333e-3
                            + rest * (1.388_888_9e-3 + rest * 1.984_127e-4))))));
    while n >= 16 {
        value *= 1.525_878_9e-5;
        n -= 16;
    }
    value / (1_u32 << n) as f32
}

//@ waves
/// Lines C sin(m x + phase).
fn waves(x: i64, lines: &[(u64, u64, u32, f32)]) -> f32 {
    let mut sum = 0.0_f32;
    for &(turns, fraction, phase, size) in lines {
        sum += size * sine(place(x, turns, fraction).wrapping_add(phase));
    }
    sum
}

//@ bent
/// Wind-up under a load, softer or stiffer beyond a knee.
fn bent(m: f32, linear: f32, cubic: f32, beyond: f32, knee: f32) -> f32 {
    let past = if m > knee { m - knee } else if m < -knee { m + knee } else { 0.0 };
    linear * m + cubic * m * m * m + beyond * past
}

//@ find
/// The angle x with x + pattern + error = goal: secants around the table.
fn find(goal: i64, signals: &Signals, direction: i8@more@) -> i64 {
    let solved = |x: i64| @solved@;
    let mut before = goal - (@zero@);
    let mut x = solved(before);
    let mut off_before = before - x;
    for _ in 0..20 {
        let (off, moved) = (x - solved(x), x - before);
        if off.abs() <= 1 || moved == 0 {
            return x - off;
        }
        let slope = (off - off_before) as f32 / moved as f32;
        let slope = if slope > 0.015625 { if slope < 2.0 { slope } else { 2.0 } } else { 0.015625 };
        (before, off_before) = (x, off);
        x -= (off as f32 / slope) as i64;
    }
    x
}

//@ find at once
/// The angle x with x + pattern + error = goal: the error is the same at every angle.
fn find(goal: i64, signals: &Signals, direction: i8@more@) -> i64 {
    let x = goal;
    @solved@
}

//@ good
/// A signal within its limit, or the last one that was.
fn good(value: f32, limit: f32, last: f32) -> f32 {
    if value >= -limit && value <= limit { value } else { last }
}

//@ held
state.good = Signals {
    @fields@
};
let signals = &{ state.good };

//@ step unwrapped
/// The true angle behind the next reading, with the whole turns of both, in 2^-32 turns.
pub fn step_unwrapped(state: &mut State, turns: i32, raw: u32, signals: &Signals) -> i64 {
    let reading = reading(turns, raw);
    @held@
    let goal = @start@ - to_angle(level(signals));
    seen(state, reading, goal, signals)@late@
}

//@ step
/// The true angle behind the next reading.
pub fn step(state: &mut State, raw: u32, signals: &Signals) -> u32 {
    step_unwrapped(state, 0, raw, signals) as u32
}

//@ state
/// What later readings need to know of the past; `State::default()` before the first.
#[derive(Clone, Copy, Debug, Default)]
pub struct State @fields@

//@ stretch
/// Travel in one direction: where it began, and the springs there.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stretch {
    place: i64,
    wound: [f32; @count@],
    direction: i8,
    placed: bool,
}

//@ signals
/// What is known at a reading.
#[derive(Clone, Copy, Debug, Default)]
pub struct Signals @fields@

//@ lines
#[rustfmt::skip]
const @name@: [(u64, u64, u32, f32); @count@] = [
    @rows@
];

//@ sum
fn @name@(@arguments@) -> f32 {
    let mut sum = 0.0_f32;
    @sums@
    sum
}

//@ filter
#[rustfmt::skip]
let rates: [f32; @count@] = [@rates@];
for (rate, &(turns, fraction, phase, size)) in rates.iter().zip(&@name@) {
    let w = signals.velocity * @period@ * rate;
    @gain@
    let phase = place(x, turns, fraction).wrapping_add(phase);
    sum += size * (real * sine(phase)
        + imaginary * sine(phase.wrapping_add(0x4000_0000)));
}

//@ low-pass gain
let inverse = 1.0 / (1.0 + w * w);
let (real, imaginary) = (-w * w * inverse, -w * inverse);

//@ damped gain
let (stiff, loss) = (1.0 - w * w, @loss@ * w);
let inverse = 1.0 / (stiff * stiff + loss * loss);
let (real, imaginary) = (stiff * inverse - 1.0, -loss * inverse);

//@ bump
{
    let away = place(x, @turns@, @fraction@).wrapping_sub(@centre@) as i32 as f32 * @slope@;
    sum += @height@ * decay(0.5 * away * away);
}

//@ springs
impl Stretch {
    fn way(&self, x: i64) -> f32 {
        let gone = (x - self.place) * i64::from(self.direction);
        if self.placed && gone > 0 { to_turns(gone) } else { 0.0 }
    }

    /// Error of the springs at x.
    fn wound(&self, x: i64) -> f32 {
        let (d, way) = (f32::from(self.direction), self.way(x));
        let mut sum = 0.0_f32;
        @wound@
        sum
    }

    /// The stretch that begins at the farthest angle.
    fn next(&self, direction: i8, place: i64, placed: bool) -> Self {
        let (d, way) = (f32::from(self.direction), self.way(place));
        let wound = [
        @begun@
        ];
        Self { place, wound, direction, placed }
    }
}

//@ wound
sum += @amplitude@
    * (d - (d - self.wound[@i@]) * decay(way * @slope@));

//@ begun
if self.direction == 0 {
    @start@ * f32::from(direction)
} else {
    d - (d - self.wound[@i@]) * decay(way * @slope@)
},

//@ advance
/// Moves on to x: coming back without having turned is noise and counts as no way.
fn advance(state: &mut State, direction: i8, x: i64) {
    let (beyond, fresh) = ((x - state.farthest) * i64::from(direction), !state.known);
    if direction != @held@ {
        if fresh || (direction == -@held@ && beyond < 0) {
            (state.farthest, state.known) = (x, true);
        }
        @begin@
    }
    if fresh || beyond > 0 {
        (state.farthest, state.known) = (x, true);
    }
}

//@ seen at once
/// The angle that the encoder saw.
fn seen(_: &mut State, _reading: i64, goal: i64, signals: &Signals) -> i64 {
    find(goal, signals, 0)
}

//@ seen
fn seen(state: &mut State, reading: i64, goal: i64, signals: &Signals) -> i64 {
    const HALF: i64 = 1 << 31;
    let away = reading - (@zero@) - state.farthest;
    if state.known && away.abs() > HALF {
        let turns = (away + HALF) & !0xFFFF_FFFF;
        state.farthest += turns;
        @moved@
    }

//@ ahead
let ahead = if direction == @held@ { state.stretch } else {
    state.stretch.next(direction, state.farthest, state.known)
};

//@ seen by angle
/// The angle that the encoder saw; the joint has moved where it leaves the band of the play.
@seen@
    if !state.known {
        @fresh@
        let x = find(goal, signals, 0@given@);
        advance(state, 0, x);
        return x;
    }
    let first: i8 = if @held@ < 0 { -1 } else { 1 };
    for direction in [first, -first] {
        @ahead@
        let x = find(goal, signals, direction@given@);
        if (x - state.farthest) * i64::from(direction) >= 0 {
            advance(state, direction, x);
            return x;
        }
    }
    state.farthest
}

//@ seen by signal
/// The angle that the encoder saw, travelling as the @way@ says.
@seen@
    let sign = i8::from(signals.@way@ > @nothing@) - i8::from(signals.@way@ < @nothing@);
    let direction = if sign != 0 { sign } else { @held@ };
    @ahead@
    let @mutable@x = find(goal, signals, direction@given@);
    @behind@
    advance(state, direction, x);
    x
}

//@ behind
if state.known && (x - state.farthest) * i64::from(direction) <= 0 {
    // It did not go on: the springs are what they were or, while turning, go on.
    x = if direction == -state.stretch.direction {
        find(goal, signals, direction, Some(&state.stretch), 0.0)
    } else {
        let held = state.stretch.wound(state.farthest);
        find(goal, signals, direction, None, held)
    };
}
