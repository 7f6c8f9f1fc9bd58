"""The Rust of terms at run time: the same step as in C, without std."""

from __future__ import annotations

from ..model import forms
from ..model.forms import Form
from .runtimeterms import RunTimeTerms, Waves
from .rusttravel import rust_advance, rust_number, rust_seen_angle, rust_springs
from .table import TURN, ratio_of_cycles

__all__ = ["rust_step"]

_DOCS = {
    "velocity": "Turns of the output per second.",
    "temperature": "Degrees Celsius.",
    "torque": "Nm at the output.",
    "current": "A of the motor.",
}


def rust_step(terms: RunTimeTerms, zero: int, at_indicated: bool, whole: bool) -> str:
    """State, signals and step of a module; it has ``correct_unwrapped`` before."""
    parts = [_state(terms), _HELPERS]
    if terms.springs or any(isinstance(form, forms.Bump) for form in terms.smooth):
        parts.append(_DECAY)
    tables, level, shape = [], [], []
    for i, (form, waves) in enumerate(zip(terms.smooth, terms.waves, strict=True)):
        if waves.orders:
            tables.append(_lines(f"LINES{i}", waves))
        one, other = _form(form, waves, f"LINES{i}")
        level += one
        shape += other
    play = [rust_number(terms.play)] if terms.play else []
    if terms.places.orders:
        tables.append(_lines("PLAY", terms.places))
        play.append("waves(x, &PLAY)")
    if play:
        shape.append(f"sum += f32::from(direction) * ({' + '.join(play)});")
    if terms.springs:
        shape.append("sum += along.map_or(held, |stretch| stretch.wound(x));")
    text = "\n".join(tables + shape + level)
    for needed, code in (("waves(", _WAVES), ("bent(", _BENT)):
        if needed in text:
            parts.append(code)
    parts += tables
    if terms.springs:
        parts.append(rust_springs(terms))
    more = ", along: Option<&Stretch>, held: f32" if terms.springs else ""
    parts.append(_function("level", ("signals: &Signals",), level))
    arguments = ("x: i64", "signals: &Signals", "direction: i8", *more.split(", ")[1:])
    parts.append(_function("error", arguments, shape))
    given = ", along, held" if terms.springs else ""
    solved = f"goal - to_angle(error(x, signals, direction{given}))"
    parts.append(
        (_FIND if terms.shaped else _FIND_AT_ONCE)
        .replace("@more@", more)
        .replace("@solved@", solved if at_indicated else f"pattern({solved})")
        .replace("@zero@", str(0 if at_indicated else zero))
    )
    if terms.travels:
        parts.append(rust_advance(bool(terms.springs)))
    parts.append(rust_seen_angle(terms, zero))
    start = "pattern(reading)" if at_indicated else "reading"
    bumps = [form for form in terms.smooth if isinstance(form, forms.Bump)]
    if at_indicated and bumps:
        # The table holds them at its own angle: what is searched is what they were taken off.
        sums = [line for form in bumps for line in _form(form, Waves((), (), ()), "")[1]]
        parts.append(_function("bumps", ("x: i64",), sums))
        start += " + to_angle(bumps(pattern(reading)))"
    late = f" + to_angle(signals.velocity * {rust_number(terms.delay)})" if terms.delay else ""
    parts.append(_STEP.replace("@start@", start).replace("@late@", late))
    if whole:
        parts.append(_WRAPPED)
    return "\n".join(parts)


def _state(terms: RunTimeTerms) -> str:
    parts = []
    if terms.springs:
        parts.append(
            "/// Travel in one direction: where it began, and the springs there.\n"
            "#[derive(Clone, Copy, Debug, Default)]\npub struct Stretch {\n"
            "    place: i64,\n"
            f"    wound: [f32; {len(terms.springs)}],\n"
            "    direction: i8,\n    placed: bool,\n}\n"
        )
    held = "    stretch: Stretch,\n" if terms.springs else "    direction: i8,\n"
    fields = f"    farthest: i64,\n{held}    known: bool,\n" if terms.travels else ""
    parts.append(
        "/// What later readings need to know of the past; `State::default()` before the first.\n"
        f"#[derive(Clone, Copy, Debug, Default)]\npub struct State {{\n{fields}}}\n".replace(
            "{\n}", "{}"
        )
    )
    rows = [
        f"    /// {_DOCS[name]}\n    pub {name}: f32,\n" for name in terms.signals if name in _DOCS
    ]
    if "direction" in terms.signals:
        rows.append("    /// Of travel: 1, -1, 0 as before.\n    pub direction: i8,\n")
    parts.append(
        "/// What is known at a reading; finite numbers.\n" + _struct("Signals", "".join(rows))
    )
    return "\n".join(parts)


def _struct(name: str, fields: str) -> str:
    body = f"{{\n{fields}}}" if fields else "{}"
    return f"#[derive(Clone, Copy, Debug, Default)]\npub struct {name} {body}\n"


def _lines(name: str, waves: Waves) -> str:
    rows = []
    for m, c, phase in zip(waves.orders, waves.amplitudes, waves.phases, strict=True):
        turns, fraction = ratio_of_cycles(m)
        rows.append(
            f"    ({turns}, {fraction}, {round(phase * TURN) % 2**32}, {rust_number(c)}),\n"
        )
    return (
        f"#[rustfmt::skip]\nconst {name}: [(u64, u64, u32, f32); {len(rows)}] = [\n"
        + "".join(rows)
        + "];\n"
    )


def _function(name: str, arguments: tuple[str, ...], sums: list[str]) -> str:
    used = "\n".join(sums)
    arguments = tuple(
        a if a.split(":")[0] in used.replace("(x,", "x ").replace(".", " ") else f"_{a}"
        for a in arguments
    )
    if not sums:
        return f"fn {name}({', '.join(arguments)}) -> f32 {{\n    0.0\n}}\n"
    body = "\n".join(f"    {line}" for line in sums)
    return (
        f"fn {name}({', '.join(arguments)}) -> f32 {{\n    let mut sum = 0.0_f32;\n{body}\n"
        "    sum\n}\n"
    )


def _form(form: Form, waves: Waves, name: str) -> tuple[list[str], list[str]]:
    """Statements that add to the level, and to the error at ``x``."""
    match form:
        case forms.Scaled():
            value = f"signals.{form.signal}"
            if form.origin:
                value = f"({value} - {rust_number(form.origin)})"
            if form.absolute:
                value = f"f32::max({value}, -{value})"
            level = [f"sum += {rust_number(form.level)} * {value};"] if form.level else []
            return level, [f"sum += {value} * waves(x, &{name});"] if waves.orders else []
        case forms.Spring():
            values = (form.linear, form.cubic, form.beyond, form.knee)
            constants = ", ".join(map(rust_number, values))
            if form.gravity is None:
                return [f"sum += bent(signals.{form.signal}, {constants});"], []
            phase = f"(x as u32).wrapping_sub({round(form.gravity * TURN) % 2**32})"
            return [], [f"sum += bent(signals.{form.signal} * sine({phase}), {constants});"]
        case forms.Filter(frequency, damping):
            if not waves.orders:
                return [], []
            rates = ", ".join(map(rust_number, waves.orders))
            if damping is None:
                gain = [
                    "    let inverse = 1.0 / (1.0 + w * w);",
                    "    let (real, imaginary) = (-w * w * inverse, -w * inverse);",
                ]
            else:
                gain = [
                    f"    let (stiff, loss) = (1.0 - w * w, {rust_number(2.0 * damping)} * w);",
                    "    let inverse = 1.0 / (stiff * stiff + loss * loss);",
                    "    let (real, imaginary) = (stiff * inverse - 1.0, -loss * inverse);",
                ]
            return [], [
                "#[rustfmt::skip]",
                f"let rates: [f32; {len(waves.orders)}] = [{rates}];",
                f"for (rate, &(turns, fraction, phase, size)) in rates.iter().zip(&{name}) {{",
                f"    let w = signals.velocity * {rust_number(1.0 / frequency)} * rate;",
                *gain,
                "    let phase = place(x, turns, fraction).wrapping_add(phase);",
                "    sum += size * (real * sine(phase)",
                "        + imaginary * sine(phase.wrapping_add(0x4000_0000)));",
                "}",
            ]
        case forms.Bump(centre, width, height, cycles):
            turns, fraction = ratio_of_cycles(cycles)
            at = f"place(x, {turns}, {fraction}).wrapping_sub({round(centre % 1.0 * TURN) % 2**32})"
            return [], [
                "{",
                f"    let away = {at} as i32 as f32 * {rust_number(1.0 / width / TURN)};",
                f"    sum += {rust_number(height)} * decay(0.5 * away * away);",
                "}",
            ]
        case forms.Ramp(slope, start, stop):
            first, last, middle = (round(end * TURN) for end in (start, stop, (start + stop) / 2))
            held = f"x.clamp({first}, {last}) - ({middle})"
            return [], [f"sum += {rust_number(slope)} * to_turns({held});"]
    raise AssertionError(f"a form without code: {type(form).__name__}")


_HELPERS = """\
fn pattern(place: i64) -> i64 {
    correct_unwrapped((place >> 32) as i32, place as u32)
}

#[allow(dead_code)]
fn to_turns(angle: i64) -> f32 {
    angle as f32 * 2.328_306_4e-10
}

/// Turns as an angle; what is no number or beyond a million turns is held there.
fn to_angle(turns: f32) -> i64 {
    let held = if turns > -1e6 { if turns < 1e6 { turns } else { 1e6 } } else { -1e6 };
    let units = held * 4_294_967_296.0;
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
"""

_DECAY = """\
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
"""

_WAVES = """\
/// Lines C sin(m x + phase).
fn waves(x: i64, lines: &[(u64, u64, u32, f32)]) -> f32 {
    let mut sum = 0.0_f32;
    for &(turns, fraction, phase, size) in lines {
        sum += size * sine(place(x, turns, fraction).wrapping_add(phase));
    }
    sum
}
"""

_BENT = """\
/// Wind-up under a load, softer or stiffer beyond a knee.
fn bent(m: f32, linear: f32, cubic: f32, beyond: f32, knee: f32) -> f32 {
    let past = if m > knee { m - knee } else if m < -knee { m + knee } else { 0.0 };
    linear * m + cubic * m * m * m + beyond * past
}
"""

_FIND = """\
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
"""

_FIND_AT_ONCE = """\
/// The angle x with x + pattern + error = goal: the error is the same at every angle.
fn find(goal: i64, signals: &Signals, direction: i8@more@) -> i64 {
    let x = goal;
    @solved@
}
"""

_STEP = """\
/// The true angle behind the next reading, with the whole turns of both, in 2^-32 turns.
pub fn step_unwrapped(state: &mut State, turns: i32, raw: u32, signals: &Signals) -> i64 {
    let reading = (i64::from(turns) << 32) + i64::from(raw);
    let goal = @start@ - to_angle(level(signals));
    seen(state, reading, goal, signals)@late@
}
"""

_WRAPPED = """\
/// The true angle behind the next reading.
pub fn step(state: &mut State, raw: u32, signals: &Signals) -> u32 {
    step_unwrapped(state, 0, raw, signals) as u32
}
"""
