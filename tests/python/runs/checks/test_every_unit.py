"""A check of runs says the same of them in every unit, mirrored, and however runs are ordered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta

UNITS = (1.0, 2.0 * np.pi, 4096.0)


def runs_of(period: float = 360.0, sign: float = 1.0) -> list[ta.CalibrationRun]:
    """Two runs there and back, at two speeds and loads, remounted, one of them with a jump."""
    scale, found = sign * period / 360.0, []
    for k, speed in enumerate((10.0, 40.0)):
        rng = np.random.default_rng(68_000 + k)
        time = np.linspace(0.0, 1000.0 / speed, 400)
        theta = 500.0 - np.abs(500.0 - speed * time)
        error = 0.1 * np.sin(np.radians(theta)) + 1e-3 * rng.normal(size=400)
        if k:
            error[230:] += 5.0
        found.append(
            ta.CalibrationRun(
                scale * np.mod(theta, 360.0), scale * np.mod(theta + error, 360.0), period,
                time=time, label=f"r{k}", velocity=scale * speed * np.sign(500.0 - speed * time),
                temperature=np.linspace(20.0, 22.0 + k, 400), torque=np.full(400, 3.0 * k),
                mount=np.full(400, scale * 90.0 * k),
            )
        )  # fmt: skip
    return found


def plain(value: object) -> object:
    """Numbers to eight digits, in place."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return float(f"{value:.8g}") + 0.0 if isinstance(value, float) else value


@pytest.mark.parametrize("period", UNITS)
def test_every_unit_gives_one_check(period: float) -> None:
    assert plain(ta.check(runs_of(period)).to_dict()) == plain(ta.check(runs_of()).to_dict())


def test_what_was_moved_and_measured_is_told() -> None:
    told = ta.check(runs_of()).to_dict()
    assert (told["readings"], told["runs"]) == (800, 2)
    assert told["turns"] == pytest.approx(500.0 / 360.0, rel=0.01)
    assert (told["speeds"], told["loads"], told["mounts"]) == (
        [10.0, 40.0],
        [0.0, 3.0],
        [0.0, 90.0],
    )
    assert told["temperatures"] == [21.25]
    # Without a velocity the speed is the way gone over the time, there and back.
    silent = [replace(run, velocity=None) for run in runs_of()]
    assert ta.check(silent).extent.speeds == pytest.approx((10.0, 40.0), rel=0.01)
    # The run without a jump: beyond a turn as well.
    assert ta.check(runs_of()[:1]).ratio == pytest.approx(1.0, abs=5e-4)
    mirrored = ta.check(runs_of(sign=-1.0)).to_dict()
    assert mirrored["ratio"] == pytest.approx(told["ratio"])
    assert mirrored["usable"] == told["usable"]
    assert [f["fault"] for f in mirrored["data_faults"]] == [
        f["fault"] for f in told["data_faults"]
    ]
    backwards = ta.check(runs_of()[::-1]).to_dict()
    assert backwards["ratio"] == pytest.approx(told["ratio"])
    assert sorted(f["fault"] for f in backwards["data_faults"]) == sorted(
        f["fault"] for f in told["data_faults"]
    )
