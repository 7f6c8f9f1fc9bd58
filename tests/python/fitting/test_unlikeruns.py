"""What runs of another joint are called: by their label, their file, or their number from one."""

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.unlikeruns import run_names, unlike_runs_sentence


def run(label, file=None):
    return SimpleNamespace(label=label, source=file and SimpleNamespace(file=file))


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ([(None,), (None,), (None,)], ["1", "2", "3"]),
        ([("up",), (None,), ("down",)], ["up", "2", "down"]),
        ([("up",), ("up",)], ["up", "up"]),
        ([(None, "a.csv"), (None, "a.csv")], ["1", "2"]),
        ([(None, "a.csv"), (None, "b.csv")], ["a.csv", "b.csv"]),
        # Labels that are alike say their file; those that are not need none.
        ([("up", "a.csv"), ("up", "b.csv"), ("down", "b.csv")],
         ["a.csv:up", "b.csv:up", "b.csv:down"]),
        ([("up", "a.csv"), ("down", "b.csv")], ["up", "down"]),
        ([("up", "a.csv"), (None, "b.csv")], ["up", "b.csv"]),
    ],
)  # fmt: skip
def test_what_runs_are_called(runs, names):
    assert run_names([run(*each) for each in runs]) == names


def test_eight_are_named_and_the_others_counted():
    told = [unlike_runs_sentence([*"abcdefghij"[:k]], 12) for k in (1, 2, 8, 9, 10)]
    assert [t.partition("coefficients of ")[2].partition(" (of 12) differ")[0] for t in told] == [
        "run a",
        "runs a, b",
        "runs a, b, c, d, e, f, g, h",
        "runs a, b, c, d, e, f, g, h and 1 more",
        "runs a, b, c, d, e, f, g, h and 2 more",
    ]


@pytest.mark.parametrize("odd", range(4))
def test_the_run_of_another_joint_is_told_by_its_number(odd):
    rng = np.random.default_rng(500 + odd)
    runs = []
    for k in range(4):
        x = np.sort(rng.uniform(0.0, 360.0, 90))
        phase = np.pi if k == odd else 0.0
        error = 0.05 * np.cos(2.0 * np.radians(x) + phase) + 0.0005 * rng.normal(size=90)
        runs.append(ta.CalibrationRun(x, x + error, period=360.0))
    with pytest.warns(UserWarning, match=rf"coefficients of run {odd + 1} \(of 4\)") as told:
        ta.fit(runs, orders=[1, 2])
    assert len([w for w in told if "different patterns" in str(w.message)]) == 1
