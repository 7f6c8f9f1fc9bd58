"""Plans without a reference: closed forms, published optima, what is there against the best."""

import json
import math

import numpy as np
import pytest

from trueangle import cli
from trueangle.errors import ArgumentError
from trueangle.planning.selfplan import angle_factors, best_angles, plan_self, speed_factor


@pytest.mark.parametrize(
    ("count", "highest", "variance"), [(3, 8, 1.72), (3, 16, 2.58), (4, 8, 1.24)]
)
def test_best_angles_reach_the_known_optima(count, highest, variance):
    angles = best_angles(count, range(1, highest + 1))
    worst = float(angle_factors(angles, range(1, highest + 1)).max()) ** 2
    assert worst < 1.03 * variance


def test_two_angles_have_a_closed_form():
    assert best_angles(2, range(1, 17)) == (0.0, round(360.0 / 17.0, 4))
    worst = angle_factors(best_angles(2, range(1, 9)), range(1, 9)).max()
    assert worst**2 == pytest.approx(1.0 / np.sin(np.pi / 9.0) ** 2, rel=1e-6)


def test_factors_are_those_of_a_least_squares_fit():
    # Differences of heads at a thousand angles: the information of one order.
    angles, order = np.radians([0.0, 35.0, 160.0]), 5
    theta = np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)
    rows = np.stack([np.cos(order * (theta + a)) for a in angles])
    rows -= rows.mean(axis=0)
    factor = np.sqrt(3 * 500.0 / (rows**2).sum())
    assert angle_factors([0.0, 35.0, 160.0], [order])[0] == pytest.approx(factor, rel=1e-9)


@pytest.mark.parametrize(("ratio", "cost"), [(1.1, 18), (1.25, 7.8), (2.0, 2.7), (5.0, 1.5)])
def test_a_small_change_of_speed_is_dear(ratio, cost):
    assert speed_factor(ratio) == pytest.approx(cost, rel=0.03)


def test_the_command_says_how_much_worse_the_present_heads_are(capsys):
    arguments = ["plan", "--self", "heads", "--orders", "1-8", "--angles", "0,120,240", "--json"]
    assert cli.main(arguments) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["given"]["blind_orders"] == [3.0, 6.0]
    assert told["given"]["worse_by"] is None
    assert told["worst_noise_factor"] < 1.33


@pytest.mark.parametrize(("ratio", "standard_error"), [(5.0, 50.0), (5.0, 0.05), (1.5, 0.05)])
def test_a_coast_has_the_turns_and_readings_of_a_speed_that_falls_exponentially(
    ratio, standard_error
):
    """Ten turns at least, and as many readings as both the turns and the error take."""
    start, rate = 4.0, 500.0
    plan = plan_self(
        "spin-down", [1, 2, 3], speed_ratio=ratio, start_speed=start, rate=rate,
        noise=10.0, standard_error=standard_error,
    )  # fmt: skip
    needed = np.ceil(2.0 * (speed_factor(ratio) * 10.0 / standard_error) ** 2)
    time = np.linspace(0.0, plan.seconds, 200_001)
    turns = np.trapezoid(start * ratio ** (-time / plan.seconds), time)
    assert plan.turns == pytest.approx(turns, rel=1e-6)
    assert plan.turns >= 10.0 * (1.0 - 1e-9)
    assert plan.readings == max(needed, np.ceil(plan.seconds * rate))
    # As short as it may be: either its turns or its readings are what they must.
    assert min(plan.turns / 10.0, plan.seconds * rate / needed) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("angles", [[0.0, 40.0, 95.0], [0.0, 10.0, 20.0]])
def test_given_angles_are_worse_by_the_ratio_of_the_worst_factors(angles):
    plan = plan_self("heads", range(1, 9), angles=angles)
    worst = float(angle_factors(angles, range(1, 9)).max())
    assert plan.given["worst_noise_factor"] == pytest.approx(worst)
    assert plan.given["worse_by"] == pytest.approx(worst / plan.worst_noise_factor)
    assert plan.worst_noise_factor > 1.05


def test_wrong_wishes_are_refused():
    with pytest.raises(ArgumentError, match="method"):
        plan_self("gyro")
    with pytest.raises(ArgumentError, match="speed_ratio"):
        plan_self("spin-down", speed_ratio=0.9)
    with pytest.raises(ArgumentError, match="two angles"):
        plan_self("heads", count=1)


FILE = """
[joint]
gear_ratio = 7.3

[[harmonic]]
shaft = "output"
order = 3
amplitude_arcsec = 40.0

[[head]]
angle_deg = 0.0
[[head]]
angle_deg = 120.0
[[head]]
angle_deg = 240.0

[noise]
sigma_arcsec = 20.0

[[run]]
speed_deg_s = 3600.0
speed_end_deg_s = 720.0
turns = 99.4186
samples = 20000
shift_deg = 10.0
[[run]]
shift_deg = 50.0
"""


def test_a_plan_speaks_of_what_a_simulation_designs(tmp_path, capsys):
    path = tmp_path / "joint.toml"
    path.write_text(FILE)

    def told(method, *options):
        arguments = ["plan", "--self", method, "--simulation", str(path), "--json", *options]
        assert cli.main(arguments) == 0
        return json.loads(capsys.readouterr().out)

    heads = told("heads")
    assert heads["orders"] == [3.0]
    assert heads["given"]["blind_orders"] == [3.0]
    coast = told("spin-down", "--std-arcsec", "0.3")
    assert coast["speed_ratio"] == pytest.approx(5.0)
    # 20 000 readings in 20 s, coasting from 10 turns a second.
    assert coast["readings"] / coast["seconds"] == pytest.approx(1000.0, rel=1e-3)
    by_hand = plan_self(
        "spin-down", [3.0], start_speed=10.0, rate=1000.0, noise=20.0, standard_error=0.3
    )
    assert coast["readings"] == pytest.approx(by_hand.readings, rel=1e-3)
    assert told("shifts")["given"]["angles_deg"] == [10.0, 50.0]
    assert told("shifts", "--angles", "0,90")["given"]["angles_deg"] == [0.0, 90.0]
    assert told("dual")["noise_factors"] == {"3": 1.0}
    path.write_text("[[run]]\nsamples = 10\n")
    for method, words in (("spin-down", "speed_end_deg_s"), ("heads", "head"), ("dual", "gear")):
        assert cli.main(["plan", "--self", method, "--simulation", str(path)]) == 1
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("ratio", "whole", "turns"),
    # Motor order j passes at j times the ratio: how near to an output order of 1 or 2 the nearest
    # of eight comes, and two lines part after a wave of their difference.
    [(101.0, True, 3), (-0.0, None, 0), (1.3, False, 4), (1.45, False, 3), (0.51, False, 50)],
)
def test_turns_of_a_geared_joint_part_lines_of_motor_and_output(ratio, whole, turns):
    if whole is None:
        with pytest.raises(ArgumentError, match=r"gear_ratio must be motor turns .* not 0"):
            plan_self("dual", [1, 2], gear_ratio=ratio)
        return
    plan = plan_self("dual", [1, 2], gear_ratio=ratio)
    assert any("is whole" in note for note in plan.notes) == whole
    gaps = [abs(j * ratio - k) for j in range(1, 9) for k in (1, 2)]
    least = 3 if whole else max(3, math.ceil(1.0 / min(gaps)))
    assert plan.turns == least == turns
