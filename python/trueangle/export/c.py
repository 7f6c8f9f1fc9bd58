"""One C99 header: constant tables and one inline function per shaft."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ..support.files import FileKind
from .chain import Chain, source_identifier
from .codetext import code_parts, decoding, filled_code, float_literal, number_rows
from .cstep import c_step
from .portable import PortableTarget, self_test, table_lines
from .runtimeterms import RunTimeTerms
from .table import PER_RADIAN, Table
from .target import CommentBlock

_TYPES = {"q15": "int16_t", "q31": "int32_t", "f32": "float"}
_READ = {"q15": "TRUEANGLE_I16", "q31": "TRUEANGLE_I32", "f32": "TRUEANGLE_F32"}


class CHeader(PortableTarget):
    """Target ``c``: for any microcontroller with a C99 compiler."""

    name = "c"
    decodes = True
    what = "a C99 header with tables and one inline function per shaft"
    kind: ClassVar[FileKind] = FileKind("a C header", (".h", ".hpp", ".txt"))

    def write(self, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
        """The header."""
        name = source_identifier(header.name)
        guard = f"TRUEANGLE_{name.upper()}_H"
        parts = [
            _comment(name, chain, terms, header),
            _part("begin", memory=_part("memory"), guard=guard, name=name),
            *(_table(f"{name}_{source_identifier(t.shaft)}", t) for t in chain.tables),
        ]
        if chain.whole:
            zero = chain.zero % 2**32
            parts.append(_part("correct", name=name, zero=zero, steps=_steps(name, chain, True)))
        parts += [_place(name, table) for table in chain.tables if not _is_whole(table)]
        wide = f"INT64_C({chain.zero})" if chain.zero >= 0 else f"(-INT64_C({-chain.zero}))"
        steps = _steps(name, chain, False)
        parts.append(_part("correct unwrapped", name=name, zero=wide, steps=steps))
        if terms is not None:
            whole = chain.whole and terms.whole
            step = c_step(terms, chain.zero, chain.at_indicated, whole)
            parts.append(filled_code(step, n=name))
        if chain.channels is not None:
            named = f"{name}_{{}}".format
            parts.append(decoding(chain.channels, code_parts("header.c"), 2.0**32, named))
        parts.append(_self_test(name, chain))
        parts.append(f"#endif /* {guard} */\n")
        return "\n".join(parts)


def _part(part: str, **values: object) -> str:
    return filled_code(code_parts("header.c")[part], **values)


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
    if chain.channels is not None:
        roles = ", ".join(chain.channels.roles)
        own.append(f"Channels: uint32_t indicated = {name}_decode({roles});")
    own += [
        f"{'Or' if chain.whole else 'Use'}: int64_t corrected = {name}_correct_unwrapped(turns, "
        "indicated), in 2^-32 turns: whole turns of the output since the model's zero "
        "(negative backwards) and the reading within the turn. (uint32_t)corrected is the angle.",
        *([] if terms is None else [terms.use(f"{name}_step", "&state", "{0}")]),
        f"The bound holds for every input of up to {bits} bits.",
        *table_lines(chain),
    ]
    return "/*\n" + "\n".join(header.comment(" * ", *own)) + "\n */"


def _table(name: str, table: Table) -> str:
    """The knots of a shaft, and the function that interpolates between them."""
    kind = _TYPES[table.number]
    scale = f" * INT32_C({1 << table.shift})" if table.number == "q15" else ""
    same = table.method == "cubic" and table.number != "f32"
    correction = _part(
        f"{table.method} {'whole' if same else table.number}",
        read=_READ[table.number],
        index=f"(uint16_t)(angle >> 16) >> {16 - table.bits}",
        bits=table.bits,
        down=16 - table.shift,
        half=1 << (15 - table.shift),
        per_radian=f"{float(PER_RADIAN):.1f}f",
        wide=scale,
    )
    flat = [_number(value, table.number) for value in np.asarray(table.knots).ravel()]
    return _part(
        "knots",
        correction=correction,
        name=name,
        type=kind,
        count=len(flat),
        rows=number_rows(flat),
        cycles=f"{table.cycles:g}",
    )


def _number(value: float, number: str) -> str:
    return f"{float_literal(float(np.float32(value)))}f" if number == "f32" else str(int(value))


def _is_whole(table: Table) -> bool:
    return table.cycles == int(table.cycles)


def _steps(name: str, chain: Chain, wraps: bool) -> str:
    """From ``start`` to ``corrected``, one line per table."""
    lines = []
    for table in chain.tables:
        at = "start" if chain.at_indicated else "corrected"
        shaft = f"{name}_{source_identifier(table.shaft)}"
        if not _is_whole(table):
            at = f"{shaft}_place({at})"
        elif table.cycles != 1:
            at = f"(uint32_t){at} * UINT32_C({int(table.cycles)})"
        else:
            at = f"(uint32_t){at}"
        lines.append(f"corrected -= {'(uint32_t)' if wraps else ''}{shaft}_correction({at});")
    return "\n".join(lines)


def _place(name: str, table: Table) -> str:
    """The angle of a shaft that does not come back with the output."""
    turns, fraction = table.ratio
    shaft, cycles = f"{name}_{source_identifier(table.shaft)}", f"{table.cycles:.17g}"
    return _part("place", name=shaft, cycles=cycles, turns=turns, fraction=fraction)


def _self_test(name: str, chain: Chain) -> str:
    # Contracted products move a float's last bit: some 2^-32 turns.
    close = 0 if all(table.number != "f32" for table in chain.tables) else 64
    tests = ",\n".join(
        f"        {{{turn}, UINT32_C({a}), UINT32_C({b})}}" for turn, a, b in self_test(chain)
    )
    result = f"{name}_correct(tests[i].angle)"
    if not chain.whole:
        result = f"(uint32_t){name}_correct_unwrapped(tests[i].turns, tests[i].angle)"
    return _part("self test", name=name, tests=tests, result=result, close=close, twice=2 * close)
