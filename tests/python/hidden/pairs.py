"""Two effects at once: both must be named, and nothing else."""

from __future__ import annotations

from .case import Case

#: Pairs in which one effect offers an excuse for the other, and plain ones.
PAIRS = (
    ("backlash", "latency"),
    ("backlash", "thermal_drift"),
    ("backlash", "torsional_compliance"),
    ("presliding_hysteresis", "latency"),
    ("latency", "filter_lag"),
    ("torsional_compliance", "load_dependent_gear_error"),
    ("zero_slip", "drift_within_run"),
    ("thermal_drift", "zero_slip"),
    ("reference_error", "torsional_compliance"),
    ("sidebands", "argument_error"),
    ("missing_order", "local_defect"),
    ("missed_counts", "outliers"),
    ("heteroscedastic_noise", "backlash"),
    ("scale_error", "drift_within_run"),
    ("non_integer_order", "reference_error"),
)


def cases(scale: float, seeds: list[int]) -> list[Case]:
    """Every pair for every seed."""
    return [Case(pair, scale, seed) for pair in PAIRS for seed in seeds]
