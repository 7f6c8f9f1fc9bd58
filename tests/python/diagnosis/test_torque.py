"""The torque of a drive in its own units: what is hidden in it comes back with its sign."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.diagnosis.drive import diagnose_drive
from trueangle.diagnosis.finding import Finding
from trueangle.effects import Backlash, Latency
from trueangle.estimation.quantity import quantity
from trueangle.joint.signals import join_runs
from trueangle.runs.joining import minus_simulated
from trueangle.simulation import Simulation

RIPPLE, PHASE, FRICTION, DAMPING = 0.3, 40.0, 0.2, 0.05


def runs_of(period: float, hidden: float) -> list[ta.CalibrationRun]:
    """There and back, two runs; the drive brings the load, and friction and damping if hidden."""
    found = []
    for speed in (0.5, 1.5):
        time = np.arange(600) * 0.02
        theta = 2.5 * np.sin(speed * time)
        velocity = 2.5 * speed * np.cos(speed * time)
        torque = 2.0 * np.cos(theta)
        # The drive brings what acts on the joint, of the other sign.
        torque -= hidden * RIPPLE * np.sin(4.0 * theta + np.radians(PHASE))
        torque += hidden * (FRICTION * np.sign(velocity) + DAMPING * velocity)
        unit = period / (2.0 * np.pi)
        found.append(
            ta.CalibrationRun(
                theta * unit,
                theta * unit,
                period,
                time=time,
                velocity=velocity * unit,
                torque=torque,
                label=f"{speed:g}",
            )
        )
    return found


def least_squares(runs, log):
    """The account of an error by the columns of the effects themselves, as findings."""
    signals, around = join_runs(log.runs), Simulation().surroundings
    error = unfolded_error(log.runs)
    x = 4.0 * signals.theta
    columns = [np.sin(x), np.cos(x)]
    columns += [effect.expected(signals, around) for effect in (Backlash(1.0), Latency(1e-3))]
    columns += [signals.run == k for k in range(2)]
    b = np.linalg.lstsq(np.column_stack(columns).astype(float), error, rcond=None)[0]
    phase = np.degrees(np.arctan2(b[1], b[0])) % 360.0
    found = [
        ("missing_order", {"output_order": quantity(4.0),
                           "amplitude_arcsec": quantity(float(np.hypot(*b[:2])), 0.36),
                           "phase_deg": quantity(float(phase), 1.5)}),
        ("backlash", {"half_width_arcsec": quantity(float(b[2]), 0.72)}),
        ("latency", {"delay_s": quantity(float(b[3]) * 1e-3, 2e-6)}),
    ]  # fmt: skip
    return SimpleNamespace(
        discrepancy=SimpleNamespace(rms=float(np.std(error))),
        noise=3.6,
        unexplained=None,
        findings=[Finding(cause, given, {}, None, []) for cause, given in found],
        complete=True,
    )


@pytest.mark.parametrize("period", [2.0 * np.pi, 360.0, 4096.0])
def test_torques_hidden_in_a_drive_come_back_with_their_signs(period: float) -> None:
    measured, log = runs_of(period, 1.0), runs_of(period, 0.0)
    account = diagnose_drive(minus_simulated(measured, log), measured, least_squares)
    ripple, friction, damping = account.findings
    assert [f.effect for f in account.findings] == ["torque_ripple", "dry_friction", "damping"]
    assert ripple.parameters["order"].value == 4.0
    assert ripple.parameters["torque_Nm"].value == pytest.approx(RIPPLE, rel=1e-3)
    assert ripple.parameters["phase_deg"].value == pytest.approx(PHASE, abs=0.1)
    assert friction.parameters["torque_Nm"].value == pytest.approx(FRICTION, rel=1e-2)
    assert damping.parameters["Nm_s_per_rad"].value == pytest.approx(DAMPING, rel=1e-2)
    # The largest torque is put into 36 arcsec: so are errors, which have no sign.
    one = max(float(np.abs(run.torque).max()) for run in [*measured, *log]) / 36.0
    assert ripple.parameters["torque_Nm"].std == pytest.approx(0.36 * one)
    assert ripple.parameters["phase_deg"].std == 1.5
    assert friction.parameters["torque_Nm"].std == pytest.approx(0.72 * one)
    assert damping.parameters["Nm_s_per_rad"].std == pytest.approx(
        2e-6 * one * 3600.0 * np.degrees(1.0)
    )
    hidden = np.concatenate([a.torque - b.torque for a, b in zip(measured, log, strict=True)])
    assert account.rms == pytest.approx(float(np.std(hidden)), rel=1e-3)
    assert account.noise == pytest.approx(3.6 * one)
    assert not account.unexplained
    order, torque, phase = (float(x) for x in account.ripple.split(":"))
    assert (order, torque, phase) == pytest.approx((4.0, RIPPLE, PHASE), rel=3e-3)
    added = [float(x) for x in account.advice.replace("add", "").split() if x[0] in "+-"]
    assert added == pytest.approx([FRICTION, DAMPING], rel=1e-2)
