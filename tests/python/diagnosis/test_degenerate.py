"""Small, constant, one-way, noiseless, repeated readings: a diagnosis warns of nothing by itself.

The suite turns warnings into errors: a division by zero anywhere fails these tests.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.heteroscedastic_noise import HeteroscedasticNoise
from trueangle.errors import ArgumentError, TrueAngleError
from trueangle.simulation import Backlash, Harmonic, Joint, RunDesign, Simulation, simulate

#: Cases of a set, each of some tenths of a second at most.
CASES = 6

SIZES = (4, 10, 20, 25, 40, 80, 160)
SPANS = (0.0, 1e-9, 0.5, 5.0, 24.0, 180.0, 360.0, 3600.0)


def travel(rng: np.random.Generator) -> np.ndarray:
    """One way, there and back, to and fro, at rest, with doubled rows, the same again."""
    n, span = int(rng.choice(SIZES)), float(rng.choice(SPANS))
    even = np.linspace(0.0, span, n)
    return [
        lambda: even,
        lambda: -even,
        lambda: np.sort(rng.uniform(0.0, max(span, 1e-6), n)),
        lambda: np.concatenate([even[: n // 2], even[: n - n // 2][::-1]]),
        lambda: span * np.sin(np.linspace(0.0, 6.0, n)),
        lambda: np.full(n, span),
        lambda: np.repeat(even[::2], 2)[:n],
        lambda: np.tile(np.linspace(0.0, span, max(n // 3, 1)), 4)[:n],
    ][rng.integers(8)]()


def error_of(rng: np.random.Generator, theta: np.ndarray) -> np.ndarray:
    """Arcsec; often of one kind alone, and often without any noise."""
    n = theta.size
    kinds = [
        lambda e: e + rng.normal(0.0, 10.0 ** rng.integers(-9, 3), n),
        lambda e: e + 10.0 ** rng.integers(-6, 3) * np.sin(np.radians(theta) * rng.integers(1, 8)),
        lambda e: e + 1e3 * (rng.random(n) < 0.1),
        lambda e: 5.0 * np.round(e / 5.0),
        lambda e: e + 10.0 * np.sign(np.gradient(theta)),
        lambda e: e + np.cumsum(rng.normal(0.0, 1.0, n)),
        lambda e: e + 50.0 * (np.arange(n) >= n // 2),
    ]
    total = np.zeros(n)
    for kind in rng.integers(0, 7, int(rng.integers(0, 4))):
        total = kinds[kind](total)
    return total


def case(seed: int) -> tuple[list[ta.CalibrationRun], Simulation]:
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(int(rng.integers(1, 5))):
        theta = travel(rng)
        n = theta.size
        level = float(rng.normal())
        beside = {
            "time": 0.1 * np.arange(n),
            "temperature": np.full(n, 20.0 + 5.0 * level),
            "torque": rng.choice([0.0, level]) * np.ones(n),
            "mount": float(rng.choice([0.0, 90.0])),
        }
        kept = {name: value for name, value in beside.items() if rng.random() < 0.5}
        seen = theta + error_of(rng, theta) / 3600.0
        runs.append(ta.CalibrationRun(theta, seen, 360.0, label=str(i), **kept))
    ratio, fixed = rng.choice([2.0, 30.0, 50.5, 225.0]), rng.choice(["none", "flexspline"])
    joint = Joint(float(ratio), str(fixed))
    lines = (Harmonic("output", 1, 10.0, 20.0),) if rng.random() < 0.4 else ()
    effects = (Backlash(5.0),) if rng.random() < 0.3 else ()
    return runs, Simulation(joint, lines, effects, float(rng.choice([0.0, 1.0])))


#: Readings of this kind have ended in warnings and errors of Python: runs that stand still or do
#: not scatter, a majority that reads alike, regressors 1e8 times as large as others.
@pytest.mark.parametrize("first", [9100, 9200, 9300, 9400, 9500, 9600])
def test_a_diagnosis_ends_in_a_result_or_an_error_of_its_own(first: int) -> None:
    for seed in range(first, first + CASES):
        print("seed", seed)
        runs, sim = case(seed)
        try:
            found = ta.diagnose(runs, sim)
        except TrueAngleError:
            continue
        json.loads(found.to_json())
        assert found.summary()


def test_a_line_of_every_order_leaves_none_to_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over little travel only low orders are told apart: with all of them taken none is left."""
    from trueangle.effects import direction_dependent_pattern as module

    monkeypatch.setattr(module, "LIKELY", 0)
    sim = Simulation(
        sigma_arcsec=1.0, runs=(RunDesign(turns=0.2, reversals=(0.5,), samples=80),) * 2
    )
    assert ta.diagnose(simulate(sim, seed=61), sim).complete


def test_readings_of_which_some_do_not_scatter_have_a_bounded_noise() -> None:
    theta = np.linspace(0.0, 720.0, 400)
    torque = np.where(theta < 360.0, 0.0, 5.0)
    error = np.where(torque > 0.0, np.random.default_rng(62).normal(0.0, 3.0, 400), 0.0)
    run = ta.CalibrationRun(theta, theta + error / 3600.0, 360.0, torque=torque)
    found = ta.diagnose([run, run], Simulation()).findings
    uneven = [f for f in found if f.cause == HeteroscedasticNoise.kind]
    assert all(np.isfinite(q.value) for f in uneven for q in f.parameters.values())


def test_a_generator_that_stands_is_refused() -> None:
    for ratio in (1.0, 0.5):
        with pytest.raises(ArgumentError, match="above 1 where the flexspline is fixed"):
            Joint(ratio, "flexspline")
    assert Joint(1.5, "flexspline").shafts["wave_generator"] == 0.5


def test_more_than_half_of_the_readings_are_no_outliers() -> None:
    """All alike but for some far off: the majority is not set aside."""
    theta = np.linspace(0.0, 360.0, 120)
    error = np.where(np.arange(120) % 10 == 3, 900.0, 0.0)
    run = ta.CalibrationRun(theta, theta + error / 3600.0, 360.0)
    found = ta.diagnose([run, run], Simulation())
    share = [f.parameters["fraction"].value for f in found.findings if f.cause == "outliers"]
    assert all(value < 0.5 for value in share)
