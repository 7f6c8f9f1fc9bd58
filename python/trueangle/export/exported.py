"""What an export has made: figures, what they leave out, and the text of the file."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import laid_out
from ..support.plainresult import PlainResult
from .proof import rounded_up

#: Size below which what the number format leaves is not written out.
_NOTABLE_ARCSEC = 0.001

#: A size in a sentence.
_ARCSEC = re.compile(r"(\d[\d.]*(?:e[-+]\d+)?) arcsec\b")

#: Digits of a bound in a file, and in a summary.
HEADER_DIGITS = 6
_SUMMARY_DIGITS = 4


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
        With all that is left out, and with the rounding of what is computed at run time.
    floor_arcsec : float
        rms that the number format alone leaves.
    lost : list of dict
        ``{"order", "arcsec"}``: amplitude by which each order of the model differs.
    proven : bool
        Every input was evaluated, or a bound covers what lies between those that were.
    proof : str
        How.
    zero_deg : float
        Constant by which the corrected angle is larger: left to the target's own zero.
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
        first = where + self.difference(unit, _SUMMARY_DIGITS)
        if not self.left_out:
            first = laid_out([first])
        # Else it stays one line, however wide: who reads one reads all that is left out.
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
        if worst is not None:
            lines.append(
                f"of the orders, {worst['order']:g} loses most: {unit.text(worst['arcsec'])}"
            )
        further = laid_out([*lines, *(f"note: {_in_unit(note, unit)}" for note in self.notes)])
        return f"{first}\n{further}" if further else first

    def difference(self, unit: ErrorUnit, digits: int) -> str:
        """One line: how far the corrected angle is from the model's, with all that is left out."""

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
            *([f"left out: {terms(self.left_out)}"] if self.left_out else []),
            *([f"at run time: {terms(self.at_run_time)}"] if self.at_run_time else []),
            f"the rest by at most {table}",
        ]
        return "; ".join(parts)


def _in_unit(text: str, unit: ErrorUnit) -> str:
    """A sentence whose sizes in arcsec are those of the unit that all else is shown in."""
    if unit.name == "arcsec":
        return text
    return _ARCSEC.sub(lambda found: unit.text(float(found[1])), text)
