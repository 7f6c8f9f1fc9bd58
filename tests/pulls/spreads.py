"""Causes of the scatter, spreads of what every run draws anew, and gear ratios near the believed.

A deviation of ν numbers is known to one in ``√(2ν)`` of itself, and skewed. By the ν that a stated
error says its square is made normal (Wilson and Hilferty 1931):

::

    [(value / truth)^(2/3) - 1 + 2 / 9ν] / √(2 / 9ν)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

import trueangle as ta
from asked import Case, Pull, Told, generator
from effects import test_scatter_errors as scatters
from effects import test_spreads as spreads
from effects.test_stated_errors import SIM
from hidden.test_near_ratio import joint_pair, seen
from trueangle.diagnosis.gearratio import near_ratio
from trueangle.effects import EFFECTS
from trueangle.estimation.quantity import Quantity
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals

#: Share, size and noise of outliers, arcsec: some fifty of them.
SHARE, SIZE, SIGMA = 0.02, 80.0, 2.0


def pull_of_size(name: str, told: Quantity, truth: float) -> Pull:
    """Of a deviation."""
    ninth = 2.0 / 9.0 * 2.0 * (told.std / told.value) ** 2
    return Pull(name, ((told.value / truth) ** (2.0 / 3.0) - 1.0 + ninth) / math.sqrt(ninth))


@cache
def read(design: str) -> Signals:
    """Readings of a kept design."""
    return scatters.readings() if design == "scatter" else spreads.readings(spreads.RUNS)


def scatter(name: str) -> Case:
    """A cause of uneven noise."""
    cause, given = name.partition(",")[0], scatters.HIDDEN[name]
    hidden = EFFECTS[cause](**given)
    order = given.get("order", 1.0)
    suffix = "" if order == 1.0 else f"_{order:.0f}"

    def case(seed: int) -> Told:
        rng, signals = generator(seed, name), read("scatter")
        factor = hidden.noise_factor(signals, SIM.surroundings)
        noise = rng.standard_normal(len(signals)) * (1.0 if factor is None else factor)
        noise += hidden.signal(signals, SIM.surroundings, rng)
        start = Regression.of(signals, noise, SIM.surroundings, rho=0.0)
        found = EFFECTS[cause].find_scatter(start)
        if found is None:
            return
        for field, truth in given.items():
            # Where it is told by something else beside or instead, that is another question.
            told = found.parameters.get(field + suffix)
            if field != "order" and told is not None:
                yield Pull(field, (told.value - truth) / told.std)

    return case


def spread(cause: str) -> Case:
    """What each of twelve runs draws."""
    given, _, _ = spreads.SPREADS[cause]
    hidden = EFFECTS[cause](**given)

    def case(seed: int) -> Told:
        rng, signals = generator(seed, cause), read("runs")
        error = hidden.signal(signals, SIM.surroundings, rng)
        error = error + spreads.NOISE * rng.standard_normal(len(signals))
        start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
        effect: Any = EFFECTS[cause]
        # Which of ten forms is taken is another question.
        drifts = cause == "drift_within_run"
        found = effect._proposal(start, "ramp") if drifts else effect.propose(start)
        full = start.with_terms([found])
        parameters, _ = effect.report(full, [(*full.fitted()[0], full.covariance(0))])
        bounds = signals.run_bounds()
        span = float(np.mean([signals.clock[b - 1] - signals.clock[a] for a, b in bounds]))
        for name, told in parameters.items():
            if told.std is not None:
                truth = given[name] if name in given else given["arcsec_per_s"] * span
                yield pull_of_size(name, told, truth)

    return case


def outliers(seed: int) -> Told:
    """Isolated ones, of a normal distribution of their own."""
    rng, signals = generator(seed, "outliers"), read("scatter")
    far = rng.random(len(signals)) < SHARE
    error = SIGMA * rng.standard_normal(len(signals))
    error += far * SIZE * rng.standard_normal(len(signals))
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    found = EFFECTS["outliers"].find_scatter(start)
    if found is not None:
        fraction = found.parameters["fraction"]
        pull = (fraction.value - SHARE) / fraction.std
        yield Pull("fraction", pull, "as if a fifth of them hid in the noise")
        yield pull_of_size("size_arcsec", found.parameters["size_arcsec"], SIZE)


def ratio(seed: int) -> Told:
    """One believed that is off by less than a run's travel resolves."""
    rng = generator(seed, "wrong_gear_ratio")
    believed_ratio = float(rng.choice([100.0, 50.0, 46.656, 7.31]))
    turns = float(rng.uniform(0.6, 3.0))
    departure = float(rng.choice([-0.06, 0.04])) / turns
    true, believed = joint_pair(rng, believed_ratio, departure, turns, 5, 400, (0.5,))
    found = near_ratio(seen(believed, ta.simulate(true, seed)))
    if found is not None:
        yield Pull("gear_ratio", (found.gear_ratio - believed_ratio - departure) / found.std)


def cases() -> Mapping[str, Case]:
    """All of them."""
    return {
        **{name: scatter(name) for name in scatters.HIDDEN},
        **{cause: spread(cause) for cause in spreads.SPREADS},
        "outliers": outliers,
        "wrong_gear_ratio": ratio,
    }
