"""The unit of a page and its decimals: whichever the unit of the readings, from both sides."""

import itertools

import numpy as np
import pytest

import trueangle as ta
from trueangle.model.monitor import WatchedOrder, WatchedWindow
from trueangle.reports.diagnosed import unknown_content
from trueangle.reports.figures import error_scale
from trueangle.reports.robot import JointRank, ranking_text
from trueangle.reports.watched import WatchReport
from trueangle.reports.wording import (
    Numbers,
    by_kind,
    conditions,
    gain_verdict,
    joined_list,
    listed_orders,
)

SEED = 66_200
TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "count": 4096.0}
ARCSEC = 1_296_000.0

pytest.importorskip("markupsafe")


@pytest.mark.parametrize("per_arcsec", [1.0, 1.0 / 3600.0, 4096.0 / ARCSEC])
def test_the_smallest_of_a_column_keeps_three_digits(per_arcsec):
    """Of any sign and order; what is nothing and what is not there do not count."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    for _ in range(100):
        sizes = 10.0 ** rng.uniform(-2.0, 2.0, 5) / per_arcsec
        column = [*(sizes * rng.choice([-1.0, 1.0], 5)).tolist(), None, 0.0]
        rng.shuffle(column)
        shown = {"unit": "u", "per_arcsec": per_arcsec}
        numbers = Numbers({"errors_in": shown, "a": column})
        decimals = numbers.column([f"a.{k}" for k in range(7)])
        least = float(np.min(sizes)) * per_arcsec
        # Three digits, and not four where three are enough.
        assert decimals == max(0, 2 - int(np.floor(np.log10(float(f"{least:.2e}")))))
        for k, value in enumerate(column):
            text = str(numbers.error(f"a.{k}", decimals)).partition(">")[2].partition("<")[0]
            if value is None:
                assert text == "\u2013"
            else:
                digits = float(text.replace("\u2212", "-"))
                assert digits == pytest.approx(value * per_arcsec, abs=0.51 * 10.0**-decimals)


@pytest.mark.parametrize(("half", "unit"), [(3599.0, "arcsec"), (3601.0, "deg")])
def test_a_table_of_joints_is_in_degrees_from_a_degree_of_half_the_range_on(half, unit):
    """As the page of such a joint is, whose error goes to so much either way."""
    rows = [
        JointRank("a", 20.0, 1.0, "calibrated", None),
        JointRank("b", 2.0 * half, 5.0, "calibrated", None),
    ]
    for order in (rows, rows[::-1]):
        lines = ranking_text("Fit:", order).splitlines()
        assert lines[2].split() == ["before,", unit, unit]
        shown = next(line for line in lines if line.startswith("b")).split()
        scale = 1.0 if unit == "arcsec" else 1.0 / 3600.0
        assert float(shown[1]) == pytest.approx(2.0 * half * scale, rel=1e-3)


def windows(turn, arcsec):
    """Two windows; the larger size of the first is that in arcsec, of the second a tenth."""
    found = []
    for number, size in ((1, arcsec), (2, 0.1 * arcsec)):
        orders = tuple(
            WatchedOrder(order, part * size * turn / ARCSEC, 0.0, 1.0 + order)
            for order, part in ((1.0, 0.5), (2.0, 1.0))
        )
        found.append(WatchedWindow(number, 0.0, None, 90, orders, 3.0, 9.0, False, ""))
    return found


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize(("arcsec", "unit"), [(3500.0, "arcsec"), (3700.0, "deg")])
def test_a_watched_joint_is_shown_alike_whatever_the_unit_of_its_readings(readings, arcsec, unit):
    turn = TURNS[readings]
    page = WatchReport(windows(turn, arcsec), turn)
    assert page.unit.name == unit
    sizes = [row["amplitude_arcsec"] for row in page.to_dict()["windows"][0]["orders"]]
    np.testing.assert_allclose(sizes, [0.5 * arcsec, arcsec])
    _, size = page._order(1)
    assert page.unit.text(arcsec) in size["alt"]
    asked = WatchReport(windows(turn, arcsec), turn, errors_in=4096.0)
    assert asked.unit.text(ARCSEC / 4096.0) == "1.000 count"


@pytest.mark.parametrize("turn", [360.0, 2.0 * np.pi, 8192.0])
def test_counts_are_of_the_turn_that_is_asked_for(turn):
    """A number is the counts of a turn; the word means those of the readings."""
    x = np.arange(8) / 8.0 * turn
    runs = [ta.CalibrationRun(x, x, turn)]
    asked = error_scale(4096.0, 10.0, runs)
    assert (asked.name, asked.turn) == ("count", 4096.0)
    assert asked.factor == pytest.approx(4096.0 / ARCSEC)
    assert asked.defined == "in counts of 4096 to a turn"
    if turn == 8192.0:
        own = error_scale("count", 10.0, runs)
        assert (own.turn, own.factor) == (8192.0, pytest.approx(8192.0 / ARCSEC))
    assert error_scale("arcsec", 10.0, runs).turn is None


def opened(*conditions, turn=360.0):
    """Whether latency, drift and compliance are left open by runs of such conditions."""
    runs = []
    for speed, heat, load in conditions:
        reference = np.linspace(0.0, 1.0, 41) * turn
        time = np.linspace(0.0, 360.0 / speed, 41)
        for way in (slice(None), slice(None, None, -1)):
            x = reference[way]
            runs.append(
                ta.CalibrationRun(x, x, turn, time=time, temperature=heat, torque=load, mount=0.0)
            )
    text = " ".join(entry["what"] for entry in unknown_content(runs, None, None))
    return tuple(word in text for word in ("delay", "thermal", "compliance"))


@pytest.mark.parametrize("turn", [360.0, 2.0 * np.pi])
def test_conditions_differ_from_a_twentieth_on_of_the_speed_a_kelvin_and_a_twentieth(turn):
    """From both sides; of speeds, of the faster one, whichever run comes first."""
    here = (100.0, 20.0, 0.0)
    for other, told in (
        ((95.1, 20.99, 0.049), (True, True, True)),
        ((94.9, 20.0, 0.0), (False, True, True)),
        ((100.0, 21.01, 0.0), (True, False, True)),
        ((100.0, 20.0, 0.051), (True, True, False)),
    ):
        assert opened(here, other, turn=turn) == told
        assert opened(other, here, turn=turn) == told


WORDING_SEED = 66_700


@pytest.mark.parametrize("low", [None, -3.0, 0.99, 1.01, 40.0])
@pytest.mark.parametrize("reduction", [-3.0, 0.99, 1.01, 60.0])
def test_a_gain_is_one_by_the_lower_end_of_its_interval(low, reduction):
    """By the reduction itself only where no interval is known; from one per cent on."""
    gain = {"reduction_percent": reduction, "reduction_low_percent": low}
    decisive = reduction if low is None else low
    wanted = "gain" if decisive > 1.0 else "no-gain"
    assert gain_verdict({"model": {}, "gain": gain}) == wanted
    assert gain_verdict({"model": None, "gain": gain}) == "no-model"
    assert gain_verdict({"model": {}, "gain": None}) == "unchecked"


def test_the_largest_of_a_condition_has_three_digits():
    """Of any sign, wherever it stands; what no run has is no column."""
    print("seed", WORDING_SEED)
    rng = np.random.default_rng(WORDING_SEED)
    keys = ("speed_deg_s", "temperature_C", "torque_Nm", "mount_deg")
    for _ in range(100):
        runs = [dict.fromkeys(keys) for _ in range(5)]
        largest = {}
        for key in keys[: int(rng.integers(0, 5))]:
            values = 10.0 ** rng.uniform(-2.5, 3.5, 4) * rng.choice([-1.0, 1.0], 4)
            for place, value in zip(rng.permutation(5)[:4], values.tolist(), strict=True):
                runs[place][key] = value
            largest[key] = float(np.abs(values).max())
        found = {column["key"]: column["digits"] for column in conditions(runs)}
        assert list(found) == list(largest)
        for key, digits in found.items():
            wanted = max(0, 2 - int(np.floor(np.log10(float(f"{largest[key]:.2e}")))))
            assert digits == wanted, largest[key]


def test_runs_of_a_fault_are_told_once():
    """Those of the first of its kind stand with it; of further ones what is new, in their order."""
    print("seed", WORDING_SEED + 1)
    rng = np.random.default_rng(WORDING_SEED + 1)
    for _ in range(50):
        faults = [
            {"fault": str(rng.choice(list("xyz"))),
             "runs": sorted(rng.choice(list("12345"), int(rng.integers(1, 4)), replace=False))}
            for _ in range(6)
        ]  # fmt: skip
        found = by_kind(faults)
        kinds = list(dict.fromkeys(fault["fault"] for fault in faults))
        assert [first["fault"] for first, _ in found] == kinds
        for kind, (first, others) in zip(kinds, found, strict=True):
            every = itertools.chain(*(f["runs"] for f in faults if f["fault"] == kind))
            assert not set(first["runs"]) & set(others)
            assert set(first["runs"]) | set(others) == set(every)


def test_orders_that_are_listed_are_those_kept_and_twenty_of_the_largest():
    print("seed", WORDING_SEED + 2)
    rng = np.random.default_rng(WORDING_SEED + 2)
    for count in (5, 60):
        rows = [
            {"retained": bool(rng.random() < 0.2),
             "amplitude_arcsec": None if rng.random() < 0.1 else float(rng.uniform(0.0, 9.0))}
            for _ in range(count)
        ]  # fmt: skip
        found = listed_orders(rows)
        assert found == sorted(set(found))
        kept = {i for i, row in enumerate(rows) if row["retained"]}
        others = set(range(count)) - kept
        assert kept <= set(found)
        assert len(set(found) - kept) == min(20, len(others))
        sizes = [rows[i]["amplitude_arcsec"] or 0.0 for i in range(count)]
        out = others - set(found)
        if out:
            assert max(sizes[i] for i in out) <= min(sizes[i] for i in set(found) - kept)
    assert [joined_list(list(range(1, n + 1))) for n in (1, 2, 3)] == ["1", "1 and 2", "1, 2 and 3"]
