"""Designs of measured runs: what they hold, and that a simulation repeats the measurement."""

from dataclasses import fields, replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.simulation import Backlash, RunDesign, Simulation
from trueangle.simulation.measured import design_of

FULL = RunDesign(
    label="a",
    samples=500,
    direction=-1,
    reversals=(0.3, 0.6),
    speed_deg_s=7.0,
    start_deg=33.0,
    turns=2.3,
    torque_Nm=2.0,
    gravity_Nm=4.0,
    gravity_deg=25.0,
    temperature_C=20.0,
    temperature_end_C=26.0,
    mount_deg=40.0,
    current_A=1.5,
    coupled={"wrist": [0.0, 40.0, -20.0]},
)
#: A step of the readings, as a share of the travel.
STEP = 1.0 / 500.0


def test_a_design_is_found_again():
    (run,) = ta.simulate(Simulation(runs=(FULL,)), 3)
    found = design_of(run)
    assert (found.label, found.samples, found.direction) == ("a", 500, -1)
    assert found.speed_deg_s == pytest.approx(7.0)
    assert found.turns == pytest.approx(2.3, rel=2.0 * STEP)
    assert found.start_deg == pytest.approx(33.0, abs=360.0 * 2.3 * STEP)
    assert found.reversals == pytest.approx((0.3, 0.6), abs=2.0 * STEP)
    for name in ("torque_Nm", "gravity_Nm", "gravity_deg", "mount_deg", "current_A"):
        assert getattr(found, name) == pytest.approx(getattr(FULL, name)), name
    assert found.temperature_C == pytest.approx(20.0, abs=0.05)
    assert found.temperature_end_C == pytest.approx(26.0, abs=0.05)
    # The runs of both are alike, the other joint's way too.
    (again,) = ta.simulate(Simulation(runs=(found,)), 4)
    for mine, other in (
        (again.reference, run.reference),
        (again.signals["coupled_wrist"], run.signals["coupled_wrist"]),
    ):
        assert np.max(np.abs(mine - other)) < 3.0 * 360.0 * 2.3 * STEP


def test_a_run_at_rest_and_one_without_anything():
    (rest,) = ta.simulate(Simulation(runs=(RunDesign(speed_deg_s=0.0, spacing="uniform"),)))
    found = design_of(rest)
    assert (found.speed_deg_s, found.spacing) == (0.0, "uniform")
    assert found.turns == pytest.approx(1.0)
    bare = ta.CalibrationRun([0.0, 0.0], [0.0, 0.0], period=360.0)
    assert design_of(bare).samples == 2
    turned = ta.CalibrationRun(np.linspace(0.0, 6.0, 50), np.linspace(0.0, 6.0, 50))
    assert design_of(turned).turns == pytest.approx(6.0 * 50 / 49 / (2.0 * np.pi))


def test_what_extend_writes_repeats_the_measurement(tmp_path, capsys):
    truth = Simulation(
        sigma_arcsec=2.0,
        effects=(Backlash(9.0),),
        runs=tuple(RunDesign(reversals=(0.5,), speed_deg_s=v) for v in (5.0, 40.0, 5.0)),
    )
    runs = ta.simulate(truth, 20)
    ta.write_runs(runs, tmp_path / "runs.csv")
    believed = tmp_path / "joint.toml"
    believed.write_text("# mine\n[joint]\ngear_ratio = 1.0\n")
    better = tmp_path / "better.toml"
    files = [str(tmp_path / "runs.csv"), "--simulation", str(believed), "--extend", str(better)]
    assert main(["diagnose", *files]) == 0
    capsys.readouterr()
    # What was there stays as it was written.
    assert better.read_text().startswith(believed.read_text())
    extended = ta.load_simulation(better)
    assert extended.sigma_arcsec == pytest.approx(2.0, rel=0.1)
    assert [effect.kind for effect in extended.effects] == ["backlash"]
    again = ta.simulate(extended, 21)
    assert [len(run) for run in again] == [len(run) for run in runs]
    assert ta.diagnose(again, extended).findings == []
    # What the simulation states itself is kept.
    stated = Simulation(sigma_arcsec=1.5, runs=(RunDesign(),))
    found = ta.diagnose(runs, stated).simulation()
    assert (found.sigma_arcsec, found.runs) == (1.5, stated.runs)


@pytest.mark.parametrize("period", [1.0, 2.0 * np.pi, 4096.0])
def test_a_design_is_the_same_whatever_the_unit_of_the_readings(period):
    """Travel, speed, mount, shift and the ways of other joints, all angles."""
    (run,) = ta.simulate(Simulation(runs=(replace(FULL, shift_deg=12.0),)), 3)
    scale = period / 360.0
    angles = ("shift", "coupled_wrist")
    other = ta.CalibrationRun(
        scale * run.reference, scale * run.indicated, period, time=run.time,
        temperature=run.temperature, torque=run.torque, mount=scale * run.mount,
        label=run.label, velocity=scale * run.velocity,
        signals={n: v * (scale if n in angles else 1.0) for n, v in run.signals.items()},
    )  # fmt: skip
    one, found = design_of(run), design_of(other)
    for field in fields(RunDesign):
        mine, its = getattr(found, field.name), getattr(one, field.name)
        if field.name == "coupled":
            assert [name for name, _ in mine] == [name for name, _ in its]
            mine, its = (np.concatenate([way for _, way in ways]) for ways in (mine, its))
            np.testing.assert_allclose(mine, its, atol=1e-6)
        elif isinstance(its, float | tuple):
            assert mine == pytest.approx(its, abs=1e-6), field.name
        else:
            assert mine == its, field.name


@pytest.mark.parametrize("gravity_deg", [-170.0, -25.0, 0.0, 80.0])
@pytest.mark.parametrize("gravity", [0.5, 4.0])
def test_a_weight_is_told_from_a_constant_load_by_its_share(gravity_deg, gravity):
    """Noise of 1 Nm beside it: a weight of 0.5 is a half of less than its variance."""
    design = replace(FULL, gravity_Nm=gravity, gravity_deg=gravity_deg, turns=2.0)
    (run,) = ta.simulate(Simulation(runs=(design,)), 5)
    noise = np.random.default_rng(6).normal(size=500)
    found = design_of(replace(run, torque=run.torque + noise))
    if gravity < 1.0:
        assert (found.gravity_Nm, found.gravity_deg) == (0.0, 0.0)
        assert found.torque_Nm == pytest.approx(float((run.torque + noise).mean()))
    else:
        # Each coefficient to sqrt(2 / 500) of the noise, to 4.5 of them.
        about = 4.5 * np.sqrt(2.0 / 500.0)
        assert found.gravity_Nm == pytest.approx(4.0, abs=about)
        assert found.torque_Nm == pytest.approx(2.0, abs=about)
        away = (found.gravity_deg - gravity_deg + 180.0) % 360.0 - 180.0
        assert abs(away) < np.degrees(about / 4.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_speed_is_that_of_most_readings(sign):
    """Two thirds at 4 deg/s, some at 90 and some at rest: neither a mean nor with the rest."""
    speed = np.repeat([4.0, 90.0, 0.0], [200, 60, 90])
    time = np.arange(350) * 0.05
    angle = sign * np.concatenate([[0.0], np.cumsum(speed[1:] * 0.05)])
    found = design_of(ta.CalibrationRun(angle, angle, 360.0, time=time, velocity=sign * speed))
    assert (found.speed_deg_s, found.direction) == (pytest.approx(4.0), sign)
