"""What the C and the Rust export share: options, sizes, tables, self-test, and their reading."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..model.term import Term
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .chain import Chain, make_chain, source_identifier
from .pattern import TurnPattern
from .proof import lost_orders
from .reading import Function, ReadTable, function_model
from .runtimeterms import DIRECTIONS, RunTimeTerms, is_own_signal
from .table import METHODS, NUMBERS, TURN, Table
from .target import CommentBlock, Made, Option, TablePart, Target

Places = NDArray[np.int64]

#: Sizes that are tried; where none is requested, up to the largest default.
_SIZES = tuple(1 << bits for bits in range(3, 17))


#: Readings of the self-test: spread, and none of them a knot.
_TEST_ANGLES = tuple((i * 0x1F123BB5 + 0x01234567) % 2**32 for i in range(8))

#: A knot of 16 bits counts at most 2^31 units of an angle of 32 bits.
_LARGEST_SHIFT: Final = 31

_TABLE = re.compile(
    r"Table (?P<shaft>\w+): (?P<entries>\d+) entries, \d+ bytes, (?P<method>linear|cubic), "
    r"(?P<number>q15|q31|f32), shift (?P<shift>\d+), (?P<cycles>[-+.e\d]+) cycles"
)
_ZERO = re.compile(r"Zero: (-?\d+) ")
_TYPES = {"q15": np.int16, "q31": np.int32, "f32": np.float32}


class PortableTarget(Target):
    """Tables in the arithmetic of `trueangle-table`, one function per shaft."""

    sign = "subtract"
    options = {
        "bits": Option(int, 24, "bits of a reading, at most 24: all are evaluated"),
        "entries": Option(int, None, "of each table, a power of two (default: by the model)"),
        "method": Option(METHODS, None, "of interpolation"),
        "number": Option(NUMBERS, None, "int16, int32 or float (default: the first that holds it)"),
        "name": Option(str, None, "of the functions (default: the file's)"),
        "direction": Option(
            DIRECTIONS, "auto", "source of the direction of travel, if a term needs it"
        ),
    }

    def sizes(self, options: Mapping[str, Any]) -> Sequence[int]:
        if options["entries"]:
            return ()
        free = options["method"] is None and options["number"] is None
        # Lines with more segments take more flash than cubics of the same accuracy.
        return tuple(size for size in _SIZES if not free or size <= 1024)

    def finer(self, options: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        if options["entries"] or options["method"] or options["number"]:
            return ()
        return [{**options, "method": "cubic", "number": number} for number in NUMBERS[1:]]

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        chain = replace(_chain(pattern, options), channels=pattern.source.channels)
        terms = self.at_run_time(pattern, options)
        bits = options["bits"]
        if not 1 <= bits <= 32:
            raise ArgumentError(f"bits must be from 1 to 32, got {bits}")
        floating = any(table.number == "f32" for table in chain.tables)
        notes = []
        if not chain.whole:
            notes.append(
                "a shaft does not turn a whole number of times "
                "per output turn. correct_unwrapped takes the turns of the output, "
                "counted as in the fitted readings, and the angle"
            )
        if floating:
            notes.append(
                "float: the same bits everywhere with -ffp-contract=off; the stated maximum holds "
                "without it"
            )
        return Made(
            text=lambda header: self.write(chain, terms, header),
            entries=sum(table.entries for table in chain.tables),
            bytes=sum(table.bytes for table in chain.tables),
            part=_part(chain, pattern, floating),
            floor_arcsec=math.hypot(*(table.floor_arcsec for table in chain.tables), 0.0),
            lost=lambda: _lost(chain, pattern),
            notes=tuple(notes),
            tables=tuple(
                {
                    "shaft": table.shaft,
                    "cycles_per_turn": table.cycles,
                    "entries": table.entries,
                    "bytes": table.bytes,
                    "method": table.method,
                    "number": table.number,
                }
                for table in chain.tables
            ),
        )

    def write(self, chain: Chain, terms: RunTimeTerms | None, header: CommentBlock) -> str:
        """The file's text."""
        raise NotImplementedError

    def holds(self, term: Term) -> bool:
        return is_own_signal(term)

    def at_run_time(self, pattern: TurnPattern, options: Mapping[str, Any]) -> RunTimeTerms | None:
        terms = tuple(filter(is_own_signal, pattern.left_out))
        if not terms:
            return None
        if pattern.model.argument == "indicated":
            terms = tuple(filter(is_own_signal, pattern.source.terms))
        return RunTimeTerms.of(pattern.source, terms, options["direction"])

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        return _portable_model(text, path, self)


def table_lines(chain: Chain) -> list[str]:
    """What the comment states about each table; `import` reads it back."""
    lines = [
        f"Table {source_identifier(table.shaft)}: {table.entries} entries, {table.bytes} bytes, "
        f"{table.method}, {table.number}, shift {table.shift}, {table.cycles:.17g} cycles per "
        "output turn."
        for table in chain.tables
    ]
    # Where a shaft's place depends on the turn, the zero's own turn counts.
    zero = chain.zero % 2**32 if chain.whole else chain.zero
    return [*lines, f"Zero: {zero} is subtracted first."]


def self_test(chain: Chain) -> list[tuple[int, int, int]]:
    """Eight readings, turn and angle, and what the device makes of the angle."""
    turns = [0 if chain.whole else i - 3 for i in range(len(_TEST_ANGLES))]
    places = np.array([t * 2**32 + a for t, a in zip(turns, _TEST_ANGLES, strict=True)])
    found = (int(a) for a in chain.corrected(places))
    return list(zip(turns, _TEST_ANGLES, found, strict=True))


def _chain(pattern: TurnPattern, options: Mapping[str, Any]) -> Chain:
    shafts = pattern.shafts()
    if not shafts:  # all that there is follows travel, speed, heat or load
        return make_chain(pattern, "linear", "q31", [])
    method, number, entries = (options[key] for key in ("method", "number", "entries"))
    numbers = NUMBERS if number is None else (number,)
    if entries is not None:
        _check(shafts, entries)
        return _first_that_fits(pattern, method or "linear", numbers, [entries] * len(shafts))
    # The smallest tables that leave less than the model itself does not know.
    known = pattern.uncertainty_arcsec
    # Share of the model's uncertainty that a default table may add: a twentieth more in all.
    allowed = None if known is None else known / 3.0
    sizes = []
    for _, cycles, part in shafts:
        sizes.append(_smallest(part, cycles, method or "linear", number or "q15", allowed))
    if method is None and number is None and max(sizes) > 256:
        # Cubic tables of 32 bits hold fine patterns in less flash than lines do.
        sizes = [_smallest(part, cycles, "cubic", "q15", allowed) for _, cycles, part in shafts]
        return _first_that_fits(pattern, "cubic", NUMBERS[1:], sizes)
    return _first_that_fits(pattern, method or "linear", numbers, sizes)


def _first_that_fits(
    pattern: TurnPattern, method: str, numbers: Sequence[str], sizes: list[int]
) -> Chain:
    """The first number that holds the corrections, int16 with a floor below the uncertainty."""
    *tried, last = numbers
    allowed = pattern.uncertainty_arcsec
    for number in tried:
        try:
            chain = make_chain(pattern, method, number, sizes)
        except ArgumentError:
            continue
        floor = math.hypot(*(table.floor_arcsec for table in chain.tables), 0.0)
        if number != "q15" or allowed is None or floor <= allowed:
            return chain
    return make_chain(pattern, method, last, sizes)


def _check(shafts: Sequence[tuple[str, float, TurnPattern]], entries: int) -> None:
    for name, _, part in shafts:
        part.check_orders(entries, f"shaft {name}", _SIZES)


def _smallest(
    part: TurnPattern, cycles: float, method: str, number: str, allowed: float | None
) -> int:
    """Entries for which a rough rms is below what is allowed, or a thousandth of the pattern."""
    amplitude = math.sqrt(sum(c * c for c in part.lines.values()) / 2.0) / cycles
    wanted = 1e-3 * amplitude * ARCSEC_PER_TURN if allowed is None else allowed
    probe = np.arange(4096) * 0x9E3779B1 % 2**32
    top = max(part.lines, default=0.0)
    for size in _SIZES:
        if size <= 2.0 * top or (size > 4096 and size > 8.0 * top):
            continue
        chain = make_chain(part, method, "f32" if number == "q15" else number, size)
        difference = chain.correction(probe) - part.taken_off(probe / TURN)
        if float(np.sqrt(np.mean(difference**2))) / cycles * ARCSEC_PER_TURN <= wanted:
            return size
        largest = size
    return largest


def _lost(chain: Chain, pattern: TurnPattern) -> list[dict[str, float]]:
    rows = []
    for table, (_, cycles, part) in zip(chain.tables, pattern.shafts(), strict=True):
        # One table and its shaft's exact correction, both in turns of the output.
        move = pattern.zero * cycles if chain.at_indicated else 0.0

        def alone(angles: Places, table: Table = table) -> Array:
            return np.asarray(table.correction(angles.astype(np.uint32)) / TURN)

        def exact(
            x: Array, part: TurnPattern = part, cycles: float = cycles, move: float = move
        ) -> Array:
            return part.correction(x + move) / cycles

        found = lost_orders(alone, exact, part.lines)
        rows += [{"order": k * cycles, "arcsec": lost} for k, lost in found.items()]
    return sorted(rows, key=lambda row: row["order"])


def _part(chain: Chain, pattern: TurnPattern, floating: bool) -> TablePart:
    # With and without contracted products: the maximum holds for both.
    variants = (False, True)[: 1 + floating]
    turns, closes = chain.turns
    return TablePart.at_readings(
        pattern,
        *(partial(chain.correction, contracted=c) for c in variants),
        zero=0.0,
        resolution=2.0 * len(chain.tables) / TURN,
        turns=turns,
        continuous=not closes,
    )


def _portable_model(text: str, path: str, target: Target) -> HarmonicModel:
    """Model of the tables of an exported C header or Rust module."""
    flowing = re.sub(r"\n(?: \*|//!) ?", " ", text)
    found = list(_TABLE.finditer(flowing))
    zero = _ZERO.search(flowing)
    if not found or zero is None:
        raise FileError(path, "no export of trueangle: its comment names no table")
    at_indicated = "all tables at the same" in flowing
    whole = int(zero[1])
    if abs(whole) >= 1 << 63:
        raise FileError(path, f"its zero is beyond 64 bits: {zero[1][:30]}")
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
            raise FileError(
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
    """Entries, shift and cycles that the comment states for a table."""
    try:
        entries, shift, cycles = int(match["entries"]), int(match["shift"]), float(match["cycles"])
    except ValueError:
        cycles = math.nan
    if not 0.0 < cycles < 1 << 31 or shift > _LARGEST_SHIFT:
        raise FileError(
            path,
            f"the table of shaft {match['shaft']} states a shift of "
            f"{match['shift'][:20]} (0 to {_LARGEST_SHIFT}) and {match['cycles'][:30]} cycles",
        )
    return entries, shift, cycles


def _function(table: Table, move: float) -> Function:
    def function(x: Array) -> Array:
        angles = np.floor(((x - move) % 1.0) * TURN).astype(np.uint64).astype(np.uint32)
        return table.correction(angles) / TURN

    return function
