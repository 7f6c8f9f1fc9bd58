"""The round for every family of effects: found, written into the simulator, and nothing is beyond.

A second MuJoCo with an encoder and a ripple of its own stands for the real joint: the effect is
hidden in its log, by code that is none of the package's.
"""

from __future__ import annotations

import numpy as np
import pytest

from .rig import (
    ARCSEC,
    INCLUDE,
    NOISE,
    TORQUE_NOISE,
    by_fmpy,
    confirmed,
    diagnosed,
    measured,
    motions,
    written,
)

SEED = 20261124


def periodic(angle, velocity, torque):
    return 8.0 * np.sin(2.0 * angle + 0.5)


def play(angle, velocity, torque):
    return 6.0 * np.sign(velocity)


def compliance(angle, velocity, torque):
    return 0.6 * torque


def latency(angle, velocity, torque):
    return -4e-5 * velocity / ARCSEC


def friction(angle, velocity, torque):
    """A spring that winds up over 4 degrees after each reversal, relaxed at first."""
    z, errors = 0.0, []
    for step, way in zip(np.diff(angle, prepend=angle[0]), np.sign(velocity), strict=True):
        z = way - (way - z) * np.exp(-abs(step) / np.radians(4.0))
        errors.append(8.0 * z)
    return np.array(errors)


def nothing(angle, velocity, torque):
    return 0.0


#: Of each family: the error in arcsec, 1 to 3 standard deviations of the noise; its cause and
#: parameters.
FAMILIES = {
    "periodic": (periodic, "missing_order", {"amplitude_arcsec": 8.0}),
    "play": (play, "backlash", {"half_width_arcsec": 6.0}),
    "compliance": (compliance, "torsional_compliance", {"arcsec_per_Nm": 0.6}),
    "latency": (latency, "latency", {"delay_s": 4e-5}),
    "friction": (friction, "presliding_hysteresis", {"amplitude_arcsec": 8.0}),
}


def within_two(told, parameters):
    """Whether parameters are within two of their standard errors."""
    for name, value in parameters.items():
        got = told[name]
        print(f"{name}: {got['value']} +- {got['std']}")
        assert abs(got["value"] - value) < 2.0 * got["std"]


def nothing_beyond(found):
    """No cause, neither in the angle nor in the torque of the drive."""
    print(confirmed(found), found["unexplained"]["found"], found["torque"])
    assert confirmed(found) == {}
    assert confirmed(found["torque"], "effect") == {}
    assert found["simulation"]["rms_arcsec"] == pytest.approx(NOISE, rel=0.1)
    assert found["torque"]["rms_Nm"] == pytest.approx(TORQUE_NOISE, rel=0.1)


@pytest.mark.parametrize("into", ["mujoco", "fmu"])
@pytest.mark.parametrize("family", list(FAMILIES))
def test_the_round_closes(family, into, tmp_path, capsys):
    error, cause, parameters = FAMILIES[family]
    ideal = list(motions(tmp_path))
    real = written(tmp_path / "real.csv", measured(ideal, error, SEED))
    sensor = tmp_path / f"sensor.{'fmu' if into == 'fmu' else 'xml'}"
    more = ("--extend-into", str(sensor), *(() if into == "fmu" else ("--into-joint", "elbow")))
    log = written(tmp_path / "model.csv", ideal)
    found = diagnosed(capsys, real, "--simulated", log, *more)
    told = confirmed(found)
    assert list(told) == [cause], told
    within_two(told[cause], parameters)
    assert confirmed(found["torque"], "effect") == {}
    if into == "mujoco":
        again = motions(tmp_path, INCLUDE, noise_std=0.0)
    else:
        again = by_fmpy(sensor, ideal, noise_std=0.0)
    again = written(tmp_path / "again.csv", again)
    nothing_beyond(diagnosed(capsys, real, "--simulated", again))


#: Torque ripple of the real joint, Nm, of 1 to 3 standard deviations of the noise: slow against the
#: drive, or what it accelerates is in the torque as well.
RIPPLES = {
    "one wave": ((4, 0.1, 0.5),),
    "two waves": ((2, 0.12, -1.0), (5, 0.08, 2.0)),
}


@pytest.mark.parametrize("which", list(RIPPLES))
def test_the_round_closes_for_a_friction_ripple(which, tmp_path, capsys):
    waves = RIPPLES[which]

    def ripple(angle):
        return sum(size * np.sin(order * angle + phase) for order, size, phase in waves)

    ideal = motions(tmp_path)
    log = written(tmp_path / "model.csv", ideal)
    real = list(motions(tmp_path, ripple=ripple))
    real = written(tmp_path / "real.csv", measured(real, nothing, SEED))
    sensor = tmp_path / "sensor.xml"
    more = ("--extend-into", str(sensor), "--into-joint", "elbow")
    found = diagnosed(capsys, real, "--simulated", log, *more)
    assert confirmed(found) == {}
    told = {
        f["parameters"]["order"]["value"]: f["parameters"]
        for f in found["torque"]["findings"]
        if f["effect"] == "torque_ripple" and f["status"] == "confirmed"
    }
    assert sorted(told) == [order for order, _, _ in waves]
    assert len(found["torque"]["findings"]) == len(waves)
    for order, size, phase in waves:
        degrees = np.degrees(phase) % 360.0
        within_two(told[order], {"torque_Nm": size, "phase_deg": degrees})
    again = written(tmp_path / "again.csv", motions(tmp_path, INCLUDE, noise_std=0.0))
    nothing_beyond(diagnosed(capsys, real, "--simulated", again))


def test_friction_and_damping_that_the_drive_feels(tmp_path, capsys):
    """They have a place at the joint itself: their sizes are told."""
    ideal = list(motions(tmp_path))
    log = written(tmp_path / "model.csv", ideal)
    real = [
        (time, angle, said, velocity, torque + 0.1 * np.sign(velocity) + 0.05 * velocity)
        for time, angle, said, velocity, torque in ideal
    ]
    real = written(tmp_path / "real.csv", measured(real, nothing, SEED))
    found = diagnosed(capsys, real, "--simulated", log)
    told = confirmed(found["torque"], "effect")
    assert set(told) == {"dry_friction", "damping"}
    within_two(told["dry_friction"], {"torque_Nm": 0.1})
    within_two(told["damping"], {"Nm_s_per_rad": 0.05})
