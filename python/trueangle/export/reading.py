"""Tables that are there become models, which say what they correct."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from ..joint.shafts import Shaft
from ..model import HarmonicModel
from ..records import FitRecord
from .table import TURN, Table

__all__ = ["ReadTable", "failed", "function_model", "portable_model", "sampled_model"]

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

#: Points per entry of the grid whose spectrum is taken: images of a line's corners alias
#: below 1e-6 of it.
_FINE = 64
_LARGEST_GRID = 1 << 18

#: Passes of theta = r - T(r): a slope of 1/2 is then within 1e-16 of a turn.
_PASSES = 60

#: Turns within which the passes must end: coarser than any rounding of a table's arithmetic.
_SETTLED = 1e-6

#: Orders smaller than so many standard deviations of the table's rounding are not told from it.
_SIGNIFICANT = 3.0


#: Largest number of orders of a model made of a table, the strongest ones: its covariance is
#: a matrix.
_MOST_ORDERS = 256


class ReadTable(NamedTuple):
    """One shaft's correction as its table makes it, in turns of the output.

    Attributes
    ----------
    shaft : str
    cycles : float
    function : callable
        At angles in turns of the shaft: the correction of the reading, or with ``forward``
        the error at the true angle.
    entries : int
    step : float
        Distance of two numbers of the table, in turns of the output.
    forward : bool
    """

    shaft: str
    cycles: float
    function: Function
    entries: int
    step: float
    forward: bool = False


def failed(path: str, problem: str, line: int | None = None) -> FileError:
    """The error of a file that is not what its target reads."""
    return FileError(path, problem, line=line)


def sampled_model(
    values: Array, path: str, text: str, *, step: float, name: str, zero: float = 0.0
) -> HarmonicModel:
    """Model of equidistant corrections (turns) between which a target interpolates."""
    closed = np.append(values, values[0])
    places = np.arange(len(closed)) / len(values)

    def function(x: Array) -> Array:
        return np.asarray(np.interp(x % 1.0, places, closed))

    return function_model(
        [ReadTable("output", 1.0, function, len(values), step)], path, name, zero=zero
    )


def function_model(
    tables: Iterable[ReadTable],
    path: str,
    name: str,
    *,
    zero: float = 0.0,
    at_indicated: bool = False,
    terms: Iterable[Any] = (),
    note: str = "",
) -> HarmonicModel:
    r"""Model, in degrees, whose correction is that of the tables.

    The correction T of a reading becomes the error at the true angle by solving
    :math:`r = \theta + T(r)`, and that becomes harmonics up to the table's Nyquist order.
    The standard deviation of their coefficients is that of numbers rounded to the table's
    step; orders that do not exceed three of it are left out.

    Raises
    ------
    FileError
        A table whose correction could not be inverted.
    """
    shafts, variances, residual, samples = [], [0.0], 0.0, 0
    constant = zero
    for table in tables:
        cosine, sine, mean = _harmonics(table, path, at_indicated)
        constant += mean
        sigma = table.step / math.sqrt(12.0)
        std = sigma * math.sqrt(2.0 / table.entries)
        size = np.hypot(cosine, sine)
        keep = size > max(_SIGNIFICANT * std, np.sort(size)[-_MOST_ORDERS:][0])
        orders = np.flatnonzero(keep) + 1
        shafts.append(
            Shaft(
                table.shaft,
                table.cycles,
                tuple(int(k) for k in orders),
                tuple(float(a) for a in cosine[keep] * 360.0),
                tuple(float(b) for b in sine[keep] * 360.0),
            )
        )
        variances += [std**2] * (2 * len(orders))
        variances[0] += sigma**2 / table.entries
        residual = math.hypot(residual, sigma)
        samples += table.entries
    from ..files import sha256_of
    from ..records import Provenance
    from ..runs import Source

    record = FitRecord(
        samples=samples,
        runs=1,
        span=(0.0, 360.0),
        residual=residual * 360.0,
        method="table",
        note=note or f"read from a table of {name}; the uncertainty is that of its numbers",
    )
    return HarmonicModel(
        tuple(shafts),
        constant=constant * 360.0,
        period=360.0,
        argument="indicated" if at_indicated else "reference",
        covariance=np.diag(variances) * 360.0**2,
        fit=record,
        provenance=Provenance((Source(path, sha256_of(path)),)),
        terms=tuple(terms),
    )


def _harmonics(table: ReadTable, path: str, at_indicated: bool) -> tuple[Array, Array, float]:
    """Cosine and sine of orders from 1, and the mean, in turns of the output."""
    points = min(1 << math.ceil(math.log2(_FINE * table.entries)), _LARGEST_GRID)
    x = np.arange(points) / points
    if table.forward or at_indicated:
        error = table.function(x)
    else:
        reading = x.copy()
        for _ in range(_PASSES):
            reading = x + table.cycles * table.function(reading)
        if np.max(np.abs(x + table.cycles * table.function(reading) - reading)) > _SETTLED:
            raise failed(
                path, "the table's slope reaches 1: one reading would stand for several angles"
            )
        error = (reading - x) / table.cycles
    spectrum = np.fft.rfft(error) / points
    top = (table.entries - 1) // 2
    return 2.0 * spectrum.real[1 : top + 1], -2.0 * spectrum.imag[1 : top + 1], spectrum[0].real


_TABLE = re.compile(
    r"Table (?P<shaft>\w+): (?P<entries>\d+) entries, \d+ bytes, (?P<method>linear|cubic), "
    r"(?P<number>q15|q31|f32), shift (?P<shift>\d+), (?P<cycles>[-+.e\d]+) cycles"
)
_ZERO = re.compile(r"Zero: (\d+) ")
_TYPES = {"q15": np.int16, "q31": np.int32, "f32": np.float32}


def portable_model(text: str, path: str) -> HarmonicModel:
    """Model of the tables of an exported C header or Rust module."""
    flowing = re.sub(r"\n(?: \*|//!) ?", " ", text)
    found = list(_TABLE.finditer(flowing))
    zero = _ZERO.search(flowing)
    if not found or zero is None:
        raise failed(path, "no export of trueangle: its comment names no table")
    at_indicated = "all tables at the same" in flowing
    tables = []
    for match in found:
        shaft, number = match["shaft"], match["number"]
        entries, cycles = int(match["entries"]), float(match["cycles"])
        body = re.search(
            rf"(?:\b\w*{shaft}_knots\[\d+\][^=]*|const {shaft.upper()}: [^=]*)= [{{\[](.*?)[}}\]];",
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
            raise failed(
                path, f"the table of shaft {shaft} does not hold {wide * (entries + 1)} numbers"
            ) from None
        table = Table(
            shaft,
            cycles,
            match["method"],
            number,
            entries.bit_length() - 1,
            int(match["shift"]),
            knots.reshape(-1, 2) if wide == 2 else knots,
        )
        # Tables are looked up at the zeroed reading; an indicated argument is the reading.
        move = _signed(int(zero[1])) / TURN * cycles if at_indicated else 0.0
        tables.append(ReadTable(shaft, cycles, _function(table, move), entries, table.step))
    return function_model(
        tables,
        path,
        "trueangle",
        zero=_signed(int(zero[1])) / TURN,
        at_indicated=at_indicated,
    )


def _function(table: Table, move: float) -> Function:
    def function(x: Array) -> Array:
        angles = np.floor(((x - move) % 1.0) * TURN).astype(np.uint64).astype(np.uint32)
        return table.correction(angles) / TURN

    return function


def _signed(zero: int) -> int:
    return zero - (1 << 32) if zero >= 1 << 31 else zero
