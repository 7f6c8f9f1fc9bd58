"""One Rust module without std: constant tables and the core's own arithmetic, unchanged."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import numpy as np

from .. import _core
from ..files import Kind
from .chain import Chain
from .portable import PortableTarget, identifier, self_test, table_lines
from .table import PER_RADIAN, Table
from .target import Header, comment_lines

__all__ = ["RustModule"]

_TYPES = {"q15": "i16", "q31": "i32", "f32": "f32"}
_ENDINGS = {"q15": "i16", "q31": "i32", "f32": "f32"}


class RustModule(PortableTarget):
    """``--to rust``: a file to name in ``mod``; no std, no allocation, no dependencies."""

    name = "rust"
    what = "a Rust module without std, tables and one function per shaft"
    kind: ClassVar[Kind] = Kind("a Rust module", (".rs",))

    def write(self, chain: Chain, header: Header) -> str:
        """The module."""
        parts = [_comment(chain, header)]
        parts += [_table(table) for table in chain.tables]
        if chain.whole:
            parts += [_corrected(chain), _self_test(chain)]
        parts += [_arithmetic(table) for table in _different(chain.tables)]
        return "\n".join(parts)


def _comment(chain: Chain, header: Header) -> str:
    proof = header.proof
    text = [
        f"Correction of an indicated angle. Made by {header.package}; do not edit.",
        "",
        "Angles are `u32`, 2^-32 turns, so that they wrap by themselves. A reading of n bits is "
        "shifted left by 32 - n. Corrected = indicated - correction, looked up at the indicated "
        "angle" + ("; all tables at the same one." if chain.at_indicated else "."),
        f"Differs from the model by at most {proof.max_arcsec:.6g} arcsec, rms "
        f"{proof.rms_arcsec:.4g} arcsec ({proof.how}).",
        f"Model: sha256 {header.sha256}",
        *table_lines(chain),
    ]
    text += [f"Note: {note}." for note in header.notes]
    return "\n".join(line for part in text for line in comment_lines(98, part, "//! ")) + "\n"


def _table(table: Table) -> str:
    name = identifier(table.shaft)
    values = np.asarray(table.knots)
    kind = _TYPES[table.number]
    element = kind if values.ndim == 1 else f"[{kind}; 2]"
    rows = [_element(value, table.number) for value in values]
    width = 8 if values.ndim == 1 else 4
    lines = ",\n".join("    " + ", ".join(rows[i : i + width]) for i in range(0, len(rows), width))
    shift = f", {table.shift}" if table.number == "q15" else ""
    function = f"{table.method}_{_ENDINGS[table.number]}"
    call = f"{function}(&{name.upper()}, {table.bits}{shift}, angle)"
    if table.number == "f32":
        call = f"({call} * {float(PER_RADIAN):.1f}) as i32"
    return f"""\
#[rustfmt::skip]
const {name.upper()}: [{element}; {len(rows)}] = [
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


def _corrected(chain: Chain) -> str:
    lines = [
        "/// The true angle behind an indicated one.",
        "#[inline]",
        "pub fn correct(indicated: u32) -> u32 {",
        f"    let start = indicated.wrapping_sub({chain.zero % 2**32});",
    ]
    last = "start"
    for table in chain.tables:
        at = "start" if chain.at_indicated else last
        if table.cycles != 1:
            at += f".wrapping_mul({int(table.cycles)})"
        name = identifier(table.shaft)
        lines.append(f"    let left = {last}.wrapping_sub({name}_correction({at}) as u32);")
        last = "left"
    return "\n".join([*lines, f"    {last}", "}", ""])


def _self_test(chain: Chain) -> str:
    pairs = ",\n".join(f"    ({a}, {b})" for a, b in self_test(chain))
    return f"""\
/// Readings and what `correct` makes of them.
#[rustfmt::skip]
pub const SELF_TEST: [(u32, u32); 8] = [
{pairs},
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
