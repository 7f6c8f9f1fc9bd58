"""One Rust module without std: constant tables, the core's arithmetic, terms at run time."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import numpy as np

import trueangle._core as _core

from ..model import forms
from ..model.forms import Form
from ..support.files import FileKind
from .chain import Chain, source_identifier
from .codetext import code_parts, decoding, filled_code, float_literal, number_rows
from .portable import PortableTarget, self_test, table_lines
from .runtimeterms import RunTimeTerms, RunTimeWaves
from .table import PER_RADIAN, TURN, Table, ratio_of_cycles
from .target import CommentBlock

_TYPES = {"q15": "i16", "q31": "i32", "f32": "f32"}

_DOCS = {
    "velocity": "Turns of the output per second",
    "temperature": "Degrees Celsius",
    "torque": "Nm at the output",
    "current": "A of the motor",
}


class RustModule(PortableTarget):
    """Target ``rust``: a file to name in ``mod``; no std, no allocation, no dependencies."""

    name = "rust"
    decodes = True
    what = "a Rust module without std, tables and one function per shaft"
    kind: ClassVar[FileKind] = FileKind("a Rust module", (".rs", ".txt"))

    def write(self, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
        """The module."""
        parts = [_comment(chain, terms, header)]
        parts += [_table(table) for table in chain.tables]
        if chain.whole:
            parts.append(_part("correct"))
        parts += [_unwrapped(chain), _self_test(chain)]
        if chain.channels is not None:
            parts.append(decoding(chain.channels, code_parts("module.rs"), 2.0**32, str))
        if terms is not None:
            whole = chain.whole and terms.whole
            parts.append(_rust_step(terms, chain.zero, chain.at_indicated, whole))
        parts += [_arithmetic(table) for table in _different(chain.tables)]
        return "\n".join(parts)


def _comment(chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
    own = [
        "Correction of an indicated angle; do not edit.",
        "",
        "Angles are `u32`, 2^-32 turns, so that they wrap by themselves. A reading of n bits is "
        "shifted left by 32 - n. Corrected = indicated - correction, looked up at the indicated "
        "angle" + ("; all tables at the same one." if chain.at_indicated else "."),
        "`correct_unwrapped` takes and gives the whole turns of the output as well.",
        *([] if chain.channels is None else ["`decode` gives the reading of the channels."]),
        *([] if terms is None else [terms.use("step", "&mut state", "State::default()")]),
        *table_lines(chain),
    ]
    return "\n".join(header.comment("//! ", *own)) + "\n"


def _part(part: str, **values: object) -> str:
    return filled_code(code_parts("module.rs")[part], **values)


def _table(table: Table) -> str:
    name = source_identifier(table.shaft)
    # With an ending, so that no shaft has the name of another constant.
    knots = f"{name.upper()}_KNOTS"
    values = np.asarray(table.knots)
    kind = _TYPES[table.number]
    shift = f", {table.shift}" if table.number == "q15" else ""
    call = f"{table.method}_{kind}(&{knots}, {table.bits}{shift}, angle)"
    if table.number == "f32":
        call = f"({call} * {float(PER_RADIAN):.1f}) as i32"
    return _part(
        "table",
        knots=knots,
        element=kind if values.ndim == 1 else f"[{kind}; 2]",
        count=len(values),
        rows=number_rows([_element(v, table.number) for v in values], 8 if values.ndim == 1 else 4),
        name=name,
        cycles=f"{table.cycles:g}",
        call=call,
    )


def _element(value: Any, number: str) -> str:
    if np.ndim(value):
        return "[" + ", ".join(_element(part, number) for part in value) + "]"
    return float_literal(float(np.float32(value))) if number == "f32" else str(int(value))


def _step(chain: Chain, table: Table) -> str:
    """What a table subtracts from ``left``, an expression in it and in ``start``."""
    at, name = "start" if chain.at_indicated else "left", source_identifier(table.shaft)
    if table.cycles != int(table.cycles):
        at = f"{name}_place({at})"
    elif table.cycles != 1:
        at = f"({at} as u32).wrapping_mul({int(table.cycles)})"
    else:
        at = f"{at} as u32"
    return f"{name}_correction({at})"


def _unwrapped(chain: Chain) -> str:
    places = []
    for table in chain.tables:
        if table.cycles != int(table.cycles):
            turns, fraction = table.ratio
            name, cycles = source_identifier(table.shaft), f"{table.cycles:.17g}"
            place = _part("place", cycles=cycles, name=name, turns=turns, fraction=fraction)
            places.append(place)
    steps = [f"let left = left - i64::from({_step(chain, table)});" for table in chain.tables]
    corrected = _part("correct unwrapped", zero=chain.zero, steps="\n".join(steps))
    return "\n".join([*places, corrected])


def _self_test(chain: Chain) -> str:
    tests = self_test(chain)
    if chain.whole:
        pairs = ",\n".join(f"({a}, {b})" for _, a, b in tests)
        return _part("self test", tests=f"{pairs},")
    triples = ",\n".join(f"({turn}, {a}, {b})" for turn, a, b in tests)
    return _part("self test with turns", tests=f"{triples},")


def _different(tables: tuple[Table, ...]) -> list[Table]:
    return list({(table.method, table.number): table for table in tables}.values())


def _arithmetic(table: Table) -> str:
    """The functions this table needs, as they are in the core."""
    source = _core.table_source(table.method)
    wanted = {f"{table.method}_{_TYPES[table.number]}"}
    if table.method == "cubic" and table.number != "f32":
        wanted |= {"scaled", "between"}
    found = re.findall(
        r"(?:^///[^\n]*\n|^#\[inline\]\n)+^(?:pub )?fn (\w+).*?^}\n", source, re.M | re.S
    )
    blocks = re.finditer(
        r"((?:^///[^\n]*\n|^#\[inline\]\n)+^(?:pub )?fn (\w+).*?^}\n)", source, re.M | re.S
    )
    assert wanted <= set(found), "the core's source names other functions"
    return "\n".join(block.group(1) for block in blocks if block.group(2) in wanted)


def _rust_step(terms: RunTimeTerms, zero: int, at_indicated: bool, whole: bool) -> str:
    """State, signals and step of a module; it has ``correct_unwrapped`` before."""
    parts = [*_state(terms), _step_part("helpers")]
    bumps = [form for form in terms.smooth if isinstance(form, forms.Bump)]
    if terms.springs or bumps:
        parts.append(_step_part("decay"))
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
    parts += [_step_part(name) for name in ("waves", "bent") if f"{name}(" in text]
    parts += tables
    if terms.springs:
        parts.append(_springs(terms))
    more = ["along: Option<&Stretch>", "held: f32"] if terms.springs else []
    parts.append(_function("level", ["signals: &Signals"], level))
    parts.append(_function("error", ["x: i64", "signals: &Signals", "direction: i8", *more], shape))
    given = ", along, held" if terms.springs else ""
    solved = f"goal - to_angle(error(x, signals, direction{given}))"
    find = _step_part(
        "find" if terms.shaped else "find at once",
        more="".join(f", {argument}" for argument in more),
        solved=solved if at_indicated else f"pattern({solved})",
        zero=0 if at_indicated else zero,
    )
    parts += [find, *_travel(terms, zero)]
    start = "pattern(reading)" if at_indicated else "reading"
    if at_indicated and bumps:
        # The table holds them at its own angle: their sum is added again before the search.
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
        parts.append(_step_part("good"))
        if "direction" in terms.signals:
            good.append("direction: signals.direction,")
        held = _step_part("held", fields="\n".join(good))
    parts.append(_step_part("step unwrapped", held=held, start=start, late=late))
    if whole:
        parts.append(_step_part("step"))
    return "\n".join(parts)


def _step_part(part: str, **values: object) -> str:
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
        *([_step_part("stretch", count=len(terms.springs))] if terms.springs else []),
        _step_part("state", fields=_fields(fields)),
        _step_part("signals", fields=_fields(signals)),
    ]


def _fields(fields: list[str]) -> str:
    return "{\n" + "".join(f"    {field},\n" for field in fields) + "}" if fields else "{}"


def _lines(name: str, waves: RunTimeWaves) -> str:
    rows = []
    for m, c, phase in zip(waves.orders, waves.amplitudes, waves.phases, strict=True):
        turns, fraction = ratio_of_cycles(m)
        rows.append(f"({turns}, {fraction}, {round(phase * TURN) % 2**32}, {_number(c)}),")
    return _step_part("lines", name=name, count=len(rows), rows="\n".join(rows))


def _function(name: str, arguments: list[str], sums: list[str]) -> str:
    """A function that adds up; what it is given and does not use is marked so."""
    used = "\n".join(sums)
    words = used.replace("(x,", "x ").replace(".", " ")
    marked = ", ".join(a if a.split(":")[0] in words else f"_{a}" for a in arguments)
    if not sums:
        return f"fn {name}({marked}) -> f32 {{\n    0.0\n}}\n"
    return _step_part("sum", name=name, arguments=marked, sums=used)


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
            text = _step_part(
                "filter",
                count=len(waves.orders),
                rates=", ".join(map(_number, waves.orders)),
                name=name,
                period=_number(1.0 / frequency),
                gain=_step_part(gain, loss=_number(2.0 * (damping or 0.0))),
            )
            return [], text.splitlines()
        case forms.Bump(centre, width, height, cycles):
            turns, fraction = ratio_of_cycles(cycles)
            text = _step_part(
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
    """Error of the springs on a segment, and the segment that begins."""
    wound, begun = "", ""
    for i, s in enumerate(terms.springs):
        slope = _number(1.0 / s.length)
        wound += _step_part("wound", amplitude=_number(s.amplitude), i=i, slope=slope)
        begun += _step_part("begun", start=_number(s.start), i=i, slope=slope)
    return _step_part("springs", wound=wound, begun=begun)


def _travel(terms: RunTimeTerms, zero: int) -> list[str]:
    """Moving on, and the angle that the encoder saw at a reading, which moves the state on."""
    if not terms.travels:
        return [_step_part("seen at once")]
    spring = bool(terms.springs)
    held = "state.stretch.direction" if spring else "state.direction"
    begun = "state.stretch = state.stretch.next(direction, state.farthest, state.known);"
    seen = _step_part("seen", zero=zero, moved="state.stretch.place += turns;" if spring else "")
    return [
        _step_part("advance", held=held, begin=begun if spring else f"{held} = direction;"),
        _step_part(
            "seen by angle" if terms.way == "angle" else "seen by signal",
            seen=seen,
            fresh="let ahead = state.stretch;" if spring else "",
            ahead=_step_part("ahead") if spring else "",
            behind=_step_part("behind") if spring else "",
            given=", Some(&ahead), 0.0" if spring else "",
            mutable="mut " if spring else "",
            held=held,
            way=terms.way,
            nothing="0" if terms.way == "direction" else "0.0",
        ),
    ]
