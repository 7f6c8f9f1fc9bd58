"""Models made from existing tables, to show what these correct."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import FileError, NotInvertibleError
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.records import FitRecord, Provenance, TableRecord
from ..support.arrays import Array
from ..support.files import InputFile, sha256_of
from .pattern import inverse_rising
from .proof import Correction
from .table import TURN

if TYPE_CHECKING:
    from .target import Target

Function = Callable[[Array], Array]

#: Points per entry of the grid whose spectrum is taken: images of a line's corners alias
#: below 1e-6 of it.
_FINE = 64
_LARGEST_GRID = 1 << 18

#: Readings at which a table's own arithmetic is compared with the model made of it.
_PROBES = 1 << 18


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


def sampled_model(
    values: Array,
    path: str,
    target: Target,
    device: Correction,
    *,
    step: float,
    note: str = "",
) -> HarmonicModel:
    """Model of equidistant corrections (turns) between which a target interpolates."""
    closed = np.append(values, values[0])
    places = np.arange(len(closed)) / len(values)

    def function(x: Array) -> Array:
        return np.asarray(np.interp(x % 1.0, places, closed))

    table = ReadTable("output", 1.0, function, len(values), step)
    return function_model([table], path, target, device, note=note)


def function_model(
    tables: Sequence[ReadTable],
    path: str,
    target: Target,
    device: Correction,
    *,
    zero: float = 0.0,
    at_indicated: bool = False,
    terms: Iterable[Any] = (),
    turns: int = 1,
    note: str = "",
    travel: tuple[float, float] | None = None,
) -> HarmonicModel:
    """Model, in degrees, whose correction is that of the tables.

    The correction T of a reading becomes the error at the true angle by solving
    ``r = θ + T(r)``, and that becomes harmonics up to the table's Nyquist order.
    Where those are too steep to be corrected by, they are of T itself, at the indicated angle.
    The standard deviation of their coefficients is that of numbers rounded to the table's
    step; orders that do not exceed three of it are omitted. What ``device``, the target's own
    arithmetic, adds to the harmonics is in the record of the fit.

    ``travel``, in degrees, is what the table covers where that is less than a turn.

    Raises
    ------
    FileError
        A table that is not monotone: it gives one corrected angle for several readings.
    """
    more = (tuple(terms), turns, note, travel)
    try:
        return _model(tables, path, target, device, zero, at_indicated, *more)
    except NotInvertibleError:
        if len(tables) > 1 or tables[0].forward or at_indicated:
            raise FileError(path, "the tables are too steep to be corrected by") from None
    return _model(tables, path, target, device, zero, True, *more)


def _model(
    tables: Sequence[ReadTable],
    path: str,
    target: Target,
    device: Correction,
    zero: float,
    at_indicated: bool,
    terms: tuple[Any, ...],
    turns: int,
    note: str,
    travel: tuple[float, float] | None,
) -> HarmonicModel:
    shafts, variances, residual, samples = [], [0.0], 0.0, 0
    constant = zero
    for table in tables:
        try:
            cosine, sine, mean = _harmonics(table, at_indicated)
        except NotInvertibleError as error:
            raise FileError(path, f"is not a correction: {error}") from None
        constant += mean
        sigma = table.step / math.sqrt(12.0)
        std = sigma * math.sqrt(2.0 / table.entries)
        size = np.hypot(cosine, sine)
        # Orders below this many standard deviations of the table's rounding are not significant.
        keep = size > max(3.0 * std, np.sort(size)[-_MOST_ORDERS:][0])
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

    model = HarmonicModel(
        tuple(shafts),
        constant=constant * 360.0,
        period=360.0,
        argument="indicated" if at_indicated else "reference",
        covariance=np.diag(variances) * 360.0**2,
        provenance=Provenance((InputFile(path, sha256_of(path)),)),
        terms=terms,
    )
    rms, largest = _arithmetic(model.replace(terms=()), target, device, turns, travel)
    record = FitRecord(
        samples=samples,
        runs=1,
        span=travel or (0.0, 360.0),
        residual=residual * 360.0,
        method="table",
        note=note or f"read from a table of {target.name}; the uncertainty is that of its numbers",
        table=TableRecord(target.name, target.argument, rms * 360.0, largest * 360.0),
    )
    return model.replace(fit=record)


def _arithmetic(
    model: HarmonicModel,
    target: Target,
    device: Correction,
    turns: int,
    travel: tuple[float, float] | None,
) -> tuple[float, float]:
    """Rms and maximum difference of a device from its model, in turns, without their zeros."""
    probes = np.arange(_PROBES, dtype=np.int64)
    places = probes * (turns * 2**32 // _PROBES)
    if travel is not None:
        start, stop = (round(end / 360.0 * TURN) for end in travel)
        places = start + probes * (stop - start) // _PROBES
    x = places / TURN
    if target.argument == "indicated":
        difference = x - np.asarray(model.correct(x * 360.0)) / 360.0 - device(places)
    else:
        difference = np.asarray(model.correct((x + device(places)) * 360.0)) / 360.0 - x
    difference -= np.rint(difference - difference[0])
    difference -= np.mean(difference)
    return float(np.sqrt(np.mean(difference**2))), float(np.max(np.abs(difference)))


def _harmonics(table: ReadTable, at_indicated: bool) -> tuple[Array, Array, float]:
    """Cosine and sine of orders from 1, and the mean, in turns of the output."""
    points = min(1 << math.ceil(math.log2(_FINE * table.entries)), _LARGEST_GRID)
    x = np.arange(points) / points
    if table.forward:
        error = table.function(x)
    else:
        # Knots are ends of brackets.
        brackets = table.entries * max(1, _LARGEST_GRID // table.entries // 4)
        brackets = min(brackets, table.entries * _FINE)
        reading = inverse_rising(lambda r: r - table.cycles * table.function(r), x, brackets)
        error = table.function(x) if at_indicated else (reading - x) / table.cycles
    spectrum = np.fft.rfft(error) / points
    top = (table.entries - 1) // 2
    return 2.0 * spectrum.real[1 : top + 1], -2.0 * spectrum.imag[1 : top + 1], spectrum[0].real
