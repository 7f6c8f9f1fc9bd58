"""The correction that a diagnosis makes: terms taken off, lines found, and what is recorded."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.correction import extend_model, without_terms
from trueangle.effects import ArgumentShift as ArgumentEffect
from trueangle.effects import (
    Backlash,
    FilterLag,
    Latency,
    MissingOrder,
    ScaleError,
    TorsionalCompliance,
)
from trueangle.errors import ArgumentError
from trueangle.joint.signals import join_runs
from trueangle.model import terms
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

SEED = 82_000
JOINT = Joint(50.0)
LINES = (Harmonic("output", 1, 40.0, 243.0), Harmonic("motor", 2, 25.0, 30.0))
RUNS = tuple(
    RunDesign(
        samples=300, turns=1.3, reversals=(0.4,), start_deg=41.0 * k,
        speed_deg_s=(5.0, 30.0)[k % 2], torque_Nm=(-3.0, 4.0)[k // 2],
    )
    for k in range(4)
)  # fmt: skip


def in_unit(run: ta.CalibrationRun, period: float) -> ta.CalibrationRun:
    """The same run in another unit of angle."""
    unit = period / run.period
    return replace(
        run,
        reference=run.reference * unit,
        indicated=run.indicated * unit,
        velocity=None if run.velocity is None else run.velocity * unit,
        period=period,
    )


def measured(effects: tuple, sigma: float = 0.5) -> list[ta.CalibrationRun]:
    print(f"seed {SEED}")
    truth = Simulation(JOINT, LINES, sigma_arcsec=sigma, runs=RUNS, effects=effects)
    return ta.simulate(truth, SEED)


def left_of(model: ta.HarmonicModel, runs: list[ta.CalibrationRun]) -> float:
    """Error that the model leaves, arcsec rms, the zero left out."""
    left = []
    for run in runs:
        error = model.error(
            run.unwrapped_reference,
            direction=join_runs([run]).direction,
            velocity=run.speed,
            torque=run.torque,
        )
        left.append((run.indicated - run.unwrapped_reference - error) * 3600.0 * 360.0 / run.period)
    joined = np.concatenate(left)
    turns = np.round(joined / (3600.0 * 360.0))
    return float(np.std(joined - turns * 3600.0 * 360.0))


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi])
def test_a_run_without_the_terms_is_that_of_the_harmonics_alone(period: float) -> None:
    """Of a run that the model made: at the angle of the delay before, its own error there."""
    unit = period / 360.0
    given = (terms.Backlash(0.01 * unit), terms.Latency(2e-3), terms.Latency(1e-3))
    x = np.linspace(0.0, 360.0, 50, endpoint=False)
    error = 0.02 * np.cos(np.radians(x)) - 0.03 * np.sin(np.radians(2.0 * x))
    pattern = ta.CalibrationRun(x * unit, (x + error) * unit, period)
    plain = ta.fit(pattern, orders=[1, 2]).model.replace(argument="reference")
    model = plain.replace(terms=given)
    theta = np.concatenate([np.linspace(10.0, 300.0, 80), np.linspace(299.0, 40.0, 70)]) * unit
    velocity = np.where(np.arange(150) < 80, 20.0, -35.0) * unit
    error = model.error(theta, direction=np.sign(velocity), velocity=velocity)
    run = ta.CalibrationRun(theta, theta + error, period, velocity=velocity)
    (clean,) = without_terms(run, model)
    seen = theta - 3e-3 * velocity
    np.testing.assert_allclose(clean.reference, seen, atol=1e-9 * period)
    np.testing.assert_allclose(clean.indicated - seen, plain.error(seen), atol=1e-9 * period)
    with pytest.raises(ArgumentError, match=r"the model's period is .*, that of the runs 7"):
        without_terms(replace(run, period=7.0), model)


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi])
@pytest.mark.parametrize("given", [True, False])
def test_what_was_found_is_taken_off_down_to_the_noise(given: bool, period: float) -> None:
    """Terms as they are, lines as orders; those that the model has come from the model."""
    effects = (Backlash(3.0), Latency(1e-4), TorsionalCompliance(2.0),
               MissingOrder("output", 3, 9.0, 10.0))  # fmt: skip
    runs = [in_unit(run, period) for run in measured(effects)]
    found = Simulation(JOINT, LINES, effects=effects)
    model = ta.fit(runs, orders={"output": [1], "motor": [2]}, shafts={"output": 1.0, "motor": 50.0}
                   ).model if given else None  # fmt: skip
    extended = extend_model(model, runs, found)
    assert sorted(extended.orders) == [1.0, 3.0, 100.0]
    assert {term.kind for term in extended.terms} == {
        "backlash", "latency", "torsional_compliance",
    }  # fmt: skip
    assert extended.period == pytest.approx(period)
    assert left_of(extended, runs) == pytest.approx(0.5, rel=0.1)
    assert extended.fit is not None
    told = {name: (low, high) for name, low, high in extended.fit.signals}
    velocity = np.concatenate([run.speed for run in runs])
    assert told["velocity"] == pytest.approx((velocity.min(), velocity.max()))
    torque = np.concatenate([run.torque for run in runs])
    assert told["torque"] == (torque.min(), torque.max())
    assert "current" not in told


def test_terms_of_the_pattern_and_the_pattern_are_fitted_to_each_other() -> None:
    """A filter lags every line by its own frequency: lines are those before the filter."""
    effects = (FilterLag(25.0),)
    runs = measured(effects, 0.05)
    extended = extend_model(None, runs, Simulation(JOINT, LINES, effects=effects))
    assert left_of(extended, runs) < 0.1
    pattern = extended.replace(terms=())
    x = np.linspace(0.0, 360.0, 1000)
    truth = Simulation(JOINT, LINES).surroundings.pattern.value(np.radians(x))
    made = 3600.0 * pattern.error(x)
    np.testing.assert_allclose(made - made.mean(), truth - truth.mean(), atol=0.1)


def test_a_line_that_is_no_whole_order_has_a_shaft_of_its_own() -> None:
    """And lines that the model has are not fitted twice, whatever shaft they are said to be of."""
    runs = measured((), 0.5)
    lines = (
        MissingOrder("output", 7.3, 3.0, 0.0),
        MissingOrder("output", 7, 3.0, 0.0),
        MissingOrder("output", 50, 3.0, 0.0),
        MissingOrder("motor", 1, 3.0, 0.0),
        MissingOrder("output", 100, 3.0, 0.0),
    )
    extended = extend_model(None, runs, Simulation(JOINT, LINES, effects=lines))
    shafts = {shaft.name: (shaft.cycles_per_turn, [*shaft.orders]) for shaft in extended.shafts}
    assert shafts == {
        "output": (1.0, [1, 7, 50]),
        "motor": (50.0, [2]),
        "order 7.3": (7.3, [1]),
    }


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_the_argument_is_that_of_the_model_or_of_the_effect(argument: str) -> None:
    runs = measured((), 0.5)
    model = ta.fit(runs, orders=[1], argument=argument).model
    plain, of_indicated = Simulation(JOINT, LINES), (ArgumentEffect(-1.0),)
    assert extend_model(model, runs, plain).argument == argument
    told = extend_model(model, runs, replace(plain, effects=of_indicated))
    assert told.argument == "indicated"
    assert extend_model(model, runs, plain, "reference").argument == "reference"


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi])
def test_a_wrong_ratio_is_taken_off_over_the_travel_of_the_runs(period: float) -> None:
    """From the lowest angle of all runs to the highest, the turns counted."""
    runs = [in_unit(run, period) for run in measured((), 0.5)]
    found = Simulation(JOINT, LINES, effects=(ScaleError(3e-6),))
    (term,) = extend_model(None, runs, found).terms
    angles = np.concatenate([run.unwrapped_reference for run in runs])
    assert (term.start, term.stop) == pytest.approx((angles.min(), angles.max()))
    assert term.relative_error == 3e-6
    stated = replace(found, effects=(ScaleError(3e-6, start_deg=10.0, stop_deg=90.0),))
    (term,) = extend_model(None, runs, stated).terms
    assert (term.start, term.stop) == pytest.approx((period / 36.0, period / 4.0))


def test_another_joint_is_followed_over_its_turns() -> None:
    """A share of an angle that is wrapped is one of the angle that it came to."""
    wrist = np.linspace(-100.0, 800.0, 200)
    theta = np.linspace(0.0, 300.0, 200)
    share = terms.JointCoupling("wrist", 0.01)
    model = ta.HarmonicModel((), period=360.0, terms=(share,))
    run = ta.CalibrationRun(
        theta, theta + 0.01 * wrist, 360.0, signals={"coupled_wrist": np.mod(wrist, 360.0)}
    )
    (clean,) = without_terms(run, model)
    left = clean.indicated - clean.reference
    np.testing.assert_allclose(left - left[0], 0.0, atol=1e-9)
    np.testing.assert_allclose(clean.reference, theta, atol=1e-9)
