"""One Rust module without std: constant tables and the core's own arithmetic, unchanged."""

from __future__ import annotations

import re
from typing import Any, ClassVar

import numpy as np

import trueangle._core as _core

from ..support.files import FileKind
from .chain import Chain, source_identifier
from .codetext import code_parts, filled_code, float_literal, number_rows
from .portable import PortableTarget, self_test, table_lines
from .runtimeterms import RunTimeTerms
from .ruststep import rust_step
from .table import PER_RADIAN, Table
from .target import CommentBlock

_TYPES = {"q15": "i16", "q31": "i32", "f32": "f32"}


class RustModule(PortableTarget):
    """Target ``rust``: a file to name in ``mod``; no std, no allocation, no dependencies."""

    name = "rust"
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
            parts.append(chain.decoding(code_parts("module.rs")["decode"]))
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
        *([] if chain.channels is None else ["`decode` gives the reading of two channels."]),
        *([] if terms is None else [terms.use("step", "&mut state", "State::default()")]),
        *table_lines(chain),
    ]
    return "\n".join(header.comment("//! ", *own)) + "\n"


def _part(part: str, **values: object) -> str:
    return filled_code(code_parts("module.rs")[part], **values)


def _table(table: Table) -> str:
    name = source_identifier(table.shaft)
    # An ending of its own: no shaft has the name of another constant.
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
    """What a table takes off ``left``, an expression in it and in ``start``."""
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
    """The functions this table needs, as they stand in the core."""
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
