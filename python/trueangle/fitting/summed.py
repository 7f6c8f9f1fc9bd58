"""Readings too many to keep: sums over all of them, and some as they are."""

from __future__ import annotations

from dataclasses import dataclass

from ..estimation.moments import Moments
from ..model.model import Argument
from ..runs.run import CalibrationRun
from ..support.arrays import Array


@dataclass(frozen=True, eq=False)
class SummedReadings:
    """What one pass over readings keeps of them.

    Attributes
    ----------
    moments : Moments
        Of all readings but the outliers, run by run.
    runs : tuple of CalibrationRun
        Some readings of every run, in their order: blocks at random.
    ends, reach : ndarray
        Angles that hold both ends of the travel of all readings, within a turn and over the turns.
    argument : {"reference", "indicated"}
        The angle of the moments.
    readings, missing : int
        All readings, and rows of the files that an empty cell kept out.
    outliers : tuple of (str, int)
        Label and row of every reading that was rejected.
    """

    moments: Moments
    runs: tuple[CalibrationRun, ...]
    ends: Array
    reach: Array
    argument: Argument
    readings: int
    missing: int
    outliers: tuple[tuple[str, int], ...] = ()

    @property
    def note(self) -> str:
        """What one pass cannot know, in one sentence."""
        kept = sum(map(len, self.runs))
        return (
            "the coefficients, their evidence and the span are of all "
            f"{self.readings} readings, in one pass. Positions, repeats, correlation and "
            f"the ridge are estimated from {kept} of them, in random blocks"
        )
