"""The report on a robot: its joints in one table in front, and a section for each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..support.display_units import ErrorsIn, error_unit
from ..support.plainresult import counted
from . import wording
from .composition import Report
from .page import Page, bokeh_library, filled_template, rendered_report
from .ranking import JointRank, plain_ranking, ranked, ranking_text

__all__ = ["RobotReport"]

#: What a report's verdict is called in the table.
_VERDICTS = {
    "gain": "calibrated",
    "no-gain": "no gain",
    "unchecked": "calibrated, not held out",
    "no-model": "no model",
}


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

    @cached_property
    def html(self) -> str:
        """One file that needs no network.

        Raises
        ------
        MissingExtraError
            jinja2 or bokeh is not installed.
        """
        largest = max(0.5 * (row.peak_to_peak_before_arcsec or 0.0) for row in self.ranking)
        return filled_template(
            "robot.html.j2",
            title=self.title,
            ranking=self.ranking,
            pages={
                row.joint: rendered_report(self.reports[row.joint], True) for row in self.ranking
            },
            library=bokeh_library(),
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
    findings = (content["diagnosis"] or {}).get("findings") or [{}]
    return JointRank(
        joint,
        content["measured"]["error"]["peak_to_peak_arcsec"],
        left,
        _VERDICTS.get(verdict, verdict),
        findings[0].get("cause"),
    )
