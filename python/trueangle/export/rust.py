"""One Rust module without std: constant tables and the core's own arithmetic, unchanged."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import numpy as np

import trueangle._core as _core

from ..support.files import Kind
from .chain import Chain, source_identifier
from .portable import PortableTarget, self_test, table_lines
from .runtimeterms import RunTimeTerms
from .ruststep import rust_step
from .table import PER_RADIAN, Table
from .target import CommentBlock

__all__ = ["RustModule"]

_TYPES = {"q15": "i16", "q31": "i32", "f32": "f32"}
_ENDINGS = {"q15": "i16", "q31": "i32", "f32": "f32"}


class RustModule(PortableTarget):
    """Target ``rust``: a file to name in ``mod``; no std, no allocation, no dependencies."""

    name = "rust"
    what = "a Rust module without std, tables and one function per shaft"
    kind: ClassVar[Kind] = Kind("a Rust module", (".rs",))

    def write(self, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
        """The module."""
        parts = [_comment(chain, terms, header)]
        parts += [_table(table) for table in chain.tables]
        if chain.whole:
            parts.append(_corrected(chain))
        parts += [_unwrapped(chain), _self_test(chain)]
        if terms is not None:
            whole = chain.whole and terms.whole
            parts.append(rust_step(terms, chain.zero, chain.at_indicated, whole))
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
        *([] if terms is None else [terms.use("step", "&mut state", "State::default()")]),
        *table_lines(chain),
    ]
    return "\n".join(header.comment("//! ", *own)) + "\n"


def _table(table: Table) -> str:
    name = source_identifier(table.shaft)
    # An ending of its own: no shaft has the name of another constant.
    knots = f"{name.upper()}_KNOTS"
    values = np.asarray(table.knots)
    kind = _TYPES[table.number]
    element = kind if values.ndim == 1 else f"[{kind}; 2]"
    rows = [_element(value, table.number) for value in values]
    width = 8 if values.ndim == 1 else 4
    lines = ",\n".join("    " + ", ".join(rows[i : i + width]) for i in range(0, len(rows), width))
    shift = f", {table.shift}" if table.number == "q15" else ""
    function = f"{table.method}_{_ENDINGS[table.number]}"
    call = f"{function}(&{knots}, {table.bits}{shift}, angle)"
    if table.number == "f32":
        call = f"({call} * {float(PER_RADIAN):.1f}) as i32"
    return f"""\
#[rustfmt::skip]
const {knots}: [{element}; {len(rows)}] = [
{lines},
];

/// Subtract this, at an angle of the shaft ({table.cycles:g} cycles per output turn).
#[inline]
pub fn {name}_correction(angle: u32) -> i32 {{
    {call}
}}
"""


def _element(value: Any, number: str) -> str:
    if np.ndim(value):
        return "[" + ", ".join(_element(part, number) for part in value) + "]"
    if number != "f32":
        return str(int(value))
    text = f"{float(np.float32(value)):.9g}"
    return text if any(c in text for c in ".e") else text + ".0"


def _steps(chain: Chain) -> list[str]:
    """What each table takes off ``left``, an expression in it and in ``start``."""
    steps = []
    for table in chain.tables:
        at, name = "start" if chain.at_indicated else "left", source_identifier(table.shaft)
        if table.cycles != int(table.cycles):
            at = f"{name}_place({at})"
        else:
            at = f"({at} as u32)" if table.cycles != 1 else f"{at} as u32"
            if table.cycles != 1:
                at += f".wrapping_mul({int(table.cycles)})"
        steps.append(f"{name}_correction({at})")
    return steps


def _corrected(chain: Chain) -> str:
    lines = [
        "/// The true angle behind an indicated one.",
        "#[inline]",
        "pub fn correct(indicated: u32) -> u32 {",
        "    correct_unwrapped(0, indicated) as u32",
        "}",
    ]
    return "\n".join([*lines, ""])


def _unwrapped(chain: Chain) -> str:
    places = []
    for table in chain.tables:
        if table.cycles != int(table.cycles):
            turns, fraction = table.ratio
            places.append(
                f"""\
/// The angle of a shaft that makes {table.cycles:.17g} turns per output turn.
#[inline]
pub fn {source_identifier(table.shaft)}_place(output: i64) -> u32 {{
    let turns = ((output >> 32) as u64).wrapping_mul({turns});
    let angle = u64::from(output as u32).wrapping_mul({fraction});
    (turns.wrapping_add(angle) >> 32) as u32
}}

"""
            )
    lines = [
        "/// The true angle with its whole turns, in 2^-32 turns, behind an indicated one.",
        "#[inline]",
        "pub fn correct_unwrapped(turns: i32, indicated: u32) -> i64 {",
        f"    let start = (i64::from(turns) << 32) + i64::from(indicated) - ({chain.zero});",
        "    let left = start;",
        *(f"    let left = left - i64::from({step});" for step in _steps(chain)),
        "    left",
        "}",
        "",
    ]
    return "".join(places) + "\n".join(lines)


def _self_test(chain: Chain) -> str:
    tests = self_test(chain)
    if chain.whole:
        pairs = ",\n".join(f"    ({a}, {b})" for _, a, b in tests)
        return f"""\
/// Readings and what `correct` makes of them.
#[rustfmt::skip]
pub const SELF_TEST: [(u32, u32); 8] = [
{pairs},
];
"""
    triples = ",\n".join(f"    ({turn}, {a}, {b})" for turn, a, b in tests)
    return f"""\
/// Turns and readings, and the angle that `correct_unwrapped` makes of them.
#[rustfmt::skip]
pub const SELF_TEST: [(i32, u32, u32); 8] = [
{triples},
];
"""


def _different(tables: tuple[Table, ...]) -> list[Table]:
    return list({(table.method, table.number): table for table in tables}.values())


def _arithmetic(table: Table) -> str:
    """The functions this table needs, as they stand in the core."""
    source = _core.table_source(table.method)
    wanted = {f"{table.method}_{_ENDINGS[table.number]}"}
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
