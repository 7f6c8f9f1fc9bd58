"""Pictures of runs, fits, order selections, diagnoses and plans.

Every function draws into ``ax`` (a new one when not given) and
returns it, but `detection`, `fleet_overview`, `fleet_patterns`, `fleet_history` and
`watched_windows`, which make a figure; `text_alternative` describes in a sentence what
it shows. Angles are in degrees, errors in arcsec, or in degrees where one reaches a
degree (``errors_in=`` selects another unit). Needs ``pip install trueangle[plot]``;
matplotlib is imported at the first picture.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import TrueAngleError
from ..support.suggestions import check_choice
from .amplitudespectrum import amplitude_spectrum
from .canvas import as_image, page_pictures, text_alternative
from .controlcharts import fleet_history, watched_windows
from .diagnosispictures import error_left, factors, gains
from .drawnreadings import (
    before_after,
    error_curves,
    measured_and_simulated,
    model_error,
    residuals,
)
from .fleetpictures import fleet_overview, fleet_patterns, fleet_phasors, fleet_plot, fleet_sizes
from .phasesoverruns import phases_over_runs
from .planpictures import detection, plan_factors, plan_positions

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult, Picture

__all__ = [
    "amplitude_spectrum",
    "before_after",
    "detection",
    "error_curves",
    "error_left",
    "factors",
    "fit_plot",
    "fleet_history",
    "fleet_overview",
    "fleet_patterns",
    "fleet_phasors",
    "fleet_sizes",
    "gains",
    "measured_and_simulated",
    "model_error",
    "phases_over_runs",
    "plan_factors",
    "plan_positions",
    "residuals",
    "text_alternative",
    "watched_windows",
]

_FIT = {
    "errors": error_curves,
    "spectrum": amplitude_spectrum,
    "phases": phases_over_runs,
    "residuals": residuals,
}


def __dir__() -> list[str]:
    return sorted(__all__)  # what completion shows: functions, not the modules of the same names


def fit_plot(
    fit: FitResult, kind: Picture = "errors", ax: Axes | None = None, **options: Any
) -> Axes:
    """See `trueangle.FitResult.plot`."""
    draw: Any = _FIT[check_choice("kind", kind, _FIT)]
    axes: Axes = draw(fit, ax=ax, **options)
    return axes


#: Results by the names of their classes, which need not be imported to be plotted.
_RESULTS: dict[str, Any] = {
    "FitResult": fit_plot,
    "HarmonicModel": model_error,
    "OrderSelection": amplitude_spectrum,
    "Diagnosis": gains,
    "Rehearsal": detection,
    "Fleet": fleet_plot,
}


def thumbnail(result: object) -> str:
    """A small picture of a result as an element of a page; empty where there is none to draw."""
    draw = _RESULTS.get(type(result).__name__)
    try:
        with page_pictures():
            return "" if draw is None else as_image(draw(result))
    except TrueAngleError:  # of no matplotlib too
        return ""


def drawn(result: object, *args: Any, **options: Any) -> Any:
    """The picture of a result (`trueangle.support.plainresult.result_picture`)."""
    return _RESULTS[type(result).__name__](result, *args, **options)
