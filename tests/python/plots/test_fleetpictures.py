"""What pictures of a fleet and of a watched joint draw is what their results say."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

import trueangle as ta
from fleets.made import MEAN, units
from model.test_windows import PER, model, readings
from trueangle import plots
from trueangle.certificate.typesetting import certified_errors
from trueangle.planning import wanted_orders
from trueangle.plots import text_alternative
from trueangle.plots.amplitudespectrum import OrderAxis
from trueangle.plots.controlcharts import watched_windows
from trueangle.rehearsal.detection import SizeRange
from trueangle.rehearsal.result import rehearsed_cause
from trueangle.rehearsal.trial import TrialOutcome

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

SEED = 52_900
DATES = ("2026-01-10", "2026-03-10", "2026-05-10")
UNITS = [("arcsec", 3600.0), ("mrad", np.pi / 0.18)]


@pytest.fixture(scope="module")
def fleet():
    print("seed", SEED)

    def eccentric(u, t, b):
        return b + np.array([[120.0, 0.0]] + 3 * [[0.0, 0.0]]) * (u == 3), 0.0

    return ta.fleet(
        units(np.random.default_rng(SEED), 10, dates=DATES, change=eccentric, runs=1), orders=[1, 2]
    )


def lines(ax):
    """Data of lines by their labels."""
    return {line.get_label(): np.array(line.get_data(), dtype=object) for line in ax.lines}


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_phasors_and_their_circle(fleet, errors_in, per):
    """At the angle of the phase of C sin(kx + phase): sine to the right, cosine upwards."""
    ax = fleet.plot("phasors", order=1, errors_in=errors_in)
    drawn = lines(ax)
    angle, radius = drawn["95 % of units"].astype(float)
    common, between = fleet.common[0], fleet.between[0]
    away = radius * np.exp(1j * angle) - per * complex(common.sine, common.cosine)
    np.testing.assert_allclose(
        np.abs(away), per * between.std * np.sqrt(chi2.ppf(0.95, 2)), rtol=1e-9
    )
    for label, fine in (("fine", True), ("not fine", False)):
        rows = [unit.orders[0] for unit in fleet.units if (unit.verdict == "fine") == fine]
        assert rows
        phase, size = drawn[label].astype(float)
        np.testing.assert_allclose(phase, np.radians([row.phase_deg for row in rows]))
        np.testing.assert_allclose(size, [per * row.amplitude for row in rows])


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_sizes_and_the_band_of_the_limit(fleet, errors_in, per):
    ax = fleet.plot("sizes", errors_in=errors_in)
    drawn = lines(ax)
    ranked = sorted(fleet.units, key=lambda unit: unit.peak_to_peak)
    for label, fine in (("fine", True), ("not fine", False)):
        rows = [
            (i, u.peak_to_peak) for i, u in enumerate(ranked, 1) if (u.verdict == "fine") == fine
        ]
        place, size = drawn[label].astype(float)
        assert place.tolist() == [i for i, _ in rows]
        np.testing.assert_allclose(size, [per * ptp for _, ptp in rows])
    (band,) = ax.patches
    assert band.get_height() == pytest.approx(per * fleet.tolerance.peak_to_peak)


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_patterns_are_the_units_and_the_common_one(fleet, errors_in, per):
    axes = fleet.plot("patterns", errors_in=errors_in).figure.axes
    x = np.radians(np.linspace(0.0, 360.0, 361))
    common = sum(
        row.cosine * np.cos(row.order * x) + row.sine * np.sin(row.order * x)
        for row in fleet.common
    )
    for unit, ax in zip(fleet.units, axes, strict=True):
        shared, own = (line.get_ydata() for line in ax.lines[:2])
        np.testing.assert_allclose(shared, per * common, atol=1e-9)
        wave = sum(r.amplitude * np.sin(r.order * x + np.radians(r.phase_deg)) for r in unit.orders)
        np.testing.assert_allclose(own, per * wave, atol=1e-9)
        assert np.ptp(own) == pytest.approx(per * unit.peak_to_peak, rel=1e-2)
        assert ax.get_xlim() == (0.0, 360.0)


@pytest.fixture(scope="module")
def many():
    """Units that differ most in order 4, then 3; of three the last state is another one."""
    print("seed", SEED)

    def own(u, t, b):
        more = np.array([3.0, 0.2, 5.0, 9.0])[:, None] * (b - MEAN) + MEAN
        return more + np.array([[400.0, 0.0]] + 3 * [[0.0, 0.0]]) * (u < 3 and t == 2), 0.0

    made = units(np.random.default_rng(SEED), 12, dates=DATES, change=own, runs=1)
    return ta.fleet(made, orders=[1, 2, 3, 4])


def test_an_overview_has_the_three_orders_in_which_units_differ_most(many):
    between = {row.order: row.std for row in many.between}
    ranked = sorted(between, key=lambda order: -between[order])
    sizes, *polars = many.plot("overview").figure.axes
    named = [float(ax.get_title().split()[1].rstrip(":")) for ax in polars]
    assert named == ranked[:3]
    assert many.plot("phasors").get_title().startswith(f"order {ranked[0]:g}: ")
    odd = [unit.unit for unit in many.units if unit.verdict != "fine"]
    assert len(odd) >= 3
    assert text_alternative(sizes).endswith(f"differ most; not fine: {', '.join(odd)}.")
    for order, ax in zip(named, polars, strict=True):
        told = text_alternative(ax)
        assert told.startswith(f"Order {order:g} of 12 units as phasors")
        assert told.endswith(f"; not fine: {', '.join(odd)}.")
        # All of it is within the rim, and the picture is not much larger than what is drawn.
        farthest = max(np.max(line.get_ydata()) for line in ax.lines)
        assert ax.get_rmin() == 0.0
        assert 1.02 * farthest < ax.get_rmax() < 1.3 * farthest


def test_a_fleet_that_is_fine_is_said_to_be(many):
    fine = replace(many, units=tuple(u for u in many.units if u.verdict == "fine"))
    for kind in ("overview", "phasors"):
        assert text_alternative(fine.plot(kind)).endswith("; all are fine.")


def test_the_band_is_named_by_its_share_and_confidence(many):
    band = many.tolerance._replace(share=0.8, confidence=0.99, peak_to_peak=0.1)
    ax = replace(many, tolerance=band).plot("sizes")
    assert "80 % of units, 99 % confidence" in [patch.get_label() for patch in ax.patches]
    assert text_alternative(ax).endswith("12 units and the band that holds the fleet.")
    none = many.tolerance._replace(peak_to_peak=np.inf)
    ax = replace(many, tolerance=none).plot("sizes")
    assert not ax.patches
    assert text_alternative(ax) == "Peak-to-peak of 12 units."


@pytest.mark.parametrize(("most", "drawn"), [(0, 1), (1, 1), (7, 7), (99, 12)])
def test_patterns_stand_in_rows_of_five_with_angles_below_the_last_of_each_column(
    many, most, drawn
):
    moved = replace(many.units[0], verdict="zero_moved")
    many = replace(many, units=(moved, *many.units[1:]))
    first = many.plot("patterns", most=most)
    axes = [ax for ax in first.figure.axes if ax.get_visible()]
    assert len(axes) == drawn
    for i, (unit, ax) in enumerate(zip(many.units, axes, strict=False)):
        verdict = "" if unit.verdict == "fine" else f": {unit.verdict.replace('_', ' ')}"
        assert ax.get_title() == unit.unit + verdict
        lowest = i + min(drawn, 5) >= drawn
        told = [text.get_text() for text in ax.get_xticklabels()]
        assert told == (["0", "180", "360"] if lowest else ["", "", ""])
    assert text_alternative(first).startswith(f"Error over a turn of {drawn} of 12 units")


def test_fine_patterns_have_eight_points_a_wave(many):
    fast = replace(many, common=(*many.common[:-1], many.common[-1]._replace(order=100.0)))
    (ax, *_) = fast.plot("patterns").figure.axes
    assert {line.get_xdata().size for line in ax.lines} == {801}


def test_the_charts_of_a_unit_have_each_their_statistic_and_its_limit(fleet):
    upper, lower = fleet.plot("history", unit="u5").figure.axes
    rows = [row for row in fleet.history if row.unit == "u5"]
    for ax, name, limit in (
        (upper, "statistic", rows[-1].limit),
        (lower, "cusum", rows[-1].cusum_limit),
    ):
        drawn = lines(ax)
        assert set(drawn["limit"][1]) == {limit}
        assert ax.get_ylim()[0] == 0.0
        highest = max(getattr(one, name) for row in rows for one in row.orders)
        assert ax.get_yscale() == ("symlog" if highest > 10.0 * limit else "linear")
        for k, order in enumerate((1, 2)):
            wanted = [getattr(row.orders[k], name) for row in rows]
            assert drawn[f"order {order}"][1].tolist() == pytest.approx(wanted)


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_windows_of_a_watched_joint(errors_in, per):
    angle, error = readings(60)
    error[PER * 50 :] += 0.004 * np.sin(4.0 * np.radians(angle[PER * 50 :]))
    windows = ta.Monitor(model()).windows_of(angle, error)
    upper, lower = watched_windows(windows, 360.0, errors_in).figure.axes
    sums, sizes = lines(upper), lines(lower)
    assert set(sums["limit"][1]) == {windows[0].limit}
    for k, order in enumerate((1, 2, 4)):
        assert sums[f"order {order}"][1].tolist() == [one.orders[k].statistic for one in windows]
        wanted = [per * one.orders[k].amplitude for one in windows]
        assert sizes[f"order {order}"][1].tolist() == pytest.approx(wanted)
        assert sizes[f"order {order}"][0].tolist() == [one.window for one in windows]
    alarms = [(one.window, one.statistic) for one in windows if one.alarm]
    assert list(zip(*sums["alarm"], strict=True)) == alarms != []


#: Share of a group's width left to each side of its orders, least width, and what is between.
MARGIN, LEAST, GAP = 0.06, 2.5, 1.0


@pytest.mark.parametrize("last", [3, 5, 17, 26])
def test_a_group_takes_the_root_of_its_span(last):
    orders = [*range(1, last + 1), 100, 101, 102]
    axis = OrderAxis.of(orders)
    assert axis.groups == [(1, last), (100, 102)]
    widths = [max(math.sqrt(last - 1), LEAST), LEAST]
    at = axis.places([1, last, 100, 102])
    inside = 1.0 - 2.0 * MARGIN
    assert at[1] - at[0] == pytest.approx(inside * widths[0])
    assert at[3] - at[2] == pytest.approx(inside * widths[1])
    assert at[2] - at[1] == pytest.approx(GAP + MARGIN * sum(widths))
    # Even within a group.
    assert axis.places(2) - at[0] == pytest.approx(inside * widths[0] / (last - 1))


matplotlib.use("Agg")

WORDS_SEED = 72_100
#: Of two mounts of 36 facets some are told apart better than others.
ORDERS = wanted_orders(100)
WORDS_UNITS = [("arcsec", 1.0), ("mrad", np.pi / 648.0)]
#: Digits in words: four, three and two of them.
FOUR, THREE, TWO = 6e-4, 6e-3, 6e-2


def words(ax, pattern: str) -> list[str]:
    found = re.search(pattern, plots.text_alternative(ax))
    assert found is not None, plots.text_alternative(ax)
    return list(found.groups())


@pytest.mark.parametrize(("errors_in", "per"), WORDS_UNITS)
def test_certified_errors(errors_in, per) -> None:
    rng = np.random.default_rng(WORDS_SEED)
    ax = certified_errors(
        [
            {"angle_deg": a, "error_arcsec": e, "expanded_arcsec": u}
            for a, e, u in zip(
                range(0, 360, 30), rng.normal(0, 20, 12), rng.uniform(1, 9, 12), strict=True
            )
        ],
        errors_in=errors_in,
    )
    (line,) = [one for one in ax.lines if one.get_marker() == "o"]
    bars = np.array([part[:, 1] for part in ax.containers[0].lines[2][0].get_segments()])
    drawn = [line.get_ydata().min(), line.get_ydata().max(), np.ptp(bars, axis=1).max() / 2.0]
    number = rf"(\S+) {errors_in}"
    said = words(ax, rf"from (\S+) to {number}, U at most {number}\.")
    assert [float(x) for x in said[:2]] == pytest.approx(drawn[:2], rel=FOUR)
    assert float(said[2]) == pytest.approx(drawn[2], rel=TWO)
    assert len(line.get_xdata()) == int(words(ax, r"Error at (\d+) positions")[0])


@pytest.mark.parametrize("orders", [ORDERS, [*ORDERS, 36]])
def test_noise_factors(orders) -> None:
    """Bars, and an order of as many facets that none of them shows."""
    ax = plots.plan_factors(ta.plan_mounts(100, 36, 2, orders=orders))
    heights = [bar.get_height() for bar in ax.patches]
    assert np.ptp(heights) > 0.01
    count, worst, unseen = words(
        ax, r"of (\d+) wanted orders, 1 is ideal: worst (\S+?)(?:; undetermined: (.*))?\.$"
    )
    assert float(worst) == pytest.approx(max(heights), rel=THREE)
    named = [text.get_text() for text in ax.get_xticklabels()]
    assert int(count) == len(named)
    blind = [named[round(note.xy[0])] for note in ax.texts]
    assert blind == ([] if unseen is None else unseen.split(", "))
    assert len(blind) == (36 in orders)


def test_positions_of_a_plan() -> None:
    plan = ta.plan_mounts(100, 24, 3)
    ax = plots.plan_positions(plan)
    positions, offsets = words(ax, r"of (\d+) positions: (.*) deg\.$")
    # The second of the five marks of a mount is its first position.
    drawn = [float(part.lines[0].get_xdata()[1]) for part in ax.containers]
    assert [float(x) for x in offsets.split(", ")] == pytest.approx(drawn, abs=6e-4)
    counted = [f"mount {i}: {offset}°" for i, offset in enumerate(offsets.split(", "), 1)]
    assert [mark.get_text() for mark in ax.get_yticklabels()] == counted
    steps = [np.diff(part.lines[0].get_xdata()) for part in ax.containers]
    np.testing.assert_allclose(steps, 360.0 / int(positions))
    rows = np.array([part.lines[0].get_ydata()[0] for part in ax.containers])
    low, high = ax.get_ylim()
    # Half a row and some of the next to both sides.
    assert (rows.min() - low, high - rows.max()) == pytest.approx((0.6, 0.6))


@pytest.mark.parametrize("grows", [True, False])
def test_sizes_named_in_a_rehearsal(grows: bool) -> None:
    """The dashed lines: the one of half of the trials stands at the less visible size."""
    tried = {-4: (0, 8), 0: (2, 8), 3: (6, 8), 6: (8, 8), 10: (8, 8), 14: (8, 8)}
    answers = [
        (step, TrialOutcome("named" if k < named else "nothing"))
        for step, (named, count) in tried.items()
        for k in range(count)
    ]
    cause = rehearsed_cause("x", "size", SizeRange(3.0, -16, 20, grows), answers, "", "")
    (ax,) = plots.detection(SimpleNamespace(causes=[cause])).axes
    dashed = sorted(float(line.get_xdata()[0]) for line in ax.lines if line.get_linestyle() == "--")
    assert len(dashed) == 2
    ((points, _, (bars,)),) = ax.containers
    assert bars.get_linewidth()[0] > 0.0
    entries = cause.to_dict()["tried"]
    ends = [segment[:, 1].tolist() for segment in bars.get_segments()]
    assert ends == [pytest.approx(entry["interval"]) for entry in entries]
    named = [entry["named"] / entry["trials"] for entry in entries]
    assert points.get_ydata() == pytest.approx(named)
    said = words(ax, r"by size: 50 % at (\S+), 95 % at (\S+)\.$")
    assert [float(x) for x in said] == pytest.approx(dashed if grows else dashed[::-1], rel=THREE)


@pytest.mark.parametrize(("errors_in", "per"), WORDS_UNITS)
def test_a_model_and_its_orders(errors_in, per) -> None:
    rng = np.random.default_rng(WORDS_SEED + 1)
    sizes = rng.normal(0.0, 30.0 / 3600.0, (2, 9))
    shaft = ta.Shaft("output", 1, range(1, 10), *sizes)
    model = ta.HarmonicModel([shaft], period=360.0)
    ax = plots.model_error(model, errors_in=errors_in)
    height, count = words(ax, rf"angle: (\S+) {errors_in} peak-to-peak in (\d+) orders")
    assert float(height) == pytest.approx(np.ptp(ax.lines[0].get_ydata()), rel=THREE)
    assert int(count) == 9
    theta = np.arange(0.0, 360.0, 2.0)
    noise = rng.normal(0.0, 1e-4, theta.size)
    run = ta.CalibrationRun(theta, theta + model.error(theta) + noise, 360.0)
    ax = plots.amplitude_spectrum(ta.fit(run, range(1, 10)), errors_in=errors_in)
    marks = ax.containers[0].lines[0]
    drawn = np.sort(marks.get_ydata())[::-1]
    said = re.findall(rf"\d+ \((\S+) {errors_in}\)", plots.text_alternative(ax))
    assert [float(x) for x in said] == pytest.approx(drawn[: len(said)], rel=THREE)
    assert len(said) > 3
