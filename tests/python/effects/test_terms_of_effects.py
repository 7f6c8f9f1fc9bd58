"""The correction's terms are the effects' own errors, whatever the unit of the angle."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle import HarmonicModel
from trueangle.diagnosis.correction import terms_from_effects
from trueangle.effects import (
    Backlash,
    CurrentCoupling,
    Effect,
    JointCoupling,
    Latency,
    LoadDependentGearError,
    StiffeningCompliance,
    TorsionalCompliance,
    VaryingLine,
)
from trueangle.joint.signals import join_runs
from trueangle.simulation import Joint, Simulation

Array = np.ndarray
SEED = 74_000
JOINT = Joint(50.0, "circular_spline", "motor")

#: What acts of what moves: forms with all their numbers, of either sign.
HIDDEN: dict[str, Effect] = {
    "backlash": Backlash(2.0),
    "latency": Latency(3e-4),
    "spring": TorsionalCompliance(-1.5),
    "cubic": StiffeningCompliance(1.5, -0.1),
    "knee": StiffeningCompliance(3.0, 0.0, -2.0, 2.2),
    "hanging": StiffeningCompliance(3.0, 0.05, -2.0, 2.2, 130.0),
    "lines of a load": LoadDependentGearError(lines_per_Nm=((100.0, 0.3, 30.0),)),
    "speed": VaryingLine(7.0, "speed", 0.05, 40.0),
    "velocity": VaryingLine(7.0, "velocity", 0.05, 40.0),
    "torque": VaryingLine(7.0, "torque", 0.5, -40.0),
    "current": CurrentCoupling(2.0),
    "wrist": JointCoupling("wrist", 1e-3),
}


def run_of(period: float) -> tuple[ta.CalibrationRun, Array]:
    """A run in this unit, and the angle of the wrist in it."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    theta = np.concatenate([np.linspace(0.0, 400.0, 90), np.linspace(399.0, 20.0, 60)])
    unit = period / 360.0
    velocity = unit * np.where(np.arange(150) < 90, 1.0, -1.0) * rng.uniform(5.0, 30.0, 150)
    wrist = unit * 50.0 * np.sin(np.arange(150) / 20.0)
    run = ta.CalibrationRun(
        unit * theta,
        unit * theta,
        period,
        velocity=velocity,
        torque=rng.uniform(-5.0, 5.0, 150),
        temperature=rng.uniform(20.0, 40.0, 150),
        signals={"current": rng.uniform(-3.0, 3.0, 150), "coupled_wrist": wrist},
    )
    return run, wrist


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi, 4096.0])
@pytest.mark.parametrize("name", HIDDEN)
def test_a_term_is_the_error_of_its_effect_in_the_unit_of_the_angle(
    name: str, period: float
) -> None:
    effect = HIDDEN[name]
    run, wrist = run_of(period)
    signals = join_runs([run])
    around = Simulation(JOINT).surroundings
    wanted = effect.signal(signals, around, np.random.default_rng(0)) / 3600.0 * period / 360.0
    assert np.ptp(wanted) > 0.0
    terms = terms_from_effects([effect], period, JOINT.shafts)
    model = HarmonicModel((), period=period, terms=terms)
    found = model.error(
        run.unwrapped_reference,
        direction=signals.direction,
        velocity=run.speed,
        torque=run.torque,
        temperature=run.temperature,
        current=run.signal("current"),
        coupled_wrist=wrist,
    )
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-9 * np.abs(wanted).max())
    # A table of it, as a finding gives it, has the same terms.
    assert terms_from_effects([effect.to_table()], period, JOINT.shafts) == terms
