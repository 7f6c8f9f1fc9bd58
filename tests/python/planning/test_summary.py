"""Plans in words: every number that is printed is the plan's."""

import math
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.planning import plan_arc, plan_mounts
from trueangle.planning.nextruns import NextRuns, RivalEvidence
from trueangle.planning.plan import check_readings, readings_needed
from trueangle.planning.selfplan import plan_self
from trueangle.simulation import RunDesign, Simulation

#: Printed to three digits; factors of mounts and heads to two decimals.
THREE, CENTS = 6e-3, 0.0051

WORST = "worst order            standard error"


def rows(text, columns):
    """Lines of nothing but so many numbers."""
    lines = (line.split() for line in text.splitlines())
    number = re.compile(r"-?\d+\.?\d*(e[+-]?\d+)?")
    return [[float(x) for x in line] for line in lines
            if len(line) == columns and all(map(number.fullmatch, line))]  # fmt: skip


def told(text, name):
    return float(re.search(rf"{re.escape(name)} +(-?[\d.]+)", text)[1])


def test_of_an_arc():
    plan = plan_arc(-135.0, 135.0, [1, 2, 3], readings=60, runs=2, both_directions=True, noise=3.0)
    text = plan.summary()
    assert f"{plan.readings} readings over -135 to 135 deg: 30 in each of 2 runs, half" in text
    assert plan.readings == 60
    places = np.array(rows(text, 2))
    np.testing.assert_allclose(places[:, 0], plan.places_deg, atol=5.1e-4)
    assert places[:, 1].tolist() == list(plan.counts)
    for order, factor, even in rows(text, 3):
        assert factor == pytest.approx(plan.noise_factors[order], rel=THREE)
        assert even == pytest.approx(plan.even_noise_factors[order], rel=THREE)
        assert even > 1.02 * factor
    assert told(text, "D-efficiency") == pytest.approx(plan.d_efficiency, abs=5.1e-4)
    assert told(text, "of even spacing") == pytest.approx(
        plan.efficiency_of_even_spacing, abs=5.1e-4
    )
    assert told(text, "uncertainty (k = 2)") == pytest.approx(plan.uncertainty_arcsec, rel=THREE)


def test_of_mounts():
    plan = plan_mounts(100, 36, 3, noise=5.0, standard_error=0.5)
    text = plan.summary()
    found = re.findall(r"start at (\S+) deg(?:, turn the polygon by (\d+) face)?", text)
    offsets, turned = zip(*found, strict=True)
    assert [float(x) for x in offsets] == pytest.approx(plan.mount_offsets_deg, rel=THREE)
    assert told(text, "worst order            standard error") == pytest.approx(
        plan.worst_noise_factor, abs=CENTS
    )
    assert told(text, "polygon not calibrated standard error") == pytest.approx(
        math.sqrt(3) * plan.facet_noise_factor, abs=CENTS
    )
    assert f"{plan.readings} readings in all, {plan.readings // 108}" in " ".join(text.split())
    assert [int(x or 0) for x in turned] == list(plan.facet_shifts)
    pairs = dict(re.findall(r"(\d+) +(\d+\.\d\d)\b", text.partition("each order; 1")[2]))
    for order, factor in plan.noise_factors.items():
        assert float(pairs[f"{order:g}"]) == pytest.approx(factor, abs=CENTS)


def test_of_heads_and_of_a_coast():
    plan = plan_self("heads", range(1, 9), angles=[0.0, 40.0, 95.0], noise=5.0, standard_error=0.5)
    text = plan.summary()
    worse = r"the given angles +standard error (\S+), (\S+) times the best"
    given = re.search(worse, text).groups()
    wanted = [plan.given["worst_noise_factor"], plan.given["worse_by"]]
    assert [float(x) for x in given] == pytest.approx(wanted, abs=CENTS)
    assert told(text, "worst order            standard error") == pytest.approx(
        plan.worst_noise_factor, abs=CENTS
    )
    coast = plan_self(
        "spin-down", [1, 2], start_speed=4.0, rate=500.0, noise=9.0, standard_error=0.3
    )
    text = coast.summary()
    recorded = re.search(r"record (\S+) turns, .*, (\S+) s ", " ".join(text.split())).groups()
    assert [float(x) for x in recorded] == pytest.approx([coast.turns, coast.seconds], rel=THREE)
    assert f" {coast.readings} readings, " in " ".join(text.split())
    table = coast.to_dict()["speed_ratio_factors"]
    assert table == {f"{ratio:g}": factor for ratio, factor in coast.speed_ratio_factors.items()}
    for ratio, factor in coast.speed_ratio_factors.items():
        assert float(re.search(rf"([\d.]+) at {ratio:g}(?![\d.])", text)[1]) == pytest.approx(
            factor, rel=0.06
        )


@pytest.mark.parametrize(("told_apart", "trials"), [(True, 0), (True, 40), (False, 0)])
def test_of_the_next_runs(told_apart, trials):
    entry = RivalEvidence(("backlash", "latency"), True, told_apart, 23.4, 0.87, trials)
    designs = (RunDesign(label="next-1", samples=120), RunDesign(label="next-2", samples=80))
    plan = NextRuns(designs, (entry,), False, (), 150.0, Simulation())
    text = " ".join(plan.summary().split())
    assert "2 runs of 200 readings in all, 2 min of motion; diagnose them with" in text
    verb = "distinguishes backlash from latency" if told_apart else "not distinguished: backlash or"
    assert verb in text
    counted = f" ({trials} simulated)" if trials else ""
    assert f"expected BIC gain 23, true cause named in 87 % of the cases{counted}" in text


NO_SIZE = [0.0, -1.0, math.nan, math.inf]


@pytest.mark.parametrize("factor", [1.0, 1.02, 3.0])
@pytest.mark.parametrize(("noise", "wanted"), [(5.0, 0.5), (0.3, 0.007), (1.0, 40.0)])
def test_one_reading_less_is_too_few(noise: float, wanted: float, factor: float) -> None:
    count = readings_needed(noise, wanted, factor)
    assert factor * noise * math.sqrt(2.0 / count) <= wanted * (1.0 + 1e-12)
    assert count == 1 or factor * noise * math.sqrt(2.0 / (count - 1)) > wanted


@pytest.mark.parametrize("name", ["noise", "standard_error", "factor"])
@pytest.mark.parametrize("value", NO_SIZE)
def test_a_size_is_positive_and_finite(name: str, value: float) -> None:
    given = {"noise": 5.0, "standard_error": 0.5, "factor": 1.0, name: value}
    with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
        readings_needed(**given)
    if name != "factor":
        with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
            plan_mounts(100, noise=given["noise"], standard_error=given["standard_error"])


@pytest.mark.parametrize("name", ["noise", "standard_error", "uncertainty"])
@pytest.mark.parametrize("value", NO_SIZE)
def test_a_size_of_an_arc_is_positive_and_finite(name: str, value: float) -> None:
    """Whatever else is wanted: a noise of nan once ended in a ValueError of Python's own."""
    for wanted in ({"uncertainty": 3.0}, {"standard_error": 1.0}, {"readings": 14}):
        given = {"noise": 2.0, **wanted, name: value}
        with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
            plan_arc(0.0, 90.0, [1, 2], **given)


@pytest.mark.parametrize("given", [{"uncertainty": 1e-3}, {"standard_error": 1e-3},
                                   {"uncertainty": 5e-324}, {"readings": 10**7}])  # fmt: skip
def test_an_arc_is_not_read_a_million_times(given: dict[str, float]) -> None:
    """Of so many readings the places once took more memory than there is."""
    with pytest.raises(ta.errors.ArgumentError, match="1000000"):
        plan_arc(0.0, 90.0, [1, 2], noise=5.0, **given)


@pytest.mark.parametrize(("noise", "wanted"), [(1e308, 1.0), (5.0, 5e-324), (1.0, 1e-6)])
def test_more_readings_than_anybody_takes_are_refused(noise: float, wanted: float) -> None:
    with pytest.raises(ta.errors.ArgumentError, match=r"takes more than 1e\+12 readings"):
        readings_needed(noise, wanted)
    assert readings_needed(1.0, 1.5e-6) == pytest.approx(2.0 / 1.5e-6**2)


@pytest.mark.parametrize("readings", [None, 1, 7, 7.0])
def test_whole_numbers_of_readings_from_one_to_the_most_are_taken(readings: float | None) -> None:
    check_readings(readings, 7)


@pytest.mark.parametrize("readings", [0, 8, 2.5, -1])
def test_other_numbers_of_readings_are_refused_with_the_most(readings: float) -> None:
    told = rf"^readings must be a whole number from 1 to 7, got {re.escape(repr(readings))}$"
    with pytest.raises(ArgumentError, match=told):
        check_readings(readings, 7)


@pytest.mark.parametrize(
    ("positions", "highest"), [(5, 2), (6, 2), (7, 3), (8, 3), (9, 4), (12, 5)]
)
def test_low_orders_end_below_half_of_the_positions(positions, highest):
    plan = plan_mounts(101, positions=positions, mounts=6)
    assert [order for order in plan.noise_factors if order < 101] == [*range(1, highest + 1)]
