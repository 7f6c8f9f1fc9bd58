"""The C of terms at run time: its arithmetic, a state, the signals of a reading, one step.

One text (``code/step.c``) in two arithmetics: whole numbers of 2^-32 turns with floats, for
microcontrollers, and doubles in turns, for simulators.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..model import forms
from ..model.forms import Form
from .codetext import code_parts, filled_code, float_literal, number_rows
from .runtimeterms import RunTimeTerms, RunTimeWaves
from .table import TURN, ratio_of_cycles

_UNITS = {
    "velocity": "turns of the output per second",
    "temperature": "degrees Celsius",
    "torque": "Nm at the output",
    "current": "A of the motor",
}

#: A literal of type float.
_FLOAT = re.compile(r"(\d\.\d+(?:e-?\d+)?)f\b")


@dataclass(frozen=True)
class CArithmetic:
    """What angles and errors are.

    Attributes
    ----------
    name : str
        Of its own parts of ``code/step.c``.
    angle, real : str
        Types.
    suffix : str
        Of a number of the type ``real``.
    near : str
        Condition under which a search ends.
    one : float
        A turn.
    from_near : str
        Ending of the name of an inverse of the series that starts at an angle nearby.
    """

    name: str
    angle: str
    real: str
    suffix: str
    near: str
    one: float
    from_near: str = ""

    def part(self, name: str, **values: object) -> str:
        """A part of ``code/step.c``: its own, or the one of both."""
        parts = code_parts("step.c")
        return filled_code(parts.get(f"{self.name} {name}") or parts[name], **values)

    def number(self, value: float) -> str:
        """A constant of the type ``real``."""
        text = float_literal(value, 9 if self.suffix else 17) + self.suffix
        return text if value >= 0.0 else f"({text})"

    def place(self, turns: float) -> str:
        """A constant angle."""
        if self.one == 1.0:
            return self.number(turns)
        whole = round(turns * self.one)
        return f"INT64_C({whole})" if whole >= 0 else f"(-INT64_C({-whole}))"


_FIXED = CArithmetic("fixed", "int64_t", "float", "f", "off <= 1 && off >= -1", TURN)

DOUBLE = CArithmetic(
    "double", "double", "double", "", "fabs(off) <= 1e-13 + 4e-16 * fabs(goal)", 1.0, "_from"
)


def c_step(terms: RunTimeTerms, zero: int, at_indicated: bool, whole: bool) -> str:
    """State, signals and step of a header; it has ``NAME_correct_unwrapped`` before."""
    search = c_search(terms, _FIXED, zero / TURN, at_indicated, _FIXED.part("pattern"))
    parts = [c_state(terms, _FIXED), search]
    start = "@n@_pattern(reading)" if at_indicated else "reading"
    bumps = [form for form in terms.smooth if isinstance(form, forms.Bump)]
    if at_indicated and bumps:
        # The table holds them at its own angle: their sum is added again before the search.
        sums = [
            line for form in bumps for line in _form(form, RunTimeWaves((), (), ()), "", _FIXED)[1]
        ]
        parts.append(_function("@n@_bumps", ("@angle@ x",), sums))
        start += " + @n@_angle(@n@_bumps(@n@_pattern(reading)))"
    late = ""
    if terms.delay:
        late = f"\n        + @n@_angle(signals->velocity * {_FIXED.number(terms.delay)})"
    held = [
        f"state->good.{name} = @n@_good("
        f"signals->{name}, {_FIXED.number(limit)}, state->good.{name});"
        for name, limit in terms.limits.items()
    ]
    if held:
        parts.append(_FIXED.part("good"))
        if "direction" in terms.signals:
            held.append("state->good.direction = signals->direction;")
        held.append("signals = &state->good;")
    parts.append(_FIXED.part("step unwrapped", held="\n".join(held), start=start, late=late))
    if whole:
        parts.append(_FIXED.part("step"))
    return filled_code("\n".join(parts), angle=_FIXED.angle, real=_FIXED.real)


def c_state(terms: RunTimeTerms, arithmetic: CArithmetic) -> str:
    """Types of the state and of the signals."""
    fields = []
    if terms.travels:
        held = "@n@_stretch stretch;" if terms.springs else "int8_t direction;"
        fields = ["@angle@ farthest;", held, "uint8_t known;"]
    if arithmetic is _FIXED and terms.limits:
        fields.append("@n@_signals good;")
    signals = []
    for name, limit in terms.limits.items():
        most = f", up to {limit:.4g}" if arithmetic is _FIXED else ""
        signals.append(f"@real@ {name}; /* {_UNITS[name]}{most} */")
    if "direction" in terms.signals:
        signals.append("int8_t direction; /* of travel: 1, -1, 0 as before */")
    stretch = [arithmetic.part("stretch", count=len(terms.springs))] if terms.springs else []
    parts = [
        *stretch,
        arithmetic.part("signals", fields="\n".join(signals or ["uint8_t none;"])),
        arithmetic.part("state", fields="\n".join(fields or ["uint8_t none;"])),
    ]
    return filled_code("\n".join(parts), angle=arithmetic.angle, real=arithmetic.real)


def c_search(
    terms: RunTimeTerms, arithmetic: CArithmetic, zero: float, at_indicated: bool, pattern: str
) -> str:
    """Errors of the terms, the search of the angle behind a reading, and travel.

    ``pattern`` is the code of ``NAME_pattern``, the inverse of the series.
    """
    part = arithmetic.part
    parts = [part("helpers"), pattern]
    if terms.springs or any(isinstance(f, forms.Bump) for f in terms.smooth):
        parts.append(part("decay"))
    tables, level, shape = [], [], []
    for i, (form, waves) in enumerate(zip(terms.smooth, terms.waves, strict=True)):
        name = f"@n@_lines{i}"
        if waves.orders:
            tables.append(wave_tables(name, waves, arithmetic, isinstance(form, forms.Filter)))
        one, other = _form(form, waves, name, arithmetic)
        level += one
        shape += other
    play = [arithmetic.number(terms.play)] if terms.play else []
    if terms.places.orders:
        tables.append(wave_tables("@n@_play", terms.places, arithmetic, False))
        play.append(_waves_call("@n@_play", terms.places, arithmetic))
    if play:
        shape.append(f"sum += (@real@)direction * ({' + '.join(play)});")
    text = "\n".join(tables + shape)
    parts += [part(name) for name in ("waves", "ratios") if f"@n@_{name}(" in text]
    text = "\n".join([text, *level])
    parts += [part(name) for name in ("bent", "size", "passed") if f"@n@_{name}(" in text]
    parts += tables
    if terms.springs:
        parts.append(_springs(terms, arithmetic))
    signals = "const @n@_signals *signals"
    parts.append(_function("@n@_level", (signals,), level))
    stretch = ("const @n@_stretch *along", "@real@ held") if terms.springs else ()
    if terms.springs:
        shape.append("sum += along ? @n@_wound(along, x) : held;")
    given = ("@angle@ x", signals, "int8_t direction", *stretch)
    parts.append(_function("@n@_error", given, shape))
    find = part(
        "find" if terms.shaped else "find at once",
        along="".join(f",\n    {argument}" for argument in stretch),
        given=", along, held" if stretch else "",
        near=arithmetic.near,
        zero=arithmetic.place(0.0 if at_indicated else zero),
        inverse="" if at_indicated else "@n@_pattern",
        inverse_near="" if at_indicated else f"@n@_pattern{arithmetic.from_near}",
        x=", x" if arithmetic.from_near and not at_indicated else "",
    )
    parts.append(find)
    parts += _travel(terms, arithmetic, zero)
    text = filled_code("\n".join(parts), angle=arithmetic.angle, real=arithmetic.real)
    return text if arithmetic is _FIXED else _FLOAT.sub(r"\1", text)


def _springs(terms: RunTimeTerms, arithmetic: CArithmetic) -> str:
    """Error of the springs on a segment, and the segment that begins."""
    number = arithmetic.number
    wound = [
        f"sum += {number(s.amplitude)} * (d - (d - s->wound[{i}])"
        f" * @n@_decay(way * {number(1.0 / s.length)}));"
        for i, s in enumerate(terms.springs)
    ]
    begun = [
        f"next.wound[{i}] = s->direction == 0 ? {number(s.start)} * (@real@)direction\n"
        f"    : old - (old - s->wound[{i}]) * @n@_decay(way * {number(1.0 / s.length)});"
        for i, s in enumerate(terms.springs)
    ]
    return arithmetic.part("springs", wound="\n".join(wound), begun="\n".join(begun))


def _travel(terms: RunTimeTerms, arithmetic: CArithmetic, zero: float) -> list[str]:
    """Moving on, and the angle that the encoder saw at a reading, which moves the state on."""
    part, spring = arithmetic.part, bool(terms.springs)
    seen = part("seen")
    if not terms.travels:
        return [part("seen at once", seen=seen)]
    held = "state->stretch.direction" if spring else "state->direction"
    begin = "state->stretch = @n@_begun(state, direction);" if spring else f"{held} = direction;"
    moved = "state->stretch.place += turns;" if spring else ""
    found = part(
        "seen by angle" if terms.way == "angle" else "seen by signal",
        seen=seen,
        align=part("align", zero=arithmetic.place(zero), moved=moved),
        first="const @n@_stretch ahead = state->stretch;" if spring else "",
        ahead=part("ahead") if spring else "",
        behind=part("behind") if spring else "",
        given=", &ahead, 0.0f" if spring else "",
        held=held,
        way=terms.way,
    )
    return [part("advance", held=held, begin=begin), found]


def _function(name: str, arguments: tuple[str, ...], sums: list[str]) -> str:
    """A function that adds up; arguments that it does not use are cast to void."""
    used = "\n".join(sums)
    names = [argument.split()[-1].lstrip("*") for argument in arguments]
    unused = [f"(void){word};" for word in names if not re.search(rf"\b{word}\b", used)]
    return _FIXED.part(
        "sum", function=name, arguments=", ".join(arguments), unused="\n".join(unused), sums=used
    )


def wave_tables(name: str, waves: RunTimeWaves, arithmetic: CArithmetic, rated: bool) -> str:
    """Orders, phases and sizes as constants; ``rated`` orders as floats as well."""
    fixed = arithmetic is _FIXED

    def array(kind: str, ending: str, values: list[str], memory: str = " TRUEANGLE_TABLE") -> str:
        size = f"{name}_{ending}[{len(values)}]{memory if fixed else ''}"
        return f"static const {kind} {size} = {{\n{number_rows(values, 6)}\n}};\n"

    numbers = [list(map(arithmetic.number, line)) for line in waves]
    sizes = array("@real@", "sizes", numbers[1])
    if not fixed:
        return array("double", "orders", numbers[0]) + array("double", "phases", numbers[2]) + sizes
    if waves.whole:
        orders = array("uint32_t", "orders", [f"{int(m) % 2**32}u" for m in waves.orders])
    else:
        ratios = [f"UINT64_C({part})" for m in waves.orders for part in ratio_of_cycles(m)]
        orders = array("uint64_t", "orders", ratios, "")
    phases = array("uint32_t", "phases", [f"{round(p * TURN) % 2**32}u" for p in waves.phases])
    return orders + phases + sizes + (array("@real@", "rates", numbers[0]) if rated else "")


def _waves_call(name: str, waves: RunTimeWaves, arithmetic: CArithmetic) -> str:
    function = "@n@_waves" if waves.whole or arithmetic is not _FIXED else "@n@_ratios"
    return f"{function}(x, {name}_orders, {name}_phases, {name}_sizes, {len(waves.orders)})"


def _form(
    form: Form, waves: RunTimeWaves, name: str, arithmetic: CArithmetic
) -> tuple[list[str], list[str]]:
    """Statements that add to the level, and to the error at ``x``."""
    number, fixed = arithmetic.number, arithmetic is _FIXED
    match form:
        case forms.Scaled():
            value = f"signals->{form.signal}"
            if form.origin:
                value = f"({value} - {number(form.origin)})"
            if form.absolute:
                value = f"@n@_size({value})"
            level = [f"sum += {number(form.level)} * {value};"] if form.level else []
            call = _waves_call(name, waves, arithmetic)
            return level, [f"sum += {value} * {call};"] if waves.orders else []
        case forms.Spring():
            values = (form.linear, form.cubic, form.beyond, form.knee)
            constants = ", ".join(number(v) for v in values)
            if form.gravity is None:
                return [f"sum += @n@_bent(signals->{form.signal}, {constants});"], []
            if fixed:
                phase = f"(uint32_t)x - {round(form.gravity * TURN) % 2**32}u"
            else:
                phase = f"x - {number(form.gravity)}"
            moment = f"signals->{form.signal} * @n@_sine({phase})"
            return [], [f"sum += @n@_bent({moment}, {constants});"]
        case forms.Filter(frequency, damping):
            return [], _filter(frequency, damping, waves, name, arithmetic)
        case forms.Bump(place, width, height, cycles):
            if fixed:
                turns, fraction = (f"UINT64_C({part})" for part in ratio_of_cycles(cycles))
                turned = arithmetic.part("turned", turns=turns, fraction=fraction).strip()
                away = f"(float)(int32_t)({turned} - {round(place % 1.0 * TURN) % 2**32}u)"
                away += f" * {number(1.0 / width / TURN)}"
            else:
                turned = f"@n@_place(x, {number(cycles)}) - {number(place)}"
                away = f"({turned} - floor({turned} + 0.5)) * {number(1.0 / width)}"
            bump = arithmetic.part("bump", away=away, height=number(height), half=number(0.5))
            return [], bump.splitlines()
        case forms.Ramp(slope, start, stop):
            ends = f"{arithmetic.place(start)}, {arithmetic.place(stop)}"
            middle = arithmetic.place(0.5 * (start + stop))
            return [], [f"sum += {number(slope)} * @n@_turns(@n@_passed(x, {ends}) - {middle});"]
    raise AssertionError(f"a form without code: {type(form).__name__}")


def _filter(
    frequency: float, damping: float | None, waves: RunTimeWaves, name: str, arithmetic: CArithmetic
) -> list[str]:
    if not waves.orders:
        return []
    number, fixed = arithmetic.number, arithmetic is _FIXED

    def read(array: str) -> str:
        return f"TRUEANGLE_F32({array} + i)" if fixed else f"{array}[i]"

    if not fixed:
        phase = f"@n@_place(x, {name}_orders[i]) + {name}_phases[i]"
    elif waves.whole:
        phase = f"(uint32_t)x * TRUEANGLE_U32({name}_orders + i) + TRUEANGLE_U32({name}_phases + i)"
    else:
        turns, fraction = f"{name}_orders[2 * i]", f"{name}_orders[2 * i + 1]"
        turned = arithmetic.part("turned", turns=turns, fraction=fraction).strip()
        phase = f"{turned} + TRUEANGLE_U32({name}_phases + i)"
    gain = "low-pass gain" if damping is None else "damped gain"
    return arithmetic.part(
        "filter",
        count=len(waves.orders),
        rate=f"{number(1.0 / frequency)} * {read(f'{name}_rates' if fixed else f'{name}_orders')}",
        gain=arithmetic.part(gain, loss=number(2.0 * (damping or 0.0))),
        kind="uint32_t" if fixed else "double",
        phase=phase,
        size=read(f"{name}_sizes"),
        quarter="UINT32_C(0x40000000)" if fixed else "0.25",
    ).splitlines()
