"""What a table leaves out of its model, and how large that is at the joint."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model.model import HarmonicModel
from ..model.term import Term
from ..support.angles import ARCSEC_PER_TURN
from .pattern import TurnPattern, of_direction

__all__ = ["left_out"]

Array = NDArray[np.float64]

#: Readings to a turn, and turns before those that count: what winds up with travel has done so.
_GRID = 4096
_AHEAD = 2

#: What a signal goes over where the model does not say: one unit, about the temperature that a
#: term counts from. Velocities are in degrees per second.
_UNITS = {"velocity": "deg/s", "temperature": "degC", "torque": "Nm", "current": "A"}


def left_out(pattern: TurnPattern, takes_direction: bool) -> list[dict[str, Any]]:
    """``{"term", "size_arcsec", "over"}`` of each term that a target cannot hold.

    The size is the largest change of the corrected angle where the term is not corrected, over
    the signals that it was found over; ``over`` names them, and is None for a term without.
    """
    terms = [t for t in pattern.left_out if not (takes_direction and of_direction(t))]
    return [_row(pattern, term) for term in terms]


def _row(pattern: TurnPattern, term: Term) -> dict[str, Any]:
    ranges = _ranges(pattern, term)
    words = [f"{_range(*ranges[name])} {unit}" for name, unit in _UNITS.items() if name in ranges]
    return {
        "term": term.kind,
        "size_arcsec": _size(pattern, term, ranges) * ARCSEC_PER_TURN,
        "over": ", ".join(words) or None,
    }


def _range(low: float, high: float) -> str:
    return f"+-{high:.4g}" if low == -high else f"{low:.4g} to {high:.4g}"


def _ranges(pattern: TurnPattern, term: Term) -> dict[str, tuple[float, float]]:
    """Of the signals that a term needs: as recorded, or one unit each way; velocities in deg/s."""
    fit = pattern.source.fit
    known = {name: (low, high) for name, low, high in fit.signals} if fit else {}
    needed = set(term.needs) | ({"velocity"} & {getattr(term, "follows", "")})
    found = {}
    for name in _UNITS:
        if name not in needed:
            continue
        turn = 360.0 / pattern.period if name == "velocity" else 1.0
        middle = float(getattr(term, "reference_C", 0.0)) if name == "temperature" else 0.0
        low, high = known.get(name, ((middle - 1.0) / turn, (middle + 1.0) / turn))
        found[name] = (low * turn, high * turn)
    return found


def _size(pattern: TurnPattern, term: Term, ranges: Mapping[str, tuple[float, float]]) -> float:
    """Turns by which the corrected angle changes at most."""
    plain = pattern.model
    model: HarmonicModel = plain.replace(terms=(*plain.terms, term))
    cells = np.arange((_AHEAD + 1) * _GRID) * (pattern.period / _GRID)
    ends = [
        sorted({low, high, *([0.0] if low < 0.0 < high else [])}) for low, high in ranges.values()
    ]
    largest = 0.0
    for direction, values in product((1.0, -1.0), product(*ends)):
        signals = dict(zip(ranges, values, strict=True))
        if "velocity" in signals:
            signals["velocity"] *= pattern.period / 360.0
        reading = direction * cells
        given = np.asarray(model.correct(reading, direction=direction, **signals))  # type: ignore[call-overload]
        change = (given - np.asarray(plain.correct(reading)))[_AHEAD * _GRID :]
        largest = max(largest, float(np.max(np.abs(change))))
    return largest / pattern.period
