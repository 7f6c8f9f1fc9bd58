"""One C99 header: constant tables and one inline function per shaft."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..support.files import Kind
from .chain import Chain, source_identifier
from .cstep import c_step
from .portable import PortableTarget, self_test, table_lines
from .runtimeterms import RunTimeTerms
from .table import PER_RADIAN, Table
from .target import CommentBlock

__all__ = ["CHeader"]

_TYPES = {"q15": "int16_t", "q31": "int32_t", "f32": "float"}
_READ = {"q15": "TRUEANGLE_I16", "q31": "TRUEANGLE_I32", "f32": "TRUEANGLE_F32"}

#: AVR keeps constants in RAM unless they are read by an instruction of their own.
_MEMORY = """\
#ifndef TRUEANGLE_TABLE
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define TRUEANGLE_TABLE PROGMEM
#define TRUEANGLE_I16(at) ((int16_t)pgm_read_word(at))
#define TRUEANGLE_I32(at) ((int32_t)pgm_read_dword(at))
#define TRUEANGLE_U32(at) ((uint32_t)pgm_read_dword(at))
#define TRUEANGLE_F32(at) pgm_read_float(at)
#else
#define TRUEANGLE_TABLE
#define TRUEANGLE_I16(at) (*(at))
#define TRUEANGLE_I32(at) (*(at))
#define TRUEANGLE_U32(at) (*(at))
#define TRUEANGLE_F32(at) (*(at))
#endif
#endif
"""


class CHeader(PortableTarget):
    """Target ``c``: for any microcontroller with a C99 compiler."""

    name = "c"
    what = "a C99 header with tables and one inline function per shaft"
    kind: ClassVar[Kind] = Kind("a C header", (".h", ".hpp"))

    def write(self, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
        """The header."""
        name = source_identifier(header.name)
        guard = f"TRUEANGLE_{name.upper()}_H"
        parts = [
            _comment(name, chain, terms, header),
            f"#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n{_MEMORY}",
            "/* Right shifts of negative numbers must keep the sign. */\n"
            f"typedef char {name}_shifts_arithmetically\n"
            "    [(INT32_C(-1) >> 1) == -1 && (INT64_C(-1) >> 1) == -1 ? 1 : -1];\n",
        ]
        names = _table_names(chain)
        parts += [
            _table(f"{name}_{shaft}", table)
            for shaft, table in zip(names, chain.tables, strict=True)
        ]
        if chain.whole:
            parts.append(_corrected(name, names, chain))
        parts.append(_unwrapped(name, names, chain))
        if terms is not None:
            whole = chain.whole and terms.whole
            parts.append(c_step(terms, chain.zero, chain.at_indicated, whole).replace("@n@", name))
        parts.append(_self_test(name, chain))
        parts.append(f"#endif /* {guard} */\n")
        return "\n".join(parts)


def _table_names(chain: Chain) -> list[str]:
    return [source_identifier(table.shaft) for table in chain.tables]


def _comment(name: str, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
    proof = header.proof
    bits = f"{(proof.inputs // chain.turns[0]).bit_length() - 1}" if proof.every_input else "32"
    own = [
        f"{name}: correction of an indicated angle; do not edit.",
        "",
        "Angles: uint32_t, 2^-32 turns, so that they wrap by themselves. A reading of n bits is "
        "shifted left by 32 - n.",
        "Sign: corrected = indicated - correction. Argument: the indicated angle"
        + (
            "; all tables at the same one."
            if chain.at_indicated
            else ", and of each further shaft what the tables before it have left."
        ),
    ]
    if chain.whole:
        own.append(f"Use: uint32_t corrected = {name}_correct(indicated);")
    own += [
        f"{'Or' if chain.whole else 'Use'}: int64_t corrected = {name}_correct_unwrapped(turns, "
        "indicated), in 2^-32 turns: the whole turns that the output has made since the model's "
        "zero, negative backwards, and the reading within the turn; (uint32_t) of it is the angle.",
        *([] if terms is None else [terms.use(f"{name}_step", "&state", "{0}")]),
        f"The bound holds for every input of up to {bits} bits.",
        *table_lines(chain),
    ]
    return "/*\n" + "\n".join(header.comment(" * ", *own)) + "\n */"


def _number(value: float, number: str) -> str:
    if number == "f32":
        text = f"{float(np.float32(value)):.9g}"
        return text + ("f" if any(c in text for c in ".e") else ".0f")
    return str(int(value))


def _rows(values: list[str], width: int = 8) -> str:
    return ",\n".join(
        "    " + ", ".join(values[i : i + width]) for i in range(0, len(values), width)
    )


def _table(name: str, table: Table) -> str:
    kind = _TYPES[table.number]
    flat = [_number(value, table.number) for value in np.asarray(table.knots).ravel()]
    lines = [
        f"static const {kind} {name}_knots[{len(flat)}] TRUEANGLE_TABLE = {{",
        _rows(flat),
        "};",
        "",
        f"/* Subtract this, at an angle of the shaft ({table.cycles:g} cycles per output turn). */",
    ]
    body = _LINEAR if table.method == "linear" else _CUBIC
    code = body[table.number]
    fill = {
        "name": name,
        "read": _READ[table.number],
        "type": kind,
        "index": f"(uint16_t)(angle >> 16) >> {16 - table.bits}",
        "bits": table.bits,
        "shift": table.shift,
        "scale": 1 << table.shift,
        "down": 16 - table.shift,
        "half": 1 << (15 - table.shift),
        "per_radian": f"{float(PER_RADIAN):.1f}f",
    }
    for key, value in fill.items():
        code = code.replace(f"@{key}@", str(value))
    return "\n".join(lines) + "\n" + code


_LINEAR = {
    "q15": """\
static inline int32_t @name@_correction(uint32_t angle)
{
    const int16_t *knot = @name@_knots + (@index@);
    const uint16_t t = (uint16_t)((angle << @bits@) >> 16);
    const int16_t low = @read@(knot);
    const int32_t step = @read@(knot + 1) - low;
    const int32_t base = low * INT32_C(65536) + INT32_C(@half@);
    return (base + step * (int32_t)t) >> @down@;
}
""",
    "q31": """\
static inline int32_t @name@_correction(uint32_t angle)
{
    const int32_t *knot = @name@_knots + (@index@);
    const int32_t t = (int32_t)((angle << @bits@) >> 1);
    const int32_t low = @read@(knot);
    const int64_t step = @read@(knot + 1) - low;
    return low + (int32_t)((step * t + (INT64_C(1) << 30)) >> 31);
}
""",
    "f32": """\
static inline float @name@_radians(uint32_t angle)
{
    const float *knot = @name@_knots + (@index@);
    const float t = (float)((angle << @bits@) >> 8) * 5.9604644775390625e-8f;
    const float low = @read@(knot);
    return low + (@read@(knot + 1) - low) * t;
}

static inline int32_t @name@_correction(uint32_t angle)
{
    return (int32_t)(@name@_radians(angle) * @per_radian@);
}
""",
}

_BETWEEN = """\
static inline int32_t @name@_scaled(int32_t a, int32_t t)
{
    return (int32_t)(((int64_t)a * t + (INT64_C(1) << 30)) >> 31);
}

static inline int32_t @name@_correction(uint32_t angle)
{
    const @type@ *knot = @name@_knots + 2 * (uint32_t)(@index@);
    const int32_t t = (int32_t)((angle << @bits@) >> 1);
    const int32_t low = @read@(knot)@wide@, rise = @read@(knot + 1)@wide@;
    const int32_t high = @read@(knot + 2)@wide@, end = @read@(knot + 3)@wide@;
    const int32_t step = high - low;
    const int32_t third = rise + end - 2 * step;
    const int32_t second = step - rise - third;
    return low + @name@_scaled(@name@_scaled(@name@_scaled(third, t) + second, t) + rise, t);
}
"""

_CUBIC = {
    "q15": _BETWEEN.replace("@wide@", " * INT32_C(@scale@)"),
    "q31": _BETWEEN.replace("@wide@", ""),
    "f32": """\
static inline float @name@_radians(uint32_t angle)
{
    const float *knot = @name@_knots + 2 * (uint32_t)(@index@);
    const float t = (float)((angle << @bits@) >> 8) * 5.9604644775390625e-8f;
    const float low = @read@(knot), rise = @read@(knot + 1);
    const float step = @read@(knot + 2) - low;
    const float third = rise + @read@(knot + 3) - 2.0f * step;
    const float second = step - rise - third;
    return low + t * (rise + t * (second + t * third));
}

static inline int32_t @name@_correction(uint32_t angle)
{
    return (int32_t)(@name@_radians(angle) * @per_radian@);
}
""",
}


def _steps(name: str, names: list[str], chain: Chain) -> list[str]:
    """From ``start`` to ``corrected``, one line per table."""
    lines = []
    for shaft, table in zip(names, chain.tables, strict=True):
        at = "start" if chain.at_indicated else "corrected"
        if table.cycles != int(table.cycles):
            at = f"{name}_{shaft}_place({at})"
        elif table.cycles != 1:
            at = f"(uint32_t){at} * UINT32_C({int(table.cycles)})"
        else:
            at = f"(uint32_t){at}"
        lines.append(f"{name}_{shaft}_correction({at});")
    return lines


def _corrected(name: str, names: list[str], chain: Chain) -> str:
    return "\n".join(
        [
            "/* The true angle behind an indicated one. */",
            f"static inline uint32_t {name}_correct(uint32_t indicated)",
            "{",
            f"    const uint32_t start = indicated - UINT32_C({chain.zero % 2**32});",
            "    uint32_t corrected = start;",
            *(f"    corrected -= (uint32_t){step}" for step in _steps(name, names, chain)),
            "    return corrected;",
            "}",
            "",
        ]
    )


def _unwrapped(name: str, names: list[str], chain: Chain) -> str:
    places = []
    for shaft, table in zip(names, chain.tables, strict=True):
        if table.cycles != int(table.cycles):
            turns, fraction = table.ratio
            places.append(
                f"""\
/* The angle of a shaft that makes {table.cycles:.17g} turns per output turn. */
static inline uint32_t {name}_{shaft}_place(int64_t output)
{{
    return (uint32_t)(((uint64_t)(output >> 32) * UINT64_C({turns})
        + (uint64_t)(uint32_t)output * UINT64_C({fraction})) >> 32);
}}

"""
            )
    return "".join(places) + "\n".join(
        [
            "/* The same with the whole turns of the output, before and after; 2^-32 turns. */",
            f"static inline int64_t {name}_correct_unwrapped(int32_t turns, uint32_t angle)",
            "{",
            f"    const int64_t start = turns * INT64_C(4294967296) + angle - {_wide(chain.zero)};",
            "    int64_t corrected = start;",
            *(f"    corrected -= {step}" for step in _steps(name, names, chain)),
            "    return corrected;",
            "}",
            "",
        ]
    )


def _wide(value: int) -> str:
    return f"INT64_C({value})" if value >= 0 else f"(-INT64_C({-value}))"


def _self_test(name: str, chain: Chain) -> str:
    # Contracted products move a float's last bit: some 2^-32 turns.
    close = 0 if all(table.number != "f32" for table in chain.tables) else 64
    rows = ",\n".join(
        f"        {{{turn}, UINT32_C({a}), UINT32_C({b})}}" for turn, a, b in self_test(chain)
    )
    result = f"{name}_correct(tests[i].angle)"
    if not chain.whole:
        result = f"(uint32_t){name}_correct_unwrapped(tests[i].turns, tests[i].angle)"
    return f"""\
/* 0 where this program computes what was proven: run it once on the device. */
static inline int {name}_self_test(void)
{{
    static const struct {{ int32_t turns; uint32_t angle, corrected; }} tests[8] = {{
{rows}
    }};
    int i;
    for (i = 0; i < 8; i++) {{
        const uint32_t off = {result} - tests[i].corrected;
        if (off + UINT32_C({close}) > UINT32_C({2 * close})) {{
            return i + 1;
        }}
    }}
    return 0;
}}
"""
