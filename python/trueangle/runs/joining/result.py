"""Joined runs: what a joining made, its gaps, and how far it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from typing import Any, NamedTuple

from ...support.display_units import ErrorsIn, ErrorUnit, error_unit
from ...support.layout import counted, laid_out
from ...support.plainresult import PlainResult, plain_fields
from ..run import CalibrationRun


class Gap(NamedTuple):
    """A pause of the reference, on its own clock, and the readings omitted over it."""

    start_s: float
    end_s: float
    left_out: int


@dataclass(frozen=True)
class Joined(PlainResult):
    """Two logs as calibration runs.

    Attributes
    ----------
    runs : list of CalibrationRun
        In degrees, a reading for every indicated one whose reference is known; time is that
        of the indicated log.
    offset_s, rate_ppm : float
        ``t_reference = t_indicated + offset + rate * (t_indicated - start)``.
    offset_std_s, rate_std_ppm : float or None
        Their standard errors; None where declared, or where the motion does not determine them.
    std_arcsec : float
        Standard deviation that the joining adds to an error: of interpolation and clocks.
    gaps : tuple of Gap
    left_out : int
        Indicated readings without a reference: over gaps, before its start, after its end.
    on_change : tuple of str
        Which of the logs, ``"indicated"`` and ``"reference"``, hold changes only.
    notes : tuple of str
    """

    runs: list[CalibrationRun]
    offset_s: float
    rate_ppm: float
    offset_std_s: float | None
    rate_std_ppm: float | None
    std_arcsec: float
    gaps: tuple[Gap, ...]
    left_out: int
    on_change: tuple[str, ...]
    notes: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        clocks = "offset_s offset_std_s rate_ppm rate_std_ppm std_arcsec"
        return {
            "readings": sum(len(run) for run in self.runs),
            "runs": len(self.runs),
            **plain_fields(self, f"left_out {clocks} gaps on_change notes"),
        }

    def _brief(self) -> str:
        readings = sum(len(run) for run in self.runs)
        return (
            f"{readings} readings in {counted(self.runs, 'run')}, offset {self.offset_s:.6g} s, "
            f"rate {self.rate_ppm:.4g} ppm"
        )

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The result as text.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """

        def told(value: float, std: float | None, unit: str) -> str:
            return ErrorUnit(unit, 1.0).text(value, std)

        unit = error_unit(errors_in, self.std_arcsec)
        found = self.to_dict()
        every = f" of {self.left_out + found['readings']}" if self.left_out else ""
        lines = [f"{found['readings']}{every} readings joined in {counted(self.runs, 'run')}"]
        if self.left_out:
            lines[0] += (
                ": at the time of the others the reference pauses, has not begun or has ended; "
                "give `max_gap_s=` or `offset_s=` where more is known"
            )
        lines += [
            f"  offset    {told(self.offset_s, self.offset_std_s, 's')}",
            f"  rate      {told(self.rate_ppm, self.rate_std_ppm, 'ppm')}",
            f"  joining   adds {unit.text(self.std_arcsec)} standard deviation",
            f"  gaps      {len(self.gaps)}",
        ]
        if self.on_change:
            lines.append(f"  on change {', '.join(self.on_change)}: held over its pauses")
        lines += [f"  [{i}] {note}" for i, note in enumerate(self.notes, 1)]
        return laid_out(lines)

    def save(self, path: str | PathLike[str]) -> int:
        """Write the runs as CSV, complete or not at all; the number of readings."""
        from ..writing import write_runs

        return write_runs(self.runs, str(path))
