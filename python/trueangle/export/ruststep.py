"""The Rust of terms at run time (``code/step.rs``): the same step as in C, without std."""

from __future__ import annotations

from ..model import forms
from ..model.forms import Form
from .codetext import code_parts, filled_code, float_literal
from .runtimeterms import RunTimeTerms, RunTimeWaves
from .table import TURN, ratio_of_cycles

_DOCS = {
    "velocity": "Turns of the output per second",
    "temperature": "Degrees Celsius",
    "torque": "Nm at the output",
    "current": "A of the motor",
}


def rust_step(terms: RunTimeTerms, zero: int, at_indicated: bool, whole: bool) -> str:
    """State, signals and step of a module; it has ``correct_unwrapped`` before."""
    parts = [*_state(terms), _part("helpers")]
    bumps = [form for form in terms.smooth if isinstance(form, forms.Bump)]
    if terms.springs or bumps:
        parts.append(_part("decay"))
    tables, level, shape = [], [], []
    for i, (form, waves) in enumerate(zip(terms.smooth, terms.waves, strict=True)):
        if waves.orders:
            tables.append(_lines(f"LINES{i}", waves))
        one, other = _form(form, waves, f"LINES{i}")
        level += one
        shape += other
    play = [_number(terms.play)] if terms.play else []
    if terms.places.orders:
        tables.append(_lines("PLAY", terms.places))
        play.append("waves(x, &PLAY)")
    if play:
        shape.append(f"sum += f32::from(direction) * ({' + '.join(play)});")
    if terms.springs:
        shape.append("sum += along.map_or(held, |stretch| stretch.wound(x));")
    text = "\n".join(tables + shape + level)
    parts += [_part(name) for name in ("waves", "bent") if f"{name}(" in text]
    parts += tables
    if terms.springs:
        parts.append(_springs(terms))
    more = ["along: Option<&Stretch>", "held: f32"] if terms.springs else []
    parts.append(_function("level", ["signals: &Signals"], level))
    parts.append(_function("error", ["x: i64", "signals: &Signals", "direction: i8", *more], shape))
    given = ", along, held" if terms.springs else ""
    solved = f"goal - to_angle(error(x, signals, direction{given}))"
    find = _part(
        "find" if terms.shaped else "find at once",
        more="".join(f", {argument}" for argument in more),
        solved=solved if at_indicated else f"pattern({solved})",
        zero=0 if at_indicated else zero,
    )
    parts += [find, *_travel(terms, zero)]
    start = "pattern(reading)" if at_indicated else "reading"
    if at_indicated and bumps:
        # The table holds them at its own angle: what is searched is what they were taken off.
        sums = [line for form in bumps for line in _form(form, RunTimeWaves((), (), ()), "")[1]]
        parts.append(_function("bumps", ["x: i64"], sums))
        start += " + to_angle(bumps(pattern(reading)))"
    late = f" + to_angle(signals.velocity * {_number(terms.delay)})" if terms.delay else ""
    good = [
        f"{name}: good(signals.{name}, {_number(limit)}, state.good.{name}),"
        for name, limit in terms.limits.items()
    ]
    held = ""
    if good:
        parts.append(_part("good"))
        if "direction" in terms.signals:
            good.append("direction: signals.direction,")
        held = _part("held", fields="\n".join(good))
    parts.append(_part("step unwrapped", held=held, start=start, late=late))
    if whole:
        parts.append(_part("step"))
    return "\n".join(parts)


def _part(part: str, **values: object) -> str:
    return filled_code(code_parts("step.rs")[part], **values)


def _number(value: float) -> str:
    """A constant of type f32."""
    text = float_literal(value)
    return text if value >= 0.0 else f"({text})"


def _state(terms: RunTimeTerms) -> list[str]:
    """Types of the state and of the signals."""
    held = "stretch: Stretch" if terms.springs else "direction: i8"
    fields = ["farthest: i64", held, "known: bool"] if terms.travels else []
    if terms.limits:
        fields.append("good: Signals")
    signals = [
        f"/// {_DOCS[name]}, up to {limit:.4g}.\n    pub {name}: f32"
        for name, limit in terms.limits.items()
    ]
    if "direction" in terms.signals:
        signals.append("/// Of travel: 1, -1, 0 as before.\n    pub direction: i8")
    return [
        *([_part("stretch", count=len(terms.springs))] if terms.springs else []),
        _part("state", fields=_fields(fields)),
        _part("signals", fields=_fields(signals)),
    ]


def _fields(fields: list[str]) -> str:
    return "{\n" + "".join(f"    {field},\n" for field in fields) + "}" if fields else "{}"


def _lines(name: str, waves: RunTimeWaves) -> str:
    rows = []
    for m, c, phase in zip(waves.orders, waves.amplitudes, waves.phases, strict=True):
        turns, fraction = ratio_of_cycles(m)
        rows.append(f"({turns}, {fraction}, {round(phase * TURN) % 2**32}, {_number(c)}),")
    return _part("lines", name=name, count=len(rows), rows="\n".join(rows))


def _function(name: str, arguments: list[str], sums: list[str]) -> str:
    """A function that adds up; what it is given and does not use is marked so."""
    used = "\n".join(sums)
    words = used.replace("(x,", "x ").replace(".", " ")
    marked = ", ".join(a if a.split(":")[0] in words else f"_{a}" for a in arguments)
    if not sums:
        return f"fn {name}({marked}) -> f32 {{\n    0.0\n}}\n"
    return _part("sum", name=name, arguments=marked, sums=used)


def _form(form: Form, waves: RunTimeWaves, name: str) -> tuple[list[str], list[str]]:
    """Statements that add to the level, and to the error at ``x``."""
    match form:
        case forms.Scaled():
            value = f"signals.{form.signal}"
            if form.origin:
                value = f"({value} - {_number(form.origin)})"
            if form.absolute:
                value = f"f32::max({value}, -{value})"
            level = [f"sum += {_number(form.level)} * {value};"] if form.level else []
            return level, [f"sum += {value} * waves(x, &{name});"] if waves.orders else []
        case forms.Spring():
            values = (form.linear, form.cubic, form.beyond, form.knee)
            constants = ", ".join(map(_number, values))
            if form.gravity is None:
                return [f"sum += bent(signals.{form.signal}, {constants});"], []
            phase = f"(x as u32).wrapping_sub({round(form.gravity * TURN) % 2**32})"
            return [], [f"sum += bent(signals.{form.signal} * sine({phase}), {constants});"]
        case forms.Filter(frequency, damping):
            if not waves.orders:
                return [], []
            gain = "low-pass gain" if damping is None else "damped gain"
            text = _part(
                "filter",
                count=len(waves.orders),
                rates=", ".join(map(_number, waves.orders)),
                name=name,
                period=_number(1.0 / frequency),
                gain=_part(gain, loss=_number(2.0 * (damping or 0.0))),
            )
            return [], text.splitlines()
        case forms.Bump(centre, width, height, cycles):
            turns, fraction = ratio_of_cycles(cycles)
            text = _part(
                "bump",
                turns=turns,
                fraction=fraction,
                centre=round(centre % 1.0 * TURN) % 2**32,
                slope=_number(1.0 / width / TURN),
                height=_number(height),
            )
            return [], text.splitlines()
        case forms.Ramp(slope, start, stop):
            first, last, middle = (round(end * TURN) for end in (start, stop, (start + stop) / 2))
            held = f"x.clamp({first}, {last}) - ({middle})"
            return [], [f"sum += {_number(slope)} * to_turns({held});"]
    raise AssertionError(f"a form without code: {type(form).__name__}")


def _springs(terms: RunTimeTerms) -> str:
    """Error of the springs on a stretch, and the stretch that begins."""
    wound, begun = "", ""
    for i, s in enumerate(terms.springs):
        slope = _number(1.0 / s.length)
        wound += _part("wound", amplitude=_number(s.amplitude), i=i, slope=slope)
        begun += _part("begun", start=_number(s.start), i=i, slope=slope)
    return _part("springs", wound=wound, begun=begun)


def _travel(terms: RunTimeTerms, zero: int) -> list[str]:
    """Moving on, and the angle that the encoder saw at a reading, which moves the state on."""
    if not terms.travels:
        return [_part("seen at once")]
    spring = bool(terms.springs)
    held = "state.stretch.direction" if spring else "state.direction"
    begun = "state.stretch = state.stretch.next(direction, state.farthest, state.known);"
    seen = _part("seen", zero=zero, moved="state.stretch.place += turns;" if spring else "")
    return [
        _part("advance", held=held, begin=begun if spring else f"{held} = direction;"),
        _part(
            "seen by angle" if terms.way == "angle" else "seen by signal",
            seen=seen,
            fresh="let ahead = state.stretch;" if spring else "",
            ahead=_part("ahead") if spring else "",
            behind=_part("behind") if spring else "",
            given=", Some(&ahead), 0.0" if spring else "",
            mutable="mut " if spring else "",
            held=held,
            way=terms.way,
            nothing="0" if terms.way == "direction" else "0.0",
        ),
    ]
