"""Pictures of runs, fits, order selections, diagnoses and plans.

One file a picture. Every function draws into ``ax`` (a new one when not given) and
returns it, but `detection`, `fleet_overview`, `fleet_patterns`, `fleet_history` and
`watched_windows`, which make a figure; `text_alternative` says in a sentence what
it shows. Angles are in degrees, errors in arcsec, or in degrees where one reaches a
degree (``errors_in=`` asks for another unit). Needs ``pip install trueangle[plot]``;
matplotlib is imported at the first picture.
"""

from __future__ import annotations

from .amplitudespectrum import amplitude_spectrum
from .beforeafter import before_after
from .canvas import text_alternative
from .detection import detection
from .errorcurves import error_curves
from .errorleft import error_left
from .fleetoverview import fleet_overview
from .fleetpictures import fleet_history, fleet_patterns, fleet_phasors, fleet_sizes
from .gains import gains
from .kinds import drawn as drawn
from .kinds import fit_plot
from .kinds import thumbnail as thumbnail
from .measuredsimulated import measured_and_simulated
from .modelerror import model_error
from .phasesoverruns import phases_over_runs
from .planpictures import plan_factors, plan_positions
from .residualpictures import residuals
from .watchedwindows import watched_windows

__all__ = [
    "amplitude_spectrum",
    "before_after",
    "detection",
    "error_curves",
    "error_left",
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


def __dir__() -> list[str]:
    return sorted(__all__)  # what completion shows: no module beside the function of its name
