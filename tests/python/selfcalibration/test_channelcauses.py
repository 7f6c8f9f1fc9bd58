"""Causes of the error of two channels: by the field of a dipole, and on a stage that moved them."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

#: Distance from the magnet's middle to the sensor.
DISTANCE = 2.0
PHASE = 2.0 * math.pi * np.arange(720) / 720


def field(sensor=0.0, magnet=0.0, distance=DISTANCE, noise=2e-4, seed=0, tilt=0.3):
    """In-plane field of a dipole that turns; the sensor and the magnet off the axis (complex)."""
    m = np.exp(1j * PHASE)
    r = sensor - magnet * m
    rho = np.hypot(distance, np.abs(r))
    b = -m / rho**3 + 1.5 * (m * np.abs(r) ** 2 + np.conj(m) * r**2) / rho**5
    z = -b * DISTANCE**3 * np.exp(1j * tilt)
    rng = np.random.default_rng(seed)
    z = z + noise * (rng.normal(size=z.size) + 1j * rng.normal(size=z.size))
    return {"sine": z.imag.copy(), "cosine": z.real.copy()}


def with_reference(log):
    return {**log, "reference_deg": np.degrees(PHASE)}


def test_a_magnet_off_its_centre_is_named_and_sized_by_a_reference():
    log = field(sensor=0.15 + 0.1j, magnet=0.3)
    found = ta.diagnose_channels(with_reference(log))
    assert found.causes[0].cause == "magnet_eccentricity"
    assert not found.causes[0].not_distinguished_from
    # 0.3 mm at 2 mm; the dipole's field is expanded to second order.
    assert "(0.3 mm at 2 mm)" in found.sentence
    alone = ta.diagnose_channels(log)
    assert alone.causes[0].cause == "channel_offset"
    assert alone.causes[0].not_distinguished_from == ("magnet_eccentricity",)
    assert "or the magnet is off centre" in alone.sentence


def test_a_sensor_off_the_axis_is_named_and_sized():
    for log in (field(sensor=0.4j), with_reference(field(sensor=0.4))):
        found = ta.diagnose_channels(log)
        assert found.causes[0].not_distinguished_from == ("sensor_eccentricity",)
        assert "(0.4 mm at 2 mm)" in found.sentence
        assert found.causes[0].orders == (2.0,)


def test_an_offset_of_the_electronics_is_no_magnet_with_a_reference():
    log = field(sensor=0.1)
    log["sine"] += 0.02
    found = ta.diagnose_channels(with_reference(log))
    cause = found.causes[0]
    assert cause.cause == "channel_offset"
    assert cause.size_relative == pytest.approx(0.02, abs=2e-3)
    assert cause.error_deg == pytest.approx(math.degrees(0.02), rel=0.1)
    assert "magnet_eccentricity" not in {c.cause for c in found.causes}


@pytest.mark.parametrize(
    ("moved", "cause"),
    [
        ({"sensor": 0.35}, "sensor_eccentricity"),
        ({"sensor": 0.1, "magnet": 0.35}, "magnet_eccentricity"),
        ({"sensor": 0.1, "distance": 2.3}, "gap"),
    ],
)
@pytest.mark.parametrize("known", [True, False])
def test_what_moved_between_two_runs_is_named(moved, cause, known):
    first, second = field(sensor=0.1), field(**moved, seed=1)
    both = {name: np.concatenate([first[name], second[name]]) for name in first}
    both["run"] = np.repeat(["as built", "moved"], PHASE.size)
    if known:
        both["reference_deg"] = np.tile(np.degrees(PHASE), 2)
    (change,) = ta.diagnose_channels(both).changes
    assert change.cause == cause
    assert change.run == "moved"


def test_a_sound_sensor_has_no_cause_and_repeats_no_change():
    first, second = field(), field(seed=1)
    both = {name: np.concatenate([first[name], second[name]]) for name in first}
    found = ta.diagnose_channels({**both, "run": np.repeat(["a", "b"], PHASE.size)})
    assert found.causes == ()
    assert found.changes == ()
    assert found.sentence == "no error of the channels is significant"


def test_drift_with_temperature_and_between_periods():
    temperature = np.repeat(np.linspace(20.0, 60.0, 10), PHASE.size)
    logs = [field(seed=seed) for seed in range(10)]
    log = {name: np.concatenate([part[name] for part in logs]) for name in logs[0]}
    drifting = {**log, "sine": log["sine"] + 1e-3 * (temperature - 20.0)}
    found = ta.diagnose_channels({**drifting, "temperature_C": temperature})
    (slope,) = found.drift.values()
    assert set(slope) == {"offset_sine"}
    assert abs(slope["offset_sine"]["value"] - 1e-3) < 4.0 * slope["offset_sine"]["std"]
    assert ta.diagnose_channels({**log, "temperature_C": temperature}).drift == {}
    period = np.arange(temperature.size) // PHASE.size % 5
    uneven = {**log, "cosine": log["cosine"] * (1.0 + 0.01 * (period == 2))}
    found = ta.diagnose_channels(uneven, periods_per_turn=5)
    (spread,) = found.drift.values()
    assert spread["amplitude"]["value"] == pytest.approx(0.01 / math.sqrt(5), rel=0.2)
    assert ta.diagnose_channels(log, periods_per_turn=5).drift == {}


def resting(*channels):
    """Most readings at one place."""
    return [np.concatenate([channel, np.full(9000, channel[5])]) for channel in channels]


def written(tmp_path, log):
    file = tmp_path / "adc.csv"
    rows = zip(*log.values(), strict=True)
    file.write_text(
        ",".join(log) + "\n" + "".join(",".join(map(repr, map(float, r))) + "\n" for r in rows)
    )
    return str(file)


def test_the_commands_state_the_sentence(tmp_path, capsys):
    log = field(sensor=0.15, magnet=0.3)
    words = "the channels have an offset, or the magnet is off centre by about 0.1"
    for command in (["diagnose"], ["check"], ["selfcal", "-o", str(tmp_path / "m.json")]):
        assert main([*command, written(tmp_path, log)]) == 0
        assert words in " ".join(capsys.readouterr().out.split())
        assert main([*command, written(tmp_path, log), "--json"]) == 0
        plain = json.loads(capsys.readouterr().out)
        assert words in plain.get("diagnosis", plain)["sentence"]
    assert main(["diagnose", written(tmp_path, with_reference(log))]) == 0
    assert "diagnosis: the magnet is off centre" in capsys.readouterr().out


@pytest.mark.parametrize("known", [True, False])
def test_moved_stages_are_named(data_dir, known):
    """RM44: each run against the first of its stage."""
    wanted = {"xd": "magnet_eccentricity", "zs": "gap"}
    table = np.genfromtxt(
        data_dir / "rm44_channels.csv", delimiter=",", names=True, dtype=None, encoding="utf-8"
    )
    named, count = 0, 0
    for stage in ("xd", "xs", "ys", "zs"):
        rows = table[np.char.startswith(table["run"], stage)]
        log = {name: rows[name] for name in ("run", "sine", "cosine")}
        if known:
            log["reference_deg"] = rows["reference_deg"]
        changes = {change.run: change.cause for change in ta.diagnose_channels(log).changes}
        for run in dict.fromkeys(rows["run"].tolist()):
            if not run.endswith("_000u"):
                count += 1
                named += changes.get(run) == wanted.get(stage, "sensor_eccentricity")
    assert count == 12
    assert named == count


@pytest.mark.parametrize(
    ("change", "fault", "usable"),
    [
        (lambda s, c: (s, np.full_like(c, 7.0)), "dead_channel", False),
        (lambda s, c: (np.full_like(s, 7.0), np.full_like(c, 7.0)), "dead_channel", False),
        (lambda s, c: (c, c * 2.0), "dead_channel", False),
        (lambda s, c: (s[:8], c[:8]), "dead_channel", False),
        (lambda s, c: (c, s), "swapped_channels", True),
        (lambda s, c: (np.minimum(s, 0.8), c), "clipping", True),
        (lambda s, c: (np.rint(2048 + 900 * s), np.rint(2048 + 900 * c)), "no_centre", True),
        (lambda s, c: (s[:360], c[:360]), "partial_arc", True),
        (lambda s, c: (s[:60], c[:60]), "short_arc", False),
        (resting, "resting", True),
    ],
)
def test_each_bad_input_has_one_clear_line(tmp_path, capsys, change, fault, usable):
    log = field(sensor=0.2, noise=2e-3)
    sine, cosine = change(log["sine"], log["cosine"])
    table = {"sine": sine, "cosine": cosine}
    if fault == "swapped_channels":
        table["indicated_deg"] = np.degrees(PHASE)
    found = ta.check_channels(table)
    assert [entry.fault for entry in found.data_faults] == [fault]
    assert found.usable == usable
    (entry,) = found.data_faults
    assert entry.unusable != usable
    assert all(entry[-2:])
    assert "\n" not in str(entry)
    if fault != "swapped_channels":
        assert main(["check", written(tmp_path, table)]) == (0 if usable else 1)
        assert capsys.readouterr().out.startswith(f"{fault}: ")
