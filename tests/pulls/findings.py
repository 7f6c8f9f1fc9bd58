"""Parameters of causes that are columns of the readings: each hidden, proposed and reported.

What states no error has no row: the step of a rounding, which a search finds exactly or not at all;
a gear ratio of whole teeth (near the believed one it has a row in `spreads`); rows, runs and orders
that a search finds; the further elements of a hysteresis.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

import trueangle as ta
from asked import Case, Told, generator, pulls_of
from effects import test_line_errors as lines
from effects import test_stated_errors as singles
from estimation.test_covariance import correlated
from trueangle.effects import EFFECTS, Effect
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs

#: Further forms of causes: a line or the pattern where the kept tests hide a zero.
FORMS: dict[str, dict[str, Any]] = {
    "missing_order, motor": {
        "shaft": "motor", "order": 1, "amplitude_arcsec": 2.0, "phase_deg": 200.0,
    },
    "thermal_drift, line": {"lines_per_K": ((1.0, 0.15, 40.0),)},
    "thermal_drift, pattern": {"pattern_per_K": 0.008},
    "torsional_compliance, gravity": {"lines_per_Nm": ((1.0, 0.5, 40.0),)},
    "current_coupling, line": {"lines_per_A": ((1.0, 2.0, 40.0),)},
    "load_dependent_gear_error, absolute": {
        "lines_per_Nm": ((100.0, 0.3, 30.0),), "torque": "absolute",
    },
    "varying_line, torque": {
        "order": 7, "follows": "torque", "amplitude_arcsec": 0.4, "phase_deg": 300.0,
    },
    "reference_error, mount counted back": {
        "orders": (2.0,), "amplitudes_arcsec": (2.0,), "phases_deg": (30.0,), "mount_sign": -1.0,
    },
}  # fmt: skip

#: Causes that are hidden in noise that remembers as well, and its memory.
REMEMBERED = (
    "missing_order", "backlash", "presliding_hysteresis", "latency", "filter_lag, first order",
    "thermal_drift", "torsional_compliance", "local_defect, output", "non_integer_order",
    "time_periodic", "sidebands", "joint_coupling",
)  # fmt: skip
MEMORY = 0.5

#: Names under which a finding tells a field of its effect.
FIELDS = {
    "amplitudes": "amplitudes_arcsec",
    "coefficients": "amplitude_arcsec",
}


def truth(effect: Effect) -> dict[str, Any]:
    """What a finding tells of an effect, under the names that it uses."""
    given = dict(vars(effect))
    found = {name: value for name, value in given.items() if not isinstance(value, str)}
    found |= {name: given[field] for name, field in FIELDS.items() if field in given}
    if "phase_deg" in given:
        found["phases_deg"] = given["phase_deg"]
    for name, value in given.items():
        if name.startswith("lines_per_") and value:
            unit = name.removeprefix("lines_per_")
            orders, sizes, phases = zip(*value, strict=True)
            found |= {"orders": list(orders), "phases_deg": phases}
            found[f"amplitudes_arcsec_per_{unit}"] = sizes
    if effect.kind == "sidebands":
        found["orders"] = [given["carrier"] + offset for offset in given["offsets"]]
    elif "orders" in given:
        found["orders"] = list(given["orders"])
    if effect.kind == "missed_counts":
        del found["run"]  # told by its label
    if effect.kind == "reference_error":
        found["mount_sign"] = [given["mount_sign"]]
    if effect.kind == "filter_lag":
        damping = given["damping"]
        natural = None if damping is None else 2.0 * damping * given["cutoff_hz"]
        found["natural_frequency_hz"] = natural
    if effect.kind == "torsional_compliance":
        found["departure_arcsec"] = 0.0
        for _, size, phase in given["lines_per_Nm"]:
            found |= {"arcsec_per_Nm": size, "gravity_arcsec_per_Nm": size}
            found["gravity_phase_deg"] = phase
    return found


@cache
def read() -> dict[str, Signals]:
    """Readings of both kept designs."""
    return {
        "singles": join_runs(ta.simulate(singles.SIM, 3)),
        "lines": lines.readings(),
    }


def told(name: str, effect: Effect, design: str, memory: float = 0.0) -> Case:
    """The cause of a name, hidden in one of the designs beside noise of this memory."""

    def case(seed: int) -> Told:
        signals = read()[design]
        rng = generator(seed, name)
        error = effect.signal(signals, singles.SIM.surroundings, rng)
        noise = [correlated(rng, memory, b - a) for a, b in signals.run_bounds()]
        error = error + singles.NOISE * np.concatenate(noise)
        # White noise is known to be so; a memory is found in what is left.
        rho = None if memory else 0.0
        start = Regression.of(signals, error, singles.SIM.surroundings, rho=rho)
        found = EFFECTS[effect.kind].propose(start)
        if found is None:
            return
        full = start.with_terms([found])
        terms = [(*full.fitted()[0], full.covariance(0))]
        parameters, _ = EFFECTS[effect.kind].report(full, terms)
        limits = EFFECTS[effect.kind].form_limits(full, terms)
        yield from pulls_of(parameters | limits, truth(effect))

    return case


def cases() -> Mapping[str, Case]:
    """Those of the kept tests, and the further forms."""
    hidden: dict[str, tuple[str, dict[str, Any]]]
    hidden = {name: ("singles", given) for name, (given, _) in singles.HIDDEN.items()}
    hidden |= {name: ("lines", given) for name, (given, _) in lines.HIDDEN.items()}
    hidden |= {name: ("lines", given) for name, given in FORMS.items()}
    effects = {
        name: EFFECTS[name.partition(",")[0]](**given) for name, (_, given) in hidden.items()
    }
    found = {name: told(name, effect, hidden[name][0]) for name, effect in effects.items()}
    for name in REMEMBERED:
        longer = f"{name}, in noise that remembers"
        found[longer] = told(longer, effects[name], hidden[name][0], MEMORY)
    return found
