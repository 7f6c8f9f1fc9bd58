"""Limits of a rig as readings show them: loads, currents and where the joint was."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.joint.signals import join_runs
from trueangle.planning.limits import Limits, load_limits
from trueangle.planning.planner import LEAST, NEAR, RunSearch
from trueangle.planning.scales import MOST_READINGS, _thinned
from trueangle.planning.worth import Worth
from trueangle.simulation import RunDesign

THETA = np.arange(0.0, 360.0, 2.0)


def run(mean=0.0, weight=0.0, start=0.0, span=360.0, **more):
    """Readings under a constant load and a weight on an arm."""
    theta = start + THETA * span / 360.0
    torque = mean + weight * np.sin(np.radians(theta * 360.0 / span))
    return ta.CalibrationRun(theta, theta, 360.0, torque=torque, **more)


@pytest.mark.parametrize("weight", [0.0, 7.5])
def test_a_load_is_the_mean_of_a_run_and_a_weight_half_its_swing(weight):
    found = Limits.of_runs([run(2.0, weight), run(9.0, weight)])
    assert found.gravity_Nm == pytest.approx(weight, abs=5e-3)
    assert found.torque_Nm == pytest.approx((2.0, 9.0), abs=5e-3)
    alike = Limits.of_runs([run(2.0, 7.5), run(2.5, 7.5)])  # within a fifth of the swing
    assert alike.torque_Nm == pytest.approx((2.25, 2.25), abs=5e-3)


@pytest.mark.parametrize(
    ("starts", "span", "arc"),
    [
        ((0.0,), 360.0, (0.0, 360.0)),
        ((-30.0, 10.0), 90.0, (-30.0, 99.5)),
        ((20.0, 375.0), 60.0, (15.0, 79.7)),
    ],
)
def test_the_arc_is_where_the_runs_went_whole_turns_taken_off(starts, span, arc):
    found = Limits.of_runs([run(start=start, span=span) for start in starts])
    assert found.arc_deg == pytest.approx(arc, abs=0.06)


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi])
def test_temperatures_currents_and_mounts_are_those_seen(period):
    turn = THETA / 360.0 * period
    runs = [
        ta.CalibrationRun(turn, turn, period, temperature=20.0 + 5.0 * k, mount=k * period / 8.0,
                          signals={"current": -1.0 + 3.0 * k})
        for k in range(2)
    ]  # fmt: skip
    found = Limits.of_runs(runs)
    assert (found.temperature_C, found.current_A) == ((20.0, 25.0), (-1.0, 2.0))
    assert found.mount_deg == pytest.approx((0.0, 45.0))
    assert found.samples == 360


def test_whole_numbers_of_thousands_of_digits_are_told(tmp_path):
    path = tmp_path / "limits.toml"
    path.write_text(f"[limits]\nsamples = {'9' * 5000}\n")
    with pytest.raises(
        FileError, match=r"limits\.toml: holds a number, date or list that cannot be read$"
    ):
        load_limits(path)


GOAL = (1, 0, False, 0)


def fewest(samples: list[int], needed: int) -> tuple[int, list[int], Worth]:
    """How often it was asked, and the readings of each run, where so many in all serve."""
    asked = []

    def weighed(designs: list[RunDesign], *_: Any) -> Worth:
        asked.append(sum(design.samples for design in designs))
        return Worth(int(asked[-1] >= needed), 0, False, 0, 0, 0, float(asked[-1]))

    scales: Any = SimpleNamespace(over=False, weighed=weighed)
    limits: Any = None
    designs = [RunDesign(samples=n) for n in samples]
    all_of_them = weighed(designs)
    found, worth = RunSearch(scales, limits)._fewest(designs, all_of_them, GOAL, None)
    assert asked.count(sum(design.samples for design in found)) >= 1
    return len(asked), [design.samples for design in found], worth


@pytest.mark.parametrize("samples", [[2000], [400, 400, 400], [1000, 300]])
@pytest.mark.parametrize("share", [0.99, 0.6, 0.21, 0.07])
def test_a_tenth_fewer_would_not_serve(samples: list[int], share: float) -> None:
    needed = round(share * sum(samples))
    count, found, worth = fewest(samples, needed)
    assert needed <= sum(found) <= NEAR * needed + len(samples)
    assert worth.seconds == sum(found)
    # Halving of a logarithm.
    assert count < 12


def test_a_run_has_a_least_number_of_readings() -> None:
    assert fewest([2000, 500], 1)[1] == [LEAST, LEAST]
    # One that has fewer keeps them.
    assert fewest([2000, 10], 1)[1] == [LEAST, 10]


@pytest.mark.parametrize("count", [1999, 2000, 2001, 4000, 4001, 9000])
def test_of_many_earlier_readings_as_many_as_can_be_are_looked_at(count):
    """Every second, every third and so on, from the first one on."""
    angle = np.linspace(0.0, 700.0, count)
    signals = join_runs([ta.CalibrationRun(angle, angle, 360.0)])
    found = _thinned(signals).theta
    step = next(k for k in range(1, 10) if -(-count // k) <= MOST_READINGS)
    np.testing.assert_array_equal(found, signals.theta[::step])
