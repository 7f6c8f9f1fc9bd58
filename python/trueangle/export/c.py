"""One C99 header: constant tables and one inline function per shaft."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..files import Kind
from .chain import Chain
from .portable import PortableTarget, identifier, self_test, table_lines
from .table import PER_RADIAN, Table
from .target import Header, comment_lines

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
#define TRUEANGLE_F32(at) pgm_read_float(at)
#else
#define TRUEANGLE_TABLE
#define TRUEANGLE_I16(at) (*(at))
#define TRUEANGLE_I32(at) (*(at))
#define TRUEANGLE_F32(at) (*(at))
#endif
#endif
"""


class CHeader(PortableTarget):
    """``--to c``: for any microcontroller with a C99 compiler."""

    name = "c"
    what = "a C99 header with tables and one inline function per shaft"
    kind: ClassVar[Kind] = Kind("a C header", (".h", ".hpp"))

    def write(self, chain: Chain, header: Header) -> str:
        """The header."""
        name = identifier(header.name)
        guard = f"TRUEANGLE_{name.upper()}_H"
        parts = [
            _comment(name, chain, header),
            f"#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n\n{_MEMORY}",
            "/* Right shifts of negative numbers must keep the sign. */\n"
            f"typedef char {name}_shifts_arithmetically\n"
            "    [(INT32_C(-1) >> 1) == INT32_C(-1) ? 1 : -1];\n",
        ]
        names = _table_names(chain)
        parts += [
            _table(f"{name}_{shaft}", table)
            for shaft, table in zip(names, chain.tables, strict=True)
        ]
        if chain.whole:
            parts += [_corrected(name, names, chain), _self_test(name, chain)]
        parts.append(f"#endif /* {guard} */\n")
        return "\n".join(parts)


def _table_names(chain: Chain) -> list[str]:
    return [identifier(table.shaft) for table in chain.tables]


def _comment(name: str, chain: Chain, header: Header) -> str:
    proof = header.proof
    bits = f"{proof.inputs.bit_length() - 1} bits" if proof.every_input else "32 bits"
    text = [
        f"{name}: correction of an indicated angle. Made by {header.package}; do not edit.",
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
        text.append(f"Use: uint32_t corrected = {name}_correct(indicated);")
    else:
        text.append(
            "Use: subtract the corrections of the shafts from the indicated output angle, each "
            "looked up at the unwrapped angle of its own shaft, modulo one of its turns."
        )
    text += [
        f"Differs from the model by at most {proof.max_arcsec:.6g} arcsec for every input of up to "
        f"{bits}, rms {proof.rms_arcsec:.4g} arcsec ({proof.how}).",
        f"Model: sha256 {header.sha256}",
        *table_lines(chain),
    ]
    text += [f"Note: {note}." for note in header.notes]
    lines = [line for part in text for line in comment_lines(98, part, " * ")]
    return "/*\n" + "\n".join(lines) + "\n */"


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


def _corrected(name: str, names: list[str], chain: Chain) -> str:
    lines = [
        "/* The true angle behind an indicated one. */",
        f"static inline uint32_t {name}_correct(uint32_t indicated)",
        "{",
        f"    const uint32_t start = indicated - UINT32_C({chain.zero % 2**32});",
        "    uint32_t corrected = start;",
    ]
    for shaft, table in zip(names, chain.tables, strict=True):
        at = "start" if chain.at_indicated else "corrected"
        if table.cycles != 1:
            at += f" * UINT32_C({int(table.cycles)})"
        lines.append(f"    corrected -= (uint32_t){name}_{shaft}_correction({at});")
    return "\n".join([*lines, "    return corrected;", "}", ""])


def _self_test(name: str, chain: Chain) -> str:
    pairs = self_test(chain)
    # Contracted products move a float's last bit: some 2^-32 turns.
    close = 0 if all(table.number != "f32" for table in chain.tables) else 64
    rows = ",\n".join(f"        {{UINT32_C({a}), UINT32_C({b})}}" for a, b in pairs)
    return f"""\
/* 0 where this program computes what was proven: run it once on the device. */
static inline int {name}_self_test(void)
{{
    static const uint32_t pairs[{len(pairs)}][2] = {{
{rows}
    }};
    int i;
    for (i = 0; i < {len(pairs)}; i++) {{
        const uint32_t off = {name}_correct(pairs[i][0]) - pairs[i][1];
        if (off + UINT32_C({close}) > UINT32_C({2 * close})) {{
            return i + 1;
        }}
    }}
    return 0;
}}
"""
