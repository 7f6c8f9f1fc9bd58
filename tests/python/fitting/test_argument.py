"""The angle the error is a function of: asked for, found, the same in selection and fit."""

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError

#: The pattern in degrees: order, amplitude, phase.
PATTERN = ((1, 0.4, 20.0), (3, 0.2, 100.0), (4, 0.3, 250.0))
NOISE = 0.05
#: Held-out scatter of runs with an arbitrary zero, against that of the plain runs.
NO_WORSE = 1.03


def pattern(x, lines=PATTERN):
    return sum(a * np.sin(np.radians(k * x + p)) for k, a, p in lines)


def runs_with_zeros(seed, reference_zero, indicated_zero, count=4, n=500):
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(count):
        theta = np.sort(rng.uniform(0.0, 360.0, n))
        said = theta + pattern(theta) + NOISE * rng.normal(size=n)
        runs.append(
            ta.CalibrationRun(
                theta + reference_zero * rng.uniform(),
                said + indicated_zero * rng.uniform(),
                period=360.0,
                label=f"r{i}",
            )
        )
    return runs


def left_on(model, run):
    error = np.asarray(model.correct(run.indicated)) - run.reference
    turns = np.exp(1j * np.radians(error))
    return np.degrees(np.angle(turns / turns.mean())).std()


def held_out(runs):
    others = [[r for j, r in enumerate(runs) if j != i] for i in range(len(runs))]
    left = [left_on(ta.fit(o).model, run) for o, run in zip(others, runs, strict=True)]
    return float(np.sqrt(np.mean(np.square(left))))


@pytest.mark.parametrize("seed", range(2))
def test_an_arbitrary_zero_of_the_reference_in_every_run_does_no_harm(seed):
    moved, plain = runs_with_zeros(seed, 360.0, 0.0), runs_with_zeros(seed, 0.0, 0.0)
    result = ta.fit(moved)
    assert result.model.argument == "indicated" == result.selection.argument
    assert {1, 3, 4} <= set(result.orders)
    assert any("zero of the reference changes from run to run" in note for note in result.notes)
    assert held_out(moved) <= NO_WORSE * held_out(plain)
    # Orders that were asked for are fitted in the same angle.
    asked = ta.fit(moved, orders=[1, 3, 4])
    assert asked.model.argument == "indicated"
    assert asked.amplitudes == pytest.approx([0.4, 0.2, 0.3], abs=0.02)


@pytest.mark.parametrize("indicated_zero", [0.0, 0.5, 360.0])
def test_a_new_zero_of_the_encoder_leaves_the_true_angle(indicated_zero):
    result = ta.fit(runs_with_zeros(1, 0.0, indicated_zero))
    assert result.model.argument == "reference"
    assert set(result.orders) == {1, 3, 4}


def test_what_is_asked_for_is_kept():
    runs = runs_with_zeros(2, 360.0, 0.0)
    assert ta.fit(runs, orders=[1], argument="reference").model.argument == "reference"
    assert ta.select_orders(runs, argument="indicated").argument == "indicated"
    with pytest.raises(ArgumentError, match="argument must be one of auto"):
        ta.select_orders(runs, argument="true")


def test_selection_and_fit_use_the_same_angle():
    """A steep error is one order at the indicated angle and many at the true one."""
    rng = np.random.default_rng(3)
    said = np.sort(rng.uniform(0.0, 360.0, 2000))
    error = 6.0 * np.sin(np.radians(3 * said)) + 0.01 * rng.normal(size=said.size)
    run = ta.CalibrationRun(said - error, said, period=360.0)
    assert ta.fit(run, argument="indicated").orders == (3,)
    assert ta.select_orders(run, argument="indicated").orders == (3,)
    assert {3, 6} <= set(ta.fit(run).orders)


def test_measured_runs_with_an_arbitrary_zero(data_dir):
    runs = ta.read_runs(data_dir / "rm44_repeat.csv")
    rng = np.random.default_rng(4)
    moved = [ta.CalibrationRun(r.reference + rng.uniform(0, 360), r.indicated, 360.0) for r in runs]
    assert ta.fit(moved).model.argument == "indicated"
    assert held_out(moved[:4]) <= NO_WORSE * held_out(runs[:4])


def test_the_command_takes_the_angle(tmp_path, capsys):
    lines = ["run,reference_deg,indicated_deg"]
    for run in runs_with_zeros(5, 360.0, 0.0):
        pairs = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        lines += [f"{run.label},{x!r},{y!r}" for x, y in pairs]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(lines) + "\n")
    assert main(["orders", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["argument"] == "indicated"
    assert {1, 3, 4} <= {row["order"] for row in found["orders"] if row["retained"]}
    assert main(["orders", str(path), "--argument", "reference", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["argument"] == "reference"
