"""The unit of a page's errors, and how they are read off its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..runs.run import CalibrationRun
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit, sine_of_rms


@dataclass(frozen=True)
class ErrorScale:
    """One unit for every error of a page; results are in arcsec, what is drawn in it.

    Attributes
    ----------
    unit : ErrorUnit
    turn : float or None
        Counts of a turn where the unit is a count.
    """

    unit: ErrorUnit
    turn: float | None = None

    @property
    def name(self) -> str:
        """The unit's name."""
        return self.unit.name

    @property
    def factor(self) -> float:
        """How many of the unit one second of arc is."""
        return self.unit.per_arcsec

    @property
    def defined(self) -> str:
        """What the unit is, for those who do not know it."""
        return {
            "arcsec": "in seconds of arc (1 arcsec = 1/3600 degree)",
            "deg": "in degrees",
            "mrad": "in thousandths of a radian (1 mrad = 0.0573 degree)",
            "count": f"in counts of {self.turn:g} to a turn" if self.turn else "in counts",
        }[self.name]

    def to_dict(self) -> dict[str, Any]:
        """For the content: the unit of the page, beside numbers that stay in arcsec."""
        return {"unit": self.name, "per_arcsec": self.factor, "defined": self.defined}


def error_scale(asked: ErrorsIn, rms: float, runs: Sequence[CalibrationRun]) -> ErrorScale:
    """The scale asked for; counts are those of the runs where no number says otherwise.

    Raises
    ------
    ArgumentError
        Another word; counts where nothing says how many a turn has.
    """
    period = runs[0].period
    unit = error_unit(asked, sine_of_rms(rms), period)
    turn = None if unit.name != "count" else period if isinstance(asked, str) else float(asked)
    return ErrorScale(unit, turn)
