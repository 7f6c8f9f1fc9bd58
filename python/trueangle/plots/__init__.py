"""Pictures of runs, fits, order selections, diagnoses and plans.

Every function draws into ``ax`` (a new one when not given) and
returns it, but `detection`, `fleet_overview`, `fleet_patterns`, `fleet_history` and
`watched_windows`, which make a figure; `text_alternative` says in a sentence what
it shows. Angles are in degrees, errors in arcsec, or in degrees where one reaches a
degree (``errors_in=`` asks for another unit). Needs ``pip install trueangle[plot]``;
matplotlib is imported at the first picture.
"""

from __future__ import annotations

from .amplitudespectrum import amplitude_spectrum
from .canvas import text_alternative
from .controlcharts import fleet_history, watched_windows
from .diagnosispictures import error_left, factors, gains
from .drawnreadings import (
    before_after,
    error_curves,
    measured_and_simulated,
    model_error,
    residuals,
)
from .fleetpictures import fleet_overview, fleet_patterns, fleet_phasors, fleet_sizes
from .kinds import drawn as drawn
from .kinds import fit_plot
from .kinds import thumbnail as thumbnail
from .phasesoverruns import phases_over_runs
from .planpictures import detection, plan_factors, plan_positions

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


def __dir__() -> list[str]:
    return sorted(__all__)  # what completion shows: no module beside the function of its name
