"""Every cause of the vocabulary: how to draw one, and its size at scale 1."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from . import faults, lines, loads, reversal, slow, timing
from .designs import Scene
from .joint import Joint
from .source import Source

Draw = Callable[[np.random.Generator], Source]

#: cause: (how to draw it, standard deviation of its signal at scale 1 in arcsec). The noise
#: of ``heteroscedastic_noise`` has no signal; its number is the share of a change of 35 %.
CAUSES: dict[str, tuple[Draw, float]] = {
    "missing_order": (lines.draw_missing_order, 2.0),
    "sidebands": (lines.draw_sidebands, 2.0),
    "non_integer_order": (lines.draw_bearing, 1.4),
    "backlash": (reversal.draw_backlash, 3.0),
    "presliding_hysteresis": (reversal.draw_presliding, 4.0),
    "latency": (timing.draw_latency, 2.3),
    "filter_lag": (timing.draw_filter_lag, 2.4),
    "thermal_drift": (slow.draw_thermal, 1.2),
    "torsional_compliance": (loads.draw_compliance, 2.0),
    "stiffening_compliance": (loads.draw_stiffening, 1.1),
    "load_dependent_gear_error": (loads.draw_loaded_lines, 1.0),
    "zero_slip": (slow.draw_zero_slip, 2.4),
    "drift_within_run": (slow.draw_wander, 1.1),
    "scale_error": (lines.draw_scale, 2.0),
    "reference_error": (lines.draw_reference, 1.8),
    "argument_error": (lines.draw_argument, 0.91),
    "outliers": (faults.draw_outliers, 4.1),
    "missed_counts": (faults.draw_lost_counts, 1.6),
    "heteroscedastic_noise": (faults.draw_uneven_noise, 1.0),
    "local_defect": (faults.draw_dent, 0.62),
}


def draw(
    cause: str, scale: float, joint: Joint, scenes: Sequence[Scene], rng: np.random.Generator
) -> Source:
    """A random effect of one cause with ``scale`` times its usual size over ``scenes``."""
    build, rms = CAUSES[cause]
    return build(rng).sized(joint, scenes, scale * rms)
