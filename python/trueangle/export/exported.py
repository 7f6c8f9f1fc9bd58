"""What an export has made: figures, what it omits and by how much, the text of the file."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from ..errors import ArgumentError, OutsideSpanWarning
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.terms import LocalDefect
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import laid_out
from ..support.plainresult import PlainResult
from ..support.signals import coupled_joint
from .pattern import TurnPattern
from .proof import rounded_up
from .runtimeterms import RunTimeTerms

#: Size below which what the number format leaves is not written out.
_NOTABLE_ARCSEC = 0.001

#: A size in a sentence.
_ARCSEC = re.compile(r"(\d[\d.]*(?:e[-+]\d+)?) arcsec\b")

#: Digits of a bound in a file, and in a summary.
HEADER_DIGITS = 6

#: Readings to a turn, and turns before those that count: hysteresis has settled by then.
_GRID = 4096
_AHEAD = 2

#: Units of signals whose range the model does not state: it is then one unit, about the reference
#: temperature of a term. Velocities are in degrees per second.
_UNITS = {"velocity": "deg/s", "temperature": "degC", "torque": "Nm", "current": "A"}


@dataclass(frozen=True)
class Exported(PlainResult):
    """A table made of a model, and how far it is from it.

    Attributes
    ----------
    target, sign, argument : str
        ``sign`` is what the target does with a value, ``argument`` the angle at which it
        looks up.
    entries, bytes : int
        Numbers of the table and the memory they take on the target.
    max_difference_arcsec, rms_difference_arcsec : float
        Of the corrected angle at the joint from what the harmonics of the model give, over every
        input, in the target's own arithmetic; the maximum rounded up.
    max_difference_total_arcsec : float
        With all that is omitted, and with the rounding of what is computed at run time.
    floor_arcsec : float
        rms that the number format alone leaves.
    lost : list of dict
        ``{"order", "arcsec"}``: amplitude of the difference of each order of the model.
    proven : bool
        Every input was evaluated, or a bound covers what lies between those that were.
    proof : str
        How.
    zero_deg : float
        Constant added to the corrected angle: left to the target's own zero.
    left_out : list of dict
        ``{"term", "size_arcsec", "over"}``: terms of the model that the table cannot hold, and
        the largest change of the corrected angle that is left with each, over the range of the
        signals that the model records (one unit each way where it records none).
    at_run_time : list of dict
        Likewise of the terms that are computed at every reading.
    notes : list of str
        What to know before it is used.
    text : str
        The file's content.
    output : str or None
        Where it was written.
    """

    target: str
    sign: str
    argument: str
    entries: int
    bytes: int
    max_difference_arcsec: float
    max_difference_total_arcsec: float
    rms_difference_arcsec: float
    floor_arcsec: float
    lost: list[dict[str, float]]
    proven: bool
    proof: str
    zero_deg: float
    left_out: list[dict[str, Any]]
    at_run_time: list[dict[str, Any]]
    notes: list[str]
    tables: list[dict[str, Any]]
    sha256: str
    text: str = field(repr=False)
    output: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Everything but the text."""
        return {key: value for key, value in vars(self).items() if key != "text"}

    def _brief(self) -> str:
        most = self.max_difference_total_arcsec
        return f"{self.target}, {self.entries} entries, differs by {most:.3g} arcsec at most"

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """What a person wants to know, in some lines.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """
        unit = error_unit(errors_in, self.max_difference_total_arcsec)
        where = f"{self.output}: " if self.output else ""
        first = where + self.difference(unit, 4)
        if not self.left_out:
            first = laid_out([first])
        # Else it stays one line, however wide: whoever reads it also reads what is omitted.
        lines: list[str] = []
        if self.entries:
            lines.append(
                f"{self.entries} entries for {self.target}, {self.bytes} bytes; {self.sign}, "
                f"looked up at the {self.argument} angle; the number format alone leaves "
                + (
                    f"{unit.text(self.floor_arcsec)} rms"
                    if self.floor_arcsec >= _NOTABLE_ARCSEC
                    else _in_unit(f"less than {_NOTABLE_ARCSEC:g} arcsec rms", unit)
                )
            )
        worst = max(self.lost, key=lambda row: row["arcsec"], default=None)
        if worst is not None and worst["arcsec"] >= _NOTABLE_ARCSEC:
            lines.append(f"largest loss: order {worst['order']:g}, {unit.text(worst['arcsec'])}")
        further = laid_out([*lines, *(f"note: {_in_unit(note, unit)}" for note in self.notes)])
        return f"{first}\n{further}" if further else first

    def difference(self, unit: ErrorUnit, digits: int) -> str:
        """One line: how far the corrected angle is from the model's, with all that is omitted."""

        def shown(arcsec: float) -> str:
            return f"{rounded_up(arcsec * unit.per_arcsec, digits):.{digits}g}"

        table = (
            f"{shown(self.max_difference_arcsec)} {unit.name}, "
            f"{unit.number(self.rms_difference_arcsec)} rms ({_in_unit(self.proof, unit)})"
        )
        if not (self.left_out or self.at_run_time):
            return f"differs from the model by at most {table}"

        def terms(rows: list[dict[str, Any]]) -> str:
            return ", ".join(
                f"{row['term']} {shown(row['size_arcsec'])} {unit.name}"
                + (f" over {row['over']}" if row["over"] else "")
                for row in rows
            )

        parts = [
            f"differs from the model by at most {shown(self.max_difference_total_arcsec)} "
            f"{unit.name}",
            *([f"omitted: {terms(self.left_out)}"] if self.left_out else []),
            *([f"at run time: {terms(self.at_run_time)}"] if self.at_run_time else []),
            f"the table itself by at most {table}",
        ]
        return "; ".join(parts)


def _in_unit(text: str, unit: ErrorUnit) -> str:
    """A sentence whose sizes in arcsec are those of the unit that all else is shown in."""
    if unit.name == "arcsec":
        return text
    return _ARCSEC.sub(lambda found: unit.text(float(found[1])), text)


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
            f"the model records, the pattern adds {slope:.3g}: the sum must "
            "be below 1"
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
    """Largest change of the corrected angle, turns."""
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
