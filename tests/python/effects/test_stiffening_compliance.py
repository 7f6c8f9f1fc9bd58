"""A spring that stiffens: the loads that it takes to say so, and its slopes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import StiffeningCompliance
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Simulation

Array = np.ndarray
SEED = 73_000


def under(loads: list[float], scatter: float) -> Signals:
    """A run for each load, which scatters by so much of the largest one."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    top = max(map(abs, loads))
    runs = []
    for k, load in enumerate(loads):
        theta = np.linspace(0.0, 380.0, 150) + 40.0 * k
        torque = load + scatter * top * rng.uniform(-1.0, 1.0, theta.size)
        runs.append(ta.CalibrationRun(theta, theta, 360.0, torque=torque, label=f"run {k}"))
    return join_runs(runs)


def proposed(
    effect: StiffeningCompliance, loads: list[float], scatter: float
) -> tuple[set[str], int] | None:
    signals = under(loads, scatter)
    rng = np.random.default_rng(SEED + 1)
    error = effect.signal(signals, Simulation().surroundings, rng)
    error = error + 0.5 * rng.standard_normal(len(signals))
    found = StiffeningCompliance.propose(
        Regression.of(signals, error, Simulation().surroundings, rho=0.0)
    )
    if found is None:
        return None
    hangs = found.shape.pop("gravity_deg") is not None
    return {*found.shape}, found.parameters - hangs


KNEE = StiffeningCompliance(3.0, 0.0, -2.0, 3.0)
CUBIC = StiffeningCompliance(3.0, -0.03)


@pytest.mark.parametrize("scatter", [1e-4, 2e-4])
@pytest.mark.parametrize("effect", [KNEE, CUBIC])
@pytest.mark.parametrize(
    ("loads", "form"),
    [
        ([-8.0, 8.0, -8.0, 8.0], None),
        ([2.0, 8.0, 2.0, 8.0], None),
        ([-8.0, 2.0, 8.0, 2.0], {"power"}),
        # Three sizes, of either sign and none: as many as a knee has parameters.
        ([-8.0, -4.0, 0.0, 2.0, 4.0, 8.0], {"power"}),
        ([-8.0, -6.0, 0.0, 2.0, 4.0, 8.0], {"either"}),
    ],
)
def test_loads_that_scatter_are_as_many_as_were_meant(
    loads: list[float], form: set[str] | None, effect: StiffeningCompliance, scatter: float
) -> None:
    """A law has to have fewer parameters than there are loads; the noise of a torque is none."""
    if form == {"either"}:
        form = {"knee_Nm"} if effect is KNEE else {"power"}
    # Two slopes, and a knee where it has one.
    expected = None if form is None else (form, 2 + ("knee_Nm" in form))
    assert proposed(effect, loads, scatter) == expected


@pytest.mark.parametrize("effect", [KNEE, CUBIC])
def test_a_load_that_hangs_has_a_vertical_to_pay_for(effect: StiffeningCompliance) -> None:
    hanging = replace(effect, gravity_deg=50.0)
    form = {"knee_Nm"} if effect is KNEE else {"power"}
    assert proposed(hanging, [8.0, 8.0, 6.0, 6.0], 0.0) == (form, 2 + (effect is KNEE))


@pytest.mark.parametrize("gravity", [None, 0.0, 130.0])
@pytest.mark.parametrize(
    "effect", [StiffeningCompliance(3.0, 0.0, -2.0, 3.0), StiffeningCompliance(-3.0, 0.2), KNEE,
               StiffeningCompliance(1.0, 0.05, 4.0, 1.5)],
)  # fmt: skip
def test_slopes_are_those_of_its_signal(
    effect: StiffeningCompliance, gravity: float | None
) -> None:
    """By the knee and by the vertical, at torques of both signs on both sides of the knee."""
    signals = under([-8.0, -4.0, -1.0, 2.0, 5.0, 8.0], 0.2)
    effect = replace(effect, gravity_deg=gravity)
    names = ["knee_Nm"] * bool(effect.beyond_knee_arcsec_per_Nm)
    names += ["gravity_deg"] * (gravity is not None)
    step = 1e-5

    def signal(name: str, way: float) -> Array:
        moved = replace(effect, **{name: getattr(effect, name) + way * step})
        return moved.signal(signals, Simulation().surroundings, np.random.default_rng(0))

    slopes = effect.slopes(signals)
    assert slopes.shape == (len(signals), len(names))
    moment = np.abs(effect.moment(signals, gravity))
    smooth = np.abs(moment - effect.knee_Nm) > 1e-3
    assert (moment < effect.knee_Nm).any() or not effect.knee_Nm
    for k, name in enumerate(names):
        expected = (signal(name, 1.0) - signal(name, -1.0)) / (2.0 * step)
        np.testing.assert_allclose(slopes[smooth, k], expected[smooth], rtol=1e-5, atol=1e-6)
