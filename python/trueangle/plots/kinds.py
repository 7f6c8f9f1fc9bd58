"""Which picture the ``plot`` method of a result draws, and its thumbnail."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import TrueAngleError
from ..support.suggestions import check_choice
from .amplitudespectrum import amplitude_spectrum
from .canvas import as_image, small_pictures
from .diagnosispictures import gains
from .drawnreadings import error_curves, model_error, residuals
from .fleetpictures import fleet_plot
from .phasesoverruns import phases_over_runs
from .planpictures import detection

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult, Picture

_FIT = {
    "errors": error_curves,
    "spectrum": amplitude_spectrum,
    "phases": phases_over_runs,
    "residuals": residuals,
}


def fit_plot(
    fit: FitResult, kind: Picture = "errors", ax: Axes | None = None, **options: Any
) -> Axes:
    """See `trueangle.FitResult.plot`."""
    draw: Any = _FIT[check_choice("kind", kind, _FIT)]
    axes: Axes = draw(fit, ax=ax, **options)
    return axes


#: Results by the names of their classes, which need not be imported to be drawn.
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
        with small_pictures():
            return "" if draw is None else as_image(draw(result))
    except TrueAngleError:  # of no matplotlib too
        return ""


def drawn(result: object, *args: Any, **options: Any) -> Any:
    """The picture of a result (`trueangle.support.plainresult.result_picture`)."""
    return _RESULTS[type(result).__name__](result, *args, **options)
