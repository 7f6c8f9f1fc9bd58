"""The loop in torque: step by step as it is defined, and what has turned."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.torque_hysteresis import TURNED, TorqueHysteresis
from trueangle.joint.signals import Signals, join_runs

Array = np.ndarray


def under(*torques: Array) -> Signals:
    """Signals of runs that feel these torques, whatever their angles."""
    runs = []
    for k, torque in enumerate(torques):
        theta = np.linspace(0.0, 300.0, torque.size)
        runs.append(ta.CalibrationRun(theta, theta, 360.0, torque=torque, label=f"run {k}"))
    return join_runs(runs)


def between(*corners: float) -> Array:
    """A torque that goes from corner to corner in steps of about 0.1 Nm, the corners among them."""
    parts = [
        np.linspace(a, b, 2 + int(abs(b - a) / 0.1))[1:] for a, b in itertools.pairwise(corners)
    ]
    return np.concatenate([[corners[0]], *parts])


def stepwise(torque: Array, span: float) -> list[float]:
    """From reading to reading by ``z = σ - (σ - z₀) e^(-|Δτ|/T)``: the loop's own law."""
    state = [0.0]
    for step in np.diff(torque).tolist():
        sign = float(np.sign(step))
        state.append(sign - (sign - state[-1]) * float(np.exp(-abs(step) / span)))
    return state


@pytest.mark.parametrize("span", [0.05, 1.0, 30.0])
def test_it_is_the_law_from_reading_to_reading_and_begins_anew_in_every_run(span: float) -> None:
    # At rest first, then turned often; one way alone; not at all; negative torques.
    torques = (
        np.concatenate([np.full(4, 1.5), between(1.5, 6.0, -2.0, 3.0, 2.0, 7.0, -7.0)]),
        between(-1.0, 5.0),
        np.full(3, 4.0),
        between(-6.0, -2.0, -5.0),
    )
    wanted = np.concatenate([stepwise(torque, span) for torque in torques])
    found = TorqueHysteresis.loop(under(*torques), span)
    np.testing.assert_allclose(found, wanted, atol=1e-12)
    # Of a torque the other way round it is the same loop the other way round.
    mirrored = TorqueHysteresis.loop(under(*(-torque for torque in torques)), span)
    np.testing.assert_allclose(mirrored, -found, atol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("span", [0.5, 4.0])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_torque_has_turned_where_it_came_back_by_more_than_its_noise(
    share: float, span: float, sign: float
) -> None:
    back = share * TURNED * 10.0
    torque = between(0.0, 5.0, 5.0 - back, 10.0, 10.0 - back, 0.0)
    plain = between(0.0, 5.0)
    found = TorqueHysteresis.loop(under(sign * torque), span) * sign
    if share > 1.0:
        np.testing.assert_allclose(found, stepwise(torque, span), atol=1e-12)
        return
    # On the way up nothing but the torque counts; the branch down begins where it was highest.
    top = int(np.argmax(torque))
    np.testing.assert_allclose(found[:top], 1.0 - np.exp(-torque[:top] / span), atol=1e-12)
    highest = 1.0 - np.exp(-10.0 / span)
    down = -1.0 + (1.0 + highest) * np.exp(-(10.0 - torque[top:]) / span)
    np.testing.assert_allclose(found[top:], down, atol=1e-12)
    assert found[plain.size - 1] == pytest.approx(1.0 - np.exp(-5.0 / span))


def test_the_size_of_its_noise_is_that_of_all_runs() -> None:
    """A run of little torque beside one of much has not turned."""
    little = between(0.0, 0.5, 0.0)
    alone = TorqueHysteresis.loop(under(little), 0.2)
    np.testing.assert_allclose(alone, stepwise(little, 0.2), atol=1e-12)
    beside = TorqueHysteresis.loop(under(little, between(0.0, 10.0)), 0.2)[: little.size]
    assert not beside.any()
