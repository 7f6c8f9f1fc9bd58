"""The joints of a robot ranked: in one table, the worst first, and on one page, a section each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from ..diagnosis.confirmation import CONFIRMED
from ..runs.checks.result import Check
from ..runs.run import CalibrationRun
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, error_unit
from ..support.layout import counted, laid_out
from . import wording
from .composition import Report
from .measured import measured_content
from .page import Page, filled_template, rendered_report

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.result import FitResult

#: What a report's verdict is called in the table.
_VERDICTS = {
    "gain": "calibrated",
    "no-gain": "no gain",
    "unchecked": "calibrated, not held out",
    "no-model": "no model",
}


class JointRank(NamedTuple):
    """One joint among the others.

    Attributes
    ----------
    joint : str
    peak_to_peak_before_arcsec : float or None
        Of the error as measured, every run from its own zero.
    rms_left_arcsec : float or None
        After correction by the model, or by all that was found.
    verdict : str
    first_cause : str or None
    """

    joint: str
    peak_to_peak_before_arcsec: float | None
    rms_left_arcsec: float | None
    verdict: str
    first_cause: str | None


def checked_rank(joint: str, found: Check, runs: Sequence[CalibrationRun] | None) -> JointRank:
    """The rank of a joint whose data were checked; ``runs`` where they can be read as such."""
    faults = [fault.fault for fault in found.data_faults]
    verdict = "usable" if found.usable else "not usable"
    return JointRank(joint, _before(runs), None, verdict, faults[0] if faults else None)


def fitted_rank(
    joint: str, runs: Sequence[CalibrationRun], found: FitResult | Exception
) -> JointRank:
    """The rank of a joint that a model was fitted to, or to which none could be."""
    if isinstance(found, Exception):
        return JointRank(joint, _before(runs), None, f"no model: {found}", None)
    model = found.model
    each = zip(found.amplitudes.tolist(), _names(found), strict=True)
    _, largest = max(each, default=(0.0, None))
    left = arcsec(found.residual_std, model.period)
    return JointRank(joint, _before(runs), left, "calibrated", largest)


def diagnosed_rank(joint: str, found: Diagnosis) -> JointRank:
    """The rank of a joint that was diagnosed."""
    causes = [finding.cause for finding in found.findings if finding.confirmed]
    open_ = found.unexplained is not None and found.unexplained.found
    unnamed = found.findings or found.in_question or found.factors
    verdict = "differs, not named" if unnamed else "simulation is enough"
    verdict = "unexplained" if open_ else "explained" if causes else verdict
    left = found.gain.get("rms_after_arcsec") if found.gain else None
    size = found.discrepancy.peak_to_peak
    return JointRank(joint, size, left, verdict, causes[0] if causes else None)


def ranked(rows: Iterable[JointRank]) -> list[JointRank]:
    """The worst first: what cannot be used or corrected, then the largest error."""
    return sorted(
        rows,
        key=lambda row: (
            not row.verdict.startswith("no"),
            -(row.peak_to_peak_before_arcsec or 0.0),
        ),
    )


def ranking_text(title: str, rows: Sequence[JointRank], errors_in: ErrorsIn = "auto") -> str:
    """The table as text."""
    sizes = [0.5 * (row.peak_to_peak_before_arcsec or 0.0) for row in rows]
    unit = error_unit(errors_in, max(sizes, default=0.0))

    def shown(value: float | None) -> str:
        return "-" if value is None else unit.number(value)

    cells = [
        ["joint", "peak-to-peak", "rms left", "verdict", "first cause"],
        ["", f"before, {unit.name}", unit.name, "", ""],
    ]
    cells += [
        [
            row.joint,
            shown(row.peak_to_peak_before_arcsec),
            shown(row.rms_left_arcsec),
            row.verdict.partition(":")[0],  # why there is no model is reported next to the table
            row.first_cause or "-",
        ]
        for row in rows
    ]
    widths = [max(len(line[i]) for line in cells) for i in range(len(cells[0]))]
    lines = [
        "  ".join(
            cell.rjust(width) if i in (1, 2) else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
    return laid_out([title, *lines])


def plain_ranking(rows: Sequence[JointRank]) -> list[dict[str, Any]]:
    """The table as plain values."""
    return [row._asdict() for row in rows]


def _before(runs: Sequence[CalibrationRun] | None) -> float | None:
    return None if not runs else float(measured_content(runs)["error"]["peak_to_peak_arcsec"])


def _names(found: FitResult) -> list[str]:
    return [f"order {k} of {s.name}" for s in found.model.shafts for k in s.orders]


@dataclass(frozen=True, eq=False)
class RobotReport(Page):
    """A report on all joints of a robot.

    Attributes
    ----------
    title : str
    reports : mapping of str to Report
        By joint.
    errors_in : str or float
        Unit of the errors of the table in front.
    """

    title: str
    reports: Mapping[str, Report]
    errors_in: ErrorsIn = "auto"

    @cached_property
    def ranking(self) -> list[JointRank]:
        """The joints, the worst first."""
        return ranked(_rank(joint, made.content) for joint, made in self.reports.items())

    def to_dict(self) -> dict[str, Any]:
        """Every number of the page: the contents by joint and the ranking."""
        return {
            "joints": {joint: made.content for joint, made in self.reports.items()},
            "ranking": plain_ranking(self.ranking),
        }

    def _written(self) -> str:
        largest = max(0.5 * (row.peak_to_peak_before_arcsec or 0.0) for row in self.ranking)
        return filled_template(
            "robot.html.j2",
            title=self.title,
            ranking=self.ranking,
            pages={
                row.joint: rendered_report(made.content, made.figures)
                for row in self.ranking
                for made in [self.reports[row.joint]]
            },
            unit=error_unit(self.errors_in, largest),
        )

    def _brief(self) -> str:
        return f"{counted(len(self.reports), 'joint')}, the worst {self.ranking[0].joint}"

    def summary(self) -> str:
        """The table in front."""
        return ranking_text(self.title, self.ranking, self.errors_in)


def _rank(joint: str, content: dict[str, Any]) -> JointRank:
    """The rank of a joint by the content of its report."""
    left = None
    if content["gain"] is not None:
        left = content["gain"]["after"]["rms_arcsec"]
    elif content["model"] is not None:
        left = content["model"]["residual_std_arcsec"]
    verdict = wording.gain_verdict(content)
    findings = (content["diagnosis"] or {}).get("findings", ())
    causes = (finding["cause"] for finding in findings if finding["status"] == CONFIRMED)
    return JointRank(
        joint,
        content["measured"]["error"]["peak_to_peak_arcsec"],
        left,
        _VERDICTS.get(verdict, verdict),
        next(causes, None),
    )
