"""The C of terms at run time: a state, the signals of a reading, and one step.

One text in two arithmetics: whole numbers of 2^-32 turns with floats, for microcontrollers, and
doubles in turns, for simulators.
"""

from __future__ import annotations

import re

from ..model import forms
from ..model.forms import Form
from .carithmetic import FIXED, RATIO_WAVES, Arithmetic
from .ctravel import c_advance, c_seen_angle, c_springs
from .runtimeterms import RunTimeTerms, Waves
from .table import TURN, ratio_of_cycles

__all__ = ["c_search", "c_state", "c_step", "wave_tables"]


_UNITS = {
    "velocity": "turns of the output per second",
    "temperature": "degrees Celsius",
    "torque": "Nm at the output",
    "current": "A of the motor",
}


def c_state(terms: RunTimeTerms) -> str:
    """Types of the state and of the signals."""
    parts = []
    if terms.springs:
        parts.append(
            "/* Travel in one direction: where it began, and the springs there. */\n"
            "typedef struct {\n    @angle@ place;\n"
            f"    @real@ wound[{len(terms.springs)}];\n"
            "    int8_t direction, placed;\n} @n@_stretch;\n"
        )
    parts.append("/* What later readings need to know of the past: all zero before the first. */\n")
    if terms.travels:
        stretch = "@n@_stretch stretch;" if terms.springs else "int8_t direction;"
        parts[-1] += (
            f"typedef struct {{\n    @angle@ farthest;\n    {stretch}\n    uint8_t known;\n"
        )
    else:
        parts[-1] += "typedef struct {\n    uint8_t none;\n"
    parts[-1] += "} @n@_state;\n"
    fields = [
        f"    @real@ {name}; /* {_UNITS[name]} */" for name in terms.signals if name in _UNITS
    ]
    if "direction" in terms.signals:
        fields.append("    int8_t direction; /* of travel: 1, -1, 0 as before */")
    parts.append(
        "/* What is known at a reading; finite numbers. */\n"
        "typedef struct {\n" + "\n".join(fields or ["    uint8_t none;"]) + "\n} @n@_signals;\n"
    )
    return "\n".join(parts)


def c_step(terms: RunTimeTerms, zero: int, at_indicated: bool, whole: bool) -> str:
    """State, signals and step of a header; it has ``NAME_correct_unwrapped`` before."""
    parts = [
        c_state(terms),
        c_search(terms, FIXED, zero / TURN, at_indicated, _PATTERN),
    ]
    start = "@n@_pattern(reading)" if at_indicated else "reading"
    bumps = [form for form in terms.smooth if isinstance(form, forms.Bump)]
    if at_indicated and bumps:
        # The table holds them at its own angle: what is searched is what they were taken off.
        sums = [line for form in bumps for line in _form(form, Waves((), (), ()), "", FIXED)[1]]
        parts.append(_function("@n@_bumps", ("@angle@ x",), sums))
        start += " + @n@_angle(@n@_bumps(@n@_pattern(reading)))"
    late = ""
    if terms.delay:
        late = f"\n        + @n@_angle(signals->velocity * {FIXED.number(terms.delay)})"
    parts.append(_STEP.replace("@start@", start).replace("@late@", late))
    if whole:
        parts.append(_WRAPPED)
    text = "\n".join(parts)
    return text.replace("@angle@", FIXED.angle).replace("@real@", FIXED.real)


_PATTERN = """\
static inline int64_t @n@_pattern(int64_t place)
{
    return @n@_correct_unwrapped((int32_t)(place >> 32), (uint32_t)place);
}
"""

_STEP = """\
/* The true angle behind the next reading, with the whole turns of both, in 2^-32 turns. */
static inline int64_t @n@_step_unwrapped(@n@_state *state, int32_t turns, uint32_t raw,
    const @n@_signals *signals)
{
    const int64_t reading = turns * INT64_C(4294967296) + raw;
    const int64_t goal = @start@ - @n@_angle(@n@_level(signals));
    return @n@_seen(state, reading, goal, signals)@late@;
}
"""

_WRAPPED = """\
/* The true angle behind the next reading. */
static inline uint32_t @n@_step(@n@_state *state, uint32_t raw, const @n@_signals *signals)
{
    return (uint32_t)@n@_step_unwrapped(state, 0, raw, signals);
}
"""


def c_search(
    terms: RunTimeTerms, arithmetic: Arithmetic, zero: float, at_indicated: bool, pattern: str
) -> str:
    """Errors of the terms, the search of the angle behind a reading, and travel.

    ``pattern`` is the code of ``NAME_pattern``, the inverse of the series.
    """
    parts = [arithmetic.helpers, pattern]
    if terms.springs or any(isinstance(f, forms.Bump) for f in terms.smooth):
        parts.append(arithmetic.decay)
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
    if "@n@_waves(" in text:
        parts.append(arithmetic.waves)
    if "@n@_ratios(" in text:
        parts.append(RATIO_WAVES)
    for needed, code in (("@n@_bent(", _BENT), ("@n@_size(", _SIZE), ("@n@_passed(", _PASSED)):
        if needed in text + "\n".join(level):
            parts.append(code)
    parts += tables
    if terms.springs:
        parts.append(c_springs(terms, arithmetic))
    signals = "const @n@_signals *signals"
    parts.append(_function("@n@_level", (signals,), level))
    stretch = ("const @n@_stretch *along", "@real@ held") if terms.springs else ()
    if terms.springs:
        shape.append("sum += along ? @n@_wound(along, x) : held;")
    given = ("@angle@ x", signals, "int8_t direction", *stretch)
    parts.append(_function("@n@_error", given, shape))
    find = _FIND if terms.shaped else _FIND_AT_ONCE
    parts.append(
        find.replace("@along@", "".join(f",\n    {argument}" for argument in stretch))
        .replace("@given@", ", along, held" if stretch else "")
        .replace("@near@", arithmetic.near)
        .replace("@zero@", arithmetic.place(0.0 if at_indicated else zero))
        .replace("@inverse@", "" if at_indicated else "@n@_pattern")
        .replace("@inverse_near@", "" if at_indicated else f"@n@_pattern{arithmetic.from_near}")
        .replace("@x@", ", x" if arithmetic.from_near and not at_indicated else "")
    )
    if terms.travels:
        parts.append(c_advance(terms))
    parts.append(c_seen_angle(terms, arithmetic, zero))
    text = "\n".join(parts)
    for key, value in (("angle", arithmetic.angle), ("real", arithmetic.real)):
        text = text.replace(f"@{key}@", value)
    return text if arithmetic is FIXED else _FLOAT.sub(r"\1", text)


#: A literal of type float.
_FLOAT = re.compile(r"(\d\.\d+(?:e-?\d+)?)f\b")


def _function(name: str, arguments: tuple[str, ...], sums: list[str]) -> str:
    """A function that adds up; what it is given and does not use is said to the compiler."""
    used = "\n".join(sums)
    names = [argument.split()[-1].lstrip("*") for argument in arguments]
    unused = [f"    (void){word};" for word in names if not re.search(rf"\b{word}\b", used)]
    body = [*unused, *(f"    {line}" for line in sums)]
    return (
        f"static inline @real@ {name}({', '.join(arguments)})\n{{\n    @real@ sum = 0.0f;\n"
        + "\n".join([*body, "    return sum;", "}\n"])
    )


def wave_tables(name: str, waves: Waves, arithmetic: Arithmetic, rated: bool) -> str:
    """Orders, phases and sizes as constants; ``rated`` orders as floats as well."""
    count = len(waves.orders)

    def array(kind: str, ending: str, values: list[str], memory: str = " TRUEANGLE_TABLE") -> str:
        memory = memory if arithmetic is FIXED else ""
        rows = ",\n".join("    " + ", ".join(values[i : i + 6]) for i in range(0, len(values), 6))
        return f"static const {kind} {name}_{ending}[{len(values)}]{memory} = {{\n{rows}\n}};"

    number = arithmetic.number
    sizes = array("@real@", "sizes", [number(c) for c in waves.amplitudes])
    if arithmetic is not FIXED:
        orders = array("double", "orders", [number(m) for m in waves.orders])
        phases = array("double", "phases", [number(p) for p in waves.phases])
        return "\n".join([orders, phases, sizes, ""])
    phases = array("uint32_t", "phases", [f"{round(p * TURN) % 2**32}u" for p in waves.phases])
    if waves.whole:
        orders = array("uint32_t", "orders", [f"{int(m) % 2**32}u" for m in waves.orders])
    else:
        parts = [f"UINT64_C({part})" for m in waves.orders for part in ratio_of_cycles(m)]
        orders = array("uint64_t", "orders", parts, "")
        assert len(parts) == 2 * count
    rates = array("@real@", "rates", [number(m) for m in waves.orders]) if rated else ""
    return "\n".join(part for part in (orders, phases, sizes, rates, "\n") if part).rstrip() + "\n"


def _waves_call(name: str, waves: Waves, arithmetic: Arithmetic) -> str:
    function = "@n@_waves" if waves.whole or arithmetic is not FIXED else "@n@_ratios"
    return f"{function}(x, {name}_orders, {name}_phases, {name}_sizes, {len(waves.orders)})"


def _form(
    form: Form, waves: Waves, name: str, arithmetic: Arithmetic
) -> tuple[list[str], list[str]]:
    """Statements that add to the level, and to the error at ``x``."""
    number = arithmetic.number
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
            if arithmetic is FIXED:
                phase = f"(uint32_t)x - {round(form.gravity * TURN) % 2**32}u"
            else:
                phase = f"x - {number(form.gravity)}"
            moment = f"signals->{form.signal} * @n@_sine({phase})"
            return [], [f"sum += @n@_bent({moment}, {constants});"]
        case forms.Filter(frequency, damping):
            return [], _filter(frequency, damping, waves, name, arithmetic)
        case forms.Bump(place, width, height, cycles):
            if arithmetic is FIXED:
                turns, fraction = ratio_of_cycles(cycles)
                phase = (
                    f"(uint32_t)(((uint64_t)(x >> 32) * UINT64_C({turns})\n            + "
                    f"(uint64_t)(uint32_t)x * UINT64_C({fraction})) >> 32)"
                )
                away = f"(float)(int32_t)({phase} - {round(place % 1.0 * TURN) % 2**32}u)"
                away += f" * {number(1.0 / width / TURN)}"
            else:
                turned = f"@n@_place(x, {number(cycles)}) - {number(place)}"
                away = f"({turned} - floor({turned} + 0.5)) * {number(1.0 / width)}"
            return [], [
                "{",
                f"    const @real@ away = {away};",
                f"    sum += {number(height)} * @n@_decay({number(0.5)} * away * away);",
                "}",
            ]
        case forms.Ramp(slope, start, stop):
            ends = f"{arithmetic.place(start)}, {arithmetic.place(stop)}"
            middle = arithmetic.place(0.5 * (start + stop))
            return [], [f"sum += {number(slope)} * @n@_turns(@n@_passed(x, {ends}) - {middle});"]
    raise AssertionError(f"a form without code: {type(form).__name__}")


def _filter(
    frequency: float, damping: float | None, waves: Waves, name: str, arithmetic: Arithmetic
) -> list[str]:
    number = arithmetic.number
    if not waves.orders:
        return []
    fixed = arithmetic is FIXED

    def read(array: str) -> str:
        return f"TRUEANGLE_F32({array} + i)" if fixed else f"{array}[i]"

    rate = read(f"{name}_rates") if fixed else read(f"{name}_orders")
    if not fixed:
        phase = f"@n@_place(x, {name}_orders[i]) + {name}_phases[i]"
    elif waves.whole:
        phase = f"(uint32_t)x * TRUEANGLE_U32({name}_orders + i) + TRUEANGLE_U32({name}_phases + i)"
    else:
        phase = (
            f"(uint32_t)(((uint64_t)(x >> 32) * {name}_orders[2 * i]\n"
            f"            + (uint64_t)(uint32_t)x * {name}_orders[2 * i + 1]) >> 32)"
            f" + TRUEANGLE_U32({name}_phases + i)"
        )
    kind, quarter = ("uint32_t", "UINT32_C(0x40000000)") if fixed else ("double", "0.25")
    if damping is None:
        gain = [
            "const @real@ inverse = 1.0f / (1.0f + w * w);",
            "const @real@ real = -w * w * inverse, imaginary = -w * inverse;",
        ]
    else:
        gain = [
            f"const @real@ stiff = 1.0f - w * w, loss = {number(2.0 * damping)} * w;",
            "const @real@ inverse = 1.0f / (stiff * stiff + loss * loss);",
            "const @real@ real = stiff * inverse - 1.0f, imaginary = -loss * inverse;",
        ]
    return [
        "{",
        "    uint16_t i;",
        f"    for (i = 0; i < {len(waves.orders)}; i++) {{",
        f"        const @real@ w = signals->velocity * {number(1.0 / frequency)} * {rate};",
        *(f"        {line}" for line in gain),
        f"        const {kind} phase = {phase};",
        f"        sum += {read(f'{name}_sizes')}",
        f"            * (real * @n@_sine(phase) + imaginary * @n@_sine(phase + {quarter}));",
        "    }",
        "}",
    ]


_BENT = """\
/* Wind-up under a load, softer or stiffer beyond a knee. */
static inline @real@ @n@_bent(@real@ m, @real@ linear, @real@ cubic, @real@ beyond, @real@ knee)
{
    const @real@ past = m > knee ? m - knee : m < -knee ? m + knee : 0.0f;
    return linear * m + cubic * m * m * m + beyond * past;
}
"""

_SIZE = """\
static inline @real@ @n@_size(@real@ value)
{
    return value < 0.0f ? -value : value;
}
"""

_PASSED = """\
static inline @angle@ @n@_passed(@angle@ x, @angle@ start, @angle@ stop)
{
    return x < start ? start : x > stop ? stop : x;
}
"""

_FIND = """\
/* The angle x with x + pattern + error = goal: secants around the table. */
static inline @angle@ @n@_find(@angle@ goal, const @n@_signals *signals, int8_t direction@along@)
{
    @angle@ before = goal - @zero@;
    @angle@ x = @inverse@(goal - @n@_angle(@n@_error(before, signals, direction@given@)));
    @angle@ off_before = before - x;
    uint8_t i;
    for (i = 0; i < 20; i++) {
        const @angle@ off
            = x - @inverse_near@(goal - @n@_angle(@n@_error(x, signals, direction@given@))@x@);
        const @angle@ moved = x - before;
        @real@ slope;
        if ((@near@) || moved == 0) {
            return x - off;
        }
        slope = (@real@)(off - off_before) / (@real@)moved;
        slope = slope > 0.015625f ? (slope < 2.0f ? slope : 2.0f) : 0.015625f;
        before = x;
        off_before = off;
        x -= (@angle@)((@real@)off / slope);
    }
    return x;
}
"""

_FIND_AT_ONCE = """\
/* The angle x with x + pattern + error = goal: the error is the same at every angle. */
static inline @angle@ @n@_find(@angle@ goal, const @n@_signals *signals, int8_t direction@along@)
{
    return @inverse@(goal - @n@_angle(@n@_error(goal, signals, direction@given@)));
}
"""
