"""Designs that cannot see an effect: the honest answer is `not_identifiable`."""

from __future__ import annotations

from .case import Case

#: design: the causes that leave no trace in it, or one that another cause leaves as well.
BLIND = {
    "one_direction": ("backlash", "presliding_hysteresis"),
    "one_speed": ("backlash", "latency"),
    "split_one_speed": ("backlash", "latency", "presliding_hysteresis"),
    "one_load": ("torsional_compliance",),
    "one_load_constant": (
        "torsional_compliance",
        "stiffening_compliance",
        "load_dependent_gear_error",
    ),
    "one_temperature": ("thermal_drift",),
    "one_mount": ("reference_error",),
    "no_columns": ("backlash", "latency", "torsional_compliance"),
    "one_run": ("zero_slip", "thermal_drift", "reference_error", "torsional_compliance"),
    "one_of_everything": ("backlash", "latency", "reference_error", "thermal_drift"),
    "paper": ("backlash", "latency", "filter_lag", "torsional_compliance", "reference_error"),
    "static_dense": ("backlash", "presliding_hysteresis", "latency", "filter_lag"),
}


def cases(seeds: list[int]) -> list[Case]:
    """Every blind pair of design and cause, for every seed."""
    return [
        Case((cause,), 1.0, seed, design)
        for design, causes in BLIND.items()
        for cause in causes
        for seed in seeds
    ]
