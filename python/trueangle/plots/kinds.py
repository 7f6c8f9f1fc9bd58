"""Pictures by name, for the ``plot`` methods of results."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..errors import ArgumentError
from .amplitudespectrum import amplitude_spectrum
from .errorcurves import error_curves
from .phasesoverruns import phases_over_runs
from .residualpictures import residuals

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult

__all__ = ["fit_plot"]

_FIT = {
    "errors": error_curves,
    "spectrum": amplitude_spectrum,
    "phases": phases_over_runs,
    "residuals": residuals,
}


def fit_plot(fit: FitResult, kind: str = "errors", ax: Axes | None = None, **options: Any) -> Axes:
    """See `trueangle.FitResult.plot`."""
    draw: Any = _FIT.get(kind)
    if draw is None:
        raise ArgumentError(f"kind must be one of {', '.join(_FIT)}, got {kind!r}")
    axes: Axes = draw(fit, ax=ax, **options)
    return axes
