"""What a fleet prints are the numbers of its object, and its file gives them back."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.fleets.outliers import LEVEL, Deviates, _combined, _f_tail, deviates, level_by_order
from trueangle.fleets.result import _LISTED
from trueangle.support.angles import arcsec

from .made import units

SEED = 52_600
DATES = ("2026-01-10", "2026-07-10")
#: Printed to four digits, and in a sentence to three.
FOUR, THREE = 6e-4, 6e-3


@pytest.fixture(scope="module")
def fleet():
    """One unit drifts, one zero moved, and repeats differ by much less than units."""
    print("seed", SEED)

    def change(u, t, b):
        b[0] += np.array([24.0, 32.0]) * (t and u == 3)
        return b, 400.0 * (t and u == 5)

    runs = units(np.random.default_rng(SEED), 14, dates=DATES, change=change, noise=1.0)
    return ta.fleet(runs, orders=range(1, 5), permitted_arcsec=60.0)


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_the_tables_hold_the_numbers_of_the_object(fleet, errors_in, per):
    plain, text = fleet.to_dict(), fleet.summary(errors_in)
    for unit in plain["units"]:
        row = re.search(rf"^  {unit['unit']} +{unit['verdict']} +([\d.e+-]+ *){{4}}$", text, re.M)
        if row is None:  # of those that are fine the first are listed
            assert unit["verdict"] == "fine"
            continue
        numbers = [float(x) for x in row[0].split()[2:]]
        wanted = [per * unit["peak_to_peak_arcsec"], per * unit["left_arcsec"]]
        assert numbers[:2] == pytest.approx(wanted, rel=FOUR)
        assert numbers[2:] == pytest.approx([unit["p"], unit["limit"]], rel=0.06)
    for common, between in zip(plain["common"]["orders"], plain["between"]["orders"], strict=True):
        row = re.search(rf"^ +{common['order']:g}  ([ \d.]+)$", text, re.M)
        wanted = [
            common["amplitude_arcsec"],
            between["std_arcsec"],
            between["repeatability_arcsec"],
        ]
        assert [float(x) for x in row[1].split()] == pytest.approx(per * np.array(wanted), rel=FOUR)
    flat, bound = " ".join(text.split()), plain["tolerance"]
    told = re.search(
        rf"(\S+) % of units stay below (\S+) {errors_in} peak-to-peak and (\S+) {errors_in} "
        r"residual .* with (\S+) % confidence \(.*factor (\S+)\)",
        flat,
    )
    wanted = [100 * bound["share"], per * bound["peak_to_peak_arcsec"], per * bound["left_arcsec"],
              100 * bound["confidence"], bound["factor"]]  # fmt: skip
    assert [float(x) for x in told.groups()] == pytest.approx(wanted, rel=FOUR)


def test_the_calendar_names_those_that_are_due_by_their_drift(fleet):
    rows = [row for row in fleet.to_dict()["history"] if row["next_calibration"]]
    near = [row for row in rows if not row["extrapolated"]]
    far = sorted(row["next_calibration"] for row in rows if row["extrapolated"])
    text = fleet.summary("arcsec")
    told = re.findall(r"(u\d+) +(\d{4}-\d\d-\d\d) +changed by (\S+) arcsec", text)
    assert [name for name, _, _ in told] == ["u3"] == [row["unit"] for row in near]
    assert told[0][1] == near[0]["next_calibration"]
    assert float(told[0][2]) == pytest.approx(near[0]["bound_arcsec"], rel=FOUR)
    assert f"{len(far)} units from {far[0]}" in " ".join(text.split())


def test_a_unit_that_moved_says_by_how_much_its_orders_did(fleet):
    (moved,) = [unit for unit in fleet.units if unit.verdict == "recalibrate"]
    told = re.search(r"order 1 by (\S+) arcsec", moved.because)
    # 24 and 32 arcsec, each of both dates known to 1 sqrt(2 / 540) arcsec.
    assert float(told[1]) == pytest.approx(40.0, rel=THREE)


def numbers(value):
    """Every entry of nested lists and objects, by its place."""
    if isinstance(value, dict | list):
        pairs = value.items() if isinstance(value, dict) else enumerate(value)
        return {f"{k}.{place}": x for k, one in pairs for place, x in numbers(one).items()}
    return {"": value}


def test_what_is_loaded_is_what_was_saved_number_by_number(fleet, tmp_path):
    fleet.save(tmp_path / "fleet.json")
    again = ta.load_fleet(tmp_path / "fleet.json")
    ours, theirs = numbers(fleet.to_dict()), numbers(again.to_dict())
    assert ours.keys() == theirs.keys()
    for place, value in ours.items():
        same = isinstance(value, float)
        assert theirs[place] == (pytest.approx(value, rel=1e-9, abs=1e-9) if same else value), place
    for one, other in zip(fleet.common, again.common, strict=True):
        phase = np.radians(other.phase_deg)
        assert other.sine == pytest.approx(one.amplitude * np.cos(phase), abs=1e-12)
        assert other.cosine == pytest.approx(one.amplitude * np.sin(phase), abs=1e-12)
    assert again.summary() == fleet.summary()
    assert arcsec(again.tolerance.left, again.period) == pytest.approx(
        ours["tolerance.left_arcsec."]
    )


@pytest.mark.parametrize("count", [2, 5, 6, 7])
def test_units_that_tell_nothing_are_named_up_to_five_and_counted(count):
    rng = np.random.default_rng(SEED + 1)
    few = [
        ta.CalibrationRun([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 360.0, unit=f"s{i}")
        for i in range(count)
    ]
    found = ta.fleet([*units(rng, 6, runs=1), *few], orders=[1, 2])
    more = f" and {count - 5} more" if count > 5 else ""
    listed = ", ".join(f"s{i}" for i in range(min(count, 5))) + more
    assert f"The readings of {listed} do not separate the orders; omitted." in found.notes


def test_units_that_need_attention_stand_first_and_are_counted(fleet):
    odd = [unit for unit in fleet.units if unit.verdict != "fine"]
    fine = [unit for unit in fleet.units if unit.verdict == "fine"]
    assert len(odd) == 2
    many = tuple(replace(fine[0], unit=f"v{i}") for i in range(40))
    for some, told in (
        ((*odd, *fine), "14 units; 2 need attention"),
        ((*odd[1:], *fine), "13 units; 1 needs attention"),
        (tuple(fine), "12 units; none needs attention"),
        (tuple(fine[:3]), "3 units; none needs attention"),
        ((*odd, *many), "42 units; 2 need attention"),
    ):
        text = replace(fleet, units=some).summary("arcsec")
        assert text.splitlines()[0] == told
        table = text[text.index("peak-to-peak  ") :]
        listed = [unit for unit in some if re.search(rf"^  {unit.unit} ", table, re.M)]
        most = len([unit for unit in some if unit in odd]) + _LISTED
        assert listed == list(some[:most])
        rest = f"  and {len(some) - len(listed)} that are fine"
        assert (rest in text) == (len(some) > len(listed))
        reasons = re.findall(r"^  (\S+) +(?:recalibrate|zero_moved|fine) +[^\d\s]", text, re.M)
        assert reasons == [unit.unit for unit in some if unit.because]


@pytest.mark.parametrize("name", ["a", "u31", "name", "axis-2-of-arm-left"])
def test_the_table_of_units_is_as_wide_as_its_names(fleet, name):
    """Numbers end where their heads do, and verdicts begin there."""
    units = (replace(fleet.units[0], unit=name), *fleet.units[1:])
    lines = replace(fleet, units=units).summary("arcsec").splitlines()
    top = next(k for k, line in enumerate(lines) if line.startswith("  unit "))
    head = lines[top]
    assert head.index("verdict") == 2 + max(len("unit"), len(name)) + 2
    for row, unit in zip(lines[top + 2 :], units[:3], strict=False):
        assert row.startswith(f"  {unit.unit} ")
        assert row.index(unit.verdict) == head.index("verdict")
        ends = [found.end() for found in re.finditer(r"\S+", row)]
        heads = [found.end() for found in re.finditer(r"\S+", head)]
        assert ends[2:] == heads[2:]


def test_words_of_a_fleet_are_those_of_its_numbers(fleet):
    text = replace(fleet, notes=("first", "second"), aligned_probability=0.97).summary()
    assert "  [1] first\n  [2] second" in text
    assert "common pattern: the mean of the units, probability 0.97" in text
    alone = replace(fleet, aligned_probability=0.2).summary()
    assert "none (random phases), probability 0.8" in alone
    (due,) = [row for row in fleet.history if row.next_calibration and not row.extrapolated]
    assert f"at most until {due.when[:10]}" in " ".join(text.split())
    # The unit of all is that of the largest.
    large = replace(fleet.units[0], peak_to_peak=20.0)
    small = [replace(unit, peak_to_peak=1e-4, left=1e-5) for unit in fleet.units]
    assert unit_told(replace(fleet, units=(*small, large))) == "deg"
    assert unit_told(replace(fleet, units=tuple(small))) == "arcsec"


def unit_told(fleet):
    return fleet.summary().split("standard deviations of cosine and sine, ")[1].split(")")[0]


LEVELS_SEED = 52_080


@pytest.mark.parametrize(
    ("orders", "shares"),
    [
        ([1, 2, 5, 8], [0.4, 0.2, 0.2, 0.2]),
        ([8, 2, 1], [0.4, 0.2, 0.4]),
        ([5, 8], [0.5, 0.5]),
        ([1], [1.0]),
        ([2], [1.0]),
        ([1, 2], [2.0 / 3.0, 1.0 / 3.0]),
        ([1, 7.3], [0.5, 0.5]),
        ([2, 3, 4, 5, 6], [1.0 / 3.0] + [1.0 / 6.0] * 4),
    ],
)
def test_eccentricity_has_two_fifths_of_the_level_and_tilt_one(
    orders: list[float], shares: list[float]
) -> None:
    """All others have the rest together; of fewer orders each has the more in proportion."""
    found = level_by_order(np.array(orders, dtype=float))
    np.testing.assert_allclose(found, shares, rtol=1e-12)
    assert found.sum() == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("d", [1, 2])
def test_a_tail_is_that_of_f(d: int) -> None:
    f, free = np.array([0.3, 1.0, 4.0, 30.0]), np.array([4.0, 9.0, 20.0, 100.0])
    np.testing.assert_allclose(_f_tail(f, d, free), stats.f.sf(f, d, free), rtol=1e-6)


@pytest.mark.parametrize("orders", [1, 2, 5, 17])
def test_a_chance_is_the_least_of_the_orders_or_that_of_all_together(orders: int) -> None:
    """Nine tenths of the level are for single orders, by their shares; the rest is Fisher's."""
    print("seed", LEVELS_SEED)
    rng = np.random.default_rng(LEVELS_SEED)
    chance = rng.uniform(size=(40, orders)) ** rng.integers(1, 9, (40, 1))
    shares = rng.dirichlet(np.ones(orders))
    expected = []
    for row in chance:
        single = min(p / share for p, share in zip(row, shares, strict=True))
        every = stats.combine_pvalues(row, method="fisher").pvalue
        expected.append(single if orders == 1 else min(single / 0.9, every / 0.1))
    np.testing.assert_allclose(_combined(chance, shares), np.minimum(expected, 1.0), rtol=1e-9)


def test_orders_of_a_unit_are_those_outside_the_farthest_first() -> None:
    """At a hundredth shared by all units and orders; the farthest where none is."""
    chance = np.full((5, 4), 0.5)
    limit = LEVEL / 20.0
    chance[1] = [limit, 1.01 * limit, 1e-9, 0.9]
    chance[2] = [0.3, 0.2, 0.4, 0.1]
    empty = np.zeros(0)
    found = Deviates(chance, chance, empty, empty.astype(bool), empty, 0.0)
    assert found.outside(1) == [2, 0]
    assert found.outside(2) == [3]
    assert found.outside(1, 2.0 * LEVEL) == [2, 0, 1]


@pytest.mark.parametrize(("d", "aligned"), [(1, True), (2, True), (2, False)])
def test_units_known_unlike_well_are_weighed_by_their_variances(d: int, aligned: bool) -> None:
    """Without one another, one by one, by the formula; and a quarter of them far off."""
    print("seed", LEVELS_SEED + 1)
    rng = np.random.default_rng([LEVELS_SEED + 1, d])
    noise = rng.uniform(0.5, 2.0, 12)
    own = noise[:, None, None] * np.eye(d)
    value = np.sqrt(2.0 + noise)[:, None] * rng.normal(size=(12, d))
    found = deviates([value], [own], aligned)
    w = 1.0 / (found.variances[0] + noise)
    mean = (w @ value) / w.sum() if aligned else np.zeros(d)
    share = w / w.sum() if aligned else np.zeros(12)
    e = w * ((value - mean) ** 2).sum(axis=1) / (1.0 - share)
    freedom = d * (12 - aligned)
    square = (w * ((value - mean) ** 2).sum(axis=1)).sum()
    f = e / d / ((square - e) / (freedom - d))
    np.testing.assert_allclose(found.chance[:, 0], stats.f.sf(f, d, freedom - d), rtol=1e-6)
    np.testing.assert_allclose(found.size[:, 0], np.sqrt(d * f), rtol=1e-9)
    np.testing.assert_allclose(found.unit, found.chance[:, 0], rtol=1e-12)
    for count in (1, 2, 3):
        far = value.copy()
        far[:count] += 1e6 * (1.0 + np.arange(count))[:, None] * (1.0 if d == 1 else [1.0, -1.0])
        outlying = deviates([far], [own], aligned).outlying
        assert np.flatnonzero(outlying).tolist() == list(range(count))


def test_few_units_have_no_scale() -> None:
    """Four degrees of freedom are needed of the others: of two dimensions from four units on."""
    print("seed", LEVELS_SEED + 2)
    value = np.random.default_rng(LEVELS_SEED + 2).normal(size=(6, 2))
    for d, aligned, least in ((2, True, 4), (2, False, 3), (1, False, 6)):
        for count in (least - 1, least):
            own = np.zeros((count, d, d))
            found = deviates([value[:count, :d]], [own], aligned)
            assert (found.chance < 1.0).all() == (count == least)
