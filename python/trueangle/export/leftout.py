"""What a table leaves out of its model: terms, their sizes and ranges, bounds at run time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from ..errors import ArgumentError, OutsideSpanWarning
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.terms import LocalDefect
from ..support.angles import ARCSEC_PER_TURN
from ..support.signals import coupled_joint
from .pattern import TurnPattern
from .runtimeterms import RunTimeTerms

#: Readings to a turn, and turns before those that count: what winds up with travel has done so.
_GRID = 4096
_AHEAD = 2

#: What a signal goes over where the model does not say: one unit, about the temperature that a
#: term counts from. Velocities are in degrees per second.
_UNITS = {"velocity": "deg/s", "temperature": "degC", "torque": "Nm", "current": "A"}


def term_sizes(pattern: TurnPattern, terms: Sequence[Term]) -> list[dict[str, Any]]:
    """``{"term", "size_arcsec", "over"}`` of terms: those that a target cannot hold, or computes.

    The size is the largest change of the corrected angle where the term is not corrected, over
    the signals that it was found over; ``over`` names them, and is None for a term without.
    """
    return [_row(pattern, term) for term in terms]


def run_time_bound(
    pattern: TurnPattern, terms: RunTimeTerms, rows: Sequence[Mapping[str, Any]]
) -> tuple[float, float]:
    """How much more a table's difference is where terms are searched around it, and their rounding.

    With slopes s of the pattern and q of the terms, and the rounding e of the terms, an angle is
    off by ``(table + e / (1 - s)) / (1 - q / (1 - s))`` at most; the rounding is in arcsec.

    Raises
    ------
    ArgumentError
        The terms are too steep over the signals that the model records.
    """
    ranges: dict[str, tuple[float, float]] = {}
    for term in pattern.source.terms:
        for name, (low, high) in ranges_of(pattern, term).items():
            scale = 1.0 / 360.0 if name == "velocity" else 1.0
            ranges[name] = (low * scale, high * scale)
    slope = 0.0
    if pattern.model.argument == "reference":
        slope = 2.0 * math.pi * sum(m * c for m, c in pattern.lines.items())
        slope += sum(
            abs(bump.height / bump.width * bump.cycles_per_turn) * math.exp(-0.5)
            for bump in pattern.model.terms
            if isinstance(bump, LocalDefect)
        )
    own = terms.steepness(ranges)
    if slope + own >= 1.0:
        raise ArgumentError(
            f"the terms {', '.join(terms.kinds)} are as steep as {own:.3g} over the signals that "
            f"the model records, beside {slope:.3g} of the pattern: below 1 in all, an angle is "
            "found at every reading"
        )
    largest = sum(row["size_arcsec"] for row in rows) / ARCSEC_PER_TURN
    steep = (1.0 - slope) / (1.0 - slope - own)
    return steep, terms.rounding(largest) / (1.0 - slope - own) * ARCSEC_PER_TURN


def _row(pattern: TurnPattern, term: Term) -> dict[str, Any]:
    ranges = ranges_of(pattern, term)
    words = [
        f"{_range(*values)} " + (_UNITS.get(name) or f"deg of joint {coupled_joint(name)}")
        for name, values in ranges.items()
    ]
    return {
        "term": term.kind,
        "size_arcsec": _size(pattern, term, ranges) * ARCSEC_PER_TURN,
        "over": ", ".join(words) or None,
    }


def _range(low: float, high: float) -> str:
    return f"+-{high:.4g}" if low == -high else f"{low:.4g} to {high:.4g}"


def ranges_of(pattern: TurnPattern, term: Term) -> dict[str, tuple[float, float]]:
    """Of the signals that a term needs: as recorded, or one unit each way; velocities in deg/s."""
    fit = pattern.source.fit
    known = {name: (low, high) for name, low, high in fit.signals} if fit else {}
    needed = set(term.needs) | ({"velocity"} & {getattr(term, "follows", "")})
    found = {}
    for name in (*_UNITS, *sorted(filter(coupled_joint, needed))):
        if name not in needed:
            continue
        is_angle = name == "velocity" or coupled_joint(name)
        turn = 360.0 / pattern.period if is_angle else 1.0
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
        for name in signals:
            if name == "velocity" or coupled_joint(name):
                signals[name] *= pattern.period / 360.0
        reading = direction * cells
        with warnings.catch_warnings():  # a size is looked for beyond the travel as well
            warnings.simplefilter("ignore", OutsideSpanWarning)
            given = np.asarray(model.correct(reading, direction=direction, **signals))  # type: ignore[call-overload]
        change = (given - np.asarray(plain.correct(reading)))[_AHEAD * _GRID :]
        largest = max(largest, float(np.max(np.abs(change))))
    return largest / pattern.period
