"""Tables of an exported C header or Rust module, read back by what its comment says of them."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Final

import numpy as np

from ..model.model import HarmonicModel
from ..support.arrays import Array
from .chain import Chain
from .reading import Function, ReadTable, function_model, table_error
from .table import TURN, Table

if TYPE_CHECKING:
    from .target import Target

#: A knot of 16 bits counts no more than 2^31 units of an angle of 32 bits.
_LARGEST_SHIFT: Final = 31

_TABLE = re.compile(
    r"Table (?P<shaft>\w+): (?P<entries>\d+) entries, \d+ bytes, (?P<method>linear|cubic), "
    r"(?P<number>q15|q31|f32), shift (?P<shift>\d+), (?P<cycles>[-+.e\d]+) cycles"
)
_ZERO = re.compile(r"Zero: (-?\d+) ")
_TYPES = {"q15": np.int16, "q31": np.int32, "f32": np.float32}


def portable_model(text: str, path: str, target: Target) -> HarmonicModel:
    """Model of the tables of an exported C header or Rust module."""
    flowing = re.sub(r"\n(?: \*|//!) ?", " ", text)
    found = list(_TABLE.finditer(flowing))
    zero = _ZERO.search(flowing)
    if not found or zero is None:
        raise table_error(path, "no export of trueangle: its comment names no table")
    at_indicated = "all tables at the same" in flowing
    whole = int(zero[1])
    if abs(whole) >= 1 << 63:
        raise table_error(path, f"its zero is beyond 64 bits: {zero[1][:30]}")
    # Before turns were counted, the zero was written modulo one.
    whole -= 1 << 32 if whole >= 1 << 31 else 0
    tables, read = [], []
    for match in found:
        shaft, number = match["shaft"], match["number"]
        entries, shift, cycles = _stated(match, path)
        body = re.search(
            rf"(?:\b(?:\w+_)?{shaft}_knots\[\d+\][^=]*|const {shaft.upper()}(?:_KNOTS)?: [^=]*)"
            r"= [{\[](.*?)[}\]];",
            text,
            re.S,
        )
        wide = 2 if match["method"] == "cubic" else 1
        try:
            numbers = [float(n) for n in re.findall(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?", body[1])]  # type: ignore[index]
            knots = np.array(numbers).astype(_TYPES[number])
            if len(knots) != wide * (entries + 1):
                raise ValueError
        except (TypeError, ValueError, OverflowError):
            raise table_error(
                path, f"the table of shaft {shaft} does not hold {wide * (entries + 1)} numbers"
            ) from None
        table = Table(
            shaft,
            cycles,
            match["method"],
            number,
            entries.bit_length() - 1,
            shift,
            knots.reshape(-1, 2) if wide == 2 else knots,
        )
        # Tables are looked up at the zeroed reading; an indicated argument is the reading.
        move = whole / TURN * cycles if at_indicated else 0.0
        read.append(table)
        tables.append(ReadTable(shaft, cycles, _function(table, move), entries, table.step))
    chain = Chain(whole, tuple(read), at_indicated)
    computed = re.search(r"With ([\w, ]+): \w*step\(", flowing)
    note = (
        f"read from the tables of {target.name}; {computed[1]}, which its step computes at run "
        "time, is not in the model"
        if computed
        else ""
    )
    return function_model(
        tables,
        path,
        target,
        chain.correction,
        zero=whole / TURN,
        at_indicated=at_indicated,
        turns=chain.turns[0],
        note=note,
    )


def _stated(match: re.Match[str], path: str) -> tuple[int, int, float]:
    """Entries, shift and cycles that the comment states of a table."""
    try:
        entries, shift, cycles = int(match["entries"]), int(match["shift"]), float(match["cycles"])
    except ValueError:
        cycles = math.nan
    if not 0.0 < cycles < 1 << 31 or shift > _LARGEST_SHIFT:
        raise table_error(
            path,
            f"the table of shaft {match['shaft']} is said to have a shift of "
            f"{match['shift'][:20]} (0 to {_LARGEST_SHIFT}) and {match['cycles'][:30]} cycles",
        )
    return entries, shift, cycles


def _function(table: Table, move: float) -> Function:
    def function(x: Array) -> Array:
        angles = np.floor(((x - move) % 1.0) * TURN).astype(np.uint64).astype(np.uint32)
        return table.correction(angles) / TURN

    return function
