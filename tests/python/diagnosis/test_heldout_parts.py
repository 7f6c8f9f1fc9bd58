"""What is held out of a whole diagnosis: all runs, in three parts, each corrected by the others."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import heldout
from trueangle.errors import ArgumentError, TrueAngleError
from trueangle.simulation import Simulation

SEED = 77_000


def runs_of(count: int) -> list[ta.CalibrationRun]:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    runs = []
    for k in range(count):
        x = np.sort(rng.uniform(0.0, 360.0, 150))
        error = 0.2 * np.sin(np.radians(x + 30.0)) + 0.01 * rng.normal(size=x.size)
        label = "" if k == 1 else f"r{k}"
        runs.append(ta.CalibrationRun(x, x + error, 360.0, label=label))
    return runs


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_a_diagnosis_takes_long_and_is_made_three_times_at_most(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = runs_of(count)
    fit = ta.fit(runs, orders=[1])
    asked: list[list[int]] = []

    def diagnose(train: list[ta.CalibrationRun], sim: Simulation, **options: Any) -> object:
        asked.append([next(i for i, run in enumerate(runs) if run is one) for one in train])
        if 0 not in asked[-1] and count == 7:
            raise TrueAngleError("nothing to be seen")
        return SimpleNamespace(correction=lambda model, given: ta.fit(given, orders=[1]).model)

    monkeypatch.setattr(heldout, "diagnose", diagnose)
    held = heldout.hold_out_extended(fit, Simulation())
    assert len(asked) == min(count, 3)
    # Every run is left out once.
    left = [i for part in asked for i in range(count) if i not in part]
    assert sorted(left) == [*range(count)]
    without = [i for part in asked if 0 not in part for i in range(count) if i not in part]
    names = [run.label or str(i + 1) for i, run in enumerate(runs)]
    told = dict(held.left_in)
    if count == 7:
        assert told == {names[i]: "nothing to be seen" for i in without}
    else:
        assert not told
    assert [run.label for run in held.runs] == [name for name in names if name not in told]
    for run in held.runs:
        before = runs[names.index(run.label)]
        error = 3600.0 * (before.indicated - before.reference)  # arcsec
        np.testing.assert_allclose(run.before, error - error.mean(), atol=1e-3)
        assert run.after.std() < 0.2 * run.before.std()


def test_where_no_run_can_be_held_out_it_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def diagnose(*args: object, **options: object) -> object:
        raise TrueAngleError("nothing to be seen")

    monkeypatch.setattr(heldout, "diagnose", diagnose)
    with pytest.raises(ArgumentError, match="no run can be held out: nothing to be seen"):
        heldout.hold_out_extended(ta.fit(runs_of(3), orders=[1]), Simulation())
    with pytest.raises(ArgumentError, match="one run only"):
        heldout.hold_out_extended(ta.fit(runs_of(1), orders=[1]), Simulation())
