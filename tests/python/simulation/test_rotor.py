"""The shaft as an inertia, against scipy's integrator of the equation in the module's head."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from trueangle.errors import ArgumentError
from trueangle.joint.pattern import Pattern
from trueangle.simulation.rotor import ARCSEC_PER_RAD, RotorDrive, rotor_angle

TIME = np.sort(np.random.default_rng(3).uniform(0.0, 4.0, 60))
NOTHING = RotorDrive(0.3, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
#: Orders, cosines and sines in arcsec of what the loop sees.
LINES = ((1.0, 900.0, -400.0), (4.0, 0.0, 300.0))

CASES = {
    "nothing": NOTHING,
    "friction": NOTHING._replace(decay=0.7),
    "cogging": NOTHING._replace(cogging=1.5, order=3.0, phase=0.8),
    "imbalance": NOTHING._replace(imbalance=-0.9, low=1.1),
    "backwards": NOTHING._replace(speed=-2.0, decay=0.2, cogging=0.5, imbalance=0.5),
    "a loop": NOTHING._replace(band=6.0),
    "a loop that slows down": NOTHING._replace(band=6.0, decay=0.3, cogging=2.0, order=2.0),
}


def pattern_of(lines):
    orders, cosine, sine = (np.array(column) for column in zip(*lines, strict=True))
    return Pattern(orders, cosine, sine)


@pytest.mark.parametrize("case", CASES)
def test_it_moves_as_its_equation_says(case):
    d = CASES[case]
    waves = [(m, a / ARCSEC_PER_RAD, b / ARCSEC_PER_RAD) for m, a, b in LINES]

    def seen(x):
        return sum(a * np.cos(m * x) + b * np.sin(m * x) for m, a, b in waves)

    def slope(x):
        return sum(m * (b * np.cos(m * x) - a * np.sin(m * x)) for m, a, b in waves)

    def asked(t, x, v):
        """What the loop asks of the motor: the speed and the place of what it reads."""
        speed = d.speed * np.exp(-d.decay * t)
        way = d.speed * t if not d.decay else d.speed * (1.0 - np.exp(-d.decay * t)) / d.decay
        moved = x + seen(x) - d.place - seen(d.place)
        lag = d.band * (speed - v * (1.0 + slope(x))) + d.band**2 / 4.0 * (way - moved)
        return lag - d.decay * speed

    def push(t, state):
        x, v = state
        a = d.cogging * np.sin(d.order * x + d.phase) + d.imbalance * np.sin(x + d.low)
        return v, a + (asked(t, x, v) if d.band else -d.decay * v)

    exact = solve_ivp(push, (0.0, 4.0), (d.place, d.speed), t_eval=TIME, rtol=1e-11, atol=1e-12)
    found = rotor_angle(d, TIME, pattern_of(LINES), np.random.default_rng(0))
    x, v = exact.y
    # The module's rule is right to some 1e-6 of what a term moves.
    np.testing.assert_allclose(found.angle, np.degrees(x), rtol=0.0, atol=2e-3)
    np.testing.assert_allclose(found.speed, np.degrees(v), rtol=0.0, atol=5e-3)
    wanted = np.degrees(asked(TIME, x, v)) if d.band else np.zeros(TIME.size)
    np.testing.assert_allclose(found.driven, wanted, rtol=0.0, atol=5e-2)


def test_a_shaft_that_runs_away_is_refused():
    away = NOTHING._replace(speed=0.0, imbalance=1e12, low=1.0)
    with pytest.raises(ArgumentError, match="runs away: make cogging, imbalance and loop weaker"):
        rotor_angle(away, TIME, pattern_of(LINES), np.random.default_rng(0))


def test_a_friction_that_wanders_pushes_by_its_size_and_forgets():
    """Each reading's own, until the next; its correlation falls by e in its memory."""
    time = np.arange(40_000) * 0.05
    drive = NOTHING._replace(friction_deg_s2=3.0, memory_s=0.5)
    from trueangle.simulation.rotor import _drift

    pushed = _drift(drive, time, np.random.default_rng(7))
    assert np.std(pushed) == pytest.approx(3.0, rel=0.05)
    assert np.mean(pushed[10:] * pushed[:-10]) / 9.0 == pytest.approx(np.exp(-1.0), abs=0.03)
