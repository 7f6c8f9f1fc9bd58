"""What the words of a picture say are the numbers that it draws, read off its own axes."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle import plots
from trueangle.certificate.typesetting import certified_errors
from trueangle.planning import wanted_orders
from trueangle.rehearsal.detection import SizeRange
from trueangle.rehearsal.result import rehearsed_cause
from trueangle.rehearsal.trial import TrialOutcome

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

SEED = 72_100
#: Of two mounts of 36 facets some are told apart better than others.
ORDERS = wanted_orders(100)
UNITS = [("arcsec", 1.0), ("mrad", np.pi / 648.0)]
#: Digits in words: four, three and two of them.
FOUR, THREE, TWO = 6e-4, 6e-3, 6e-2


@pytest.fixture(autouse=True)
def _closed():
    yield
    from matplotlib import pyplot

    pyplot.close("all")


def words(ax, pattern: str) -> list[str]:
    found = re.search(pattern, plots.text_alternative(ax))
    assert found is not None, plots.text_alternative(ax)
    return list(found.groups())


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_certified_errors(errors_in, per) -> None:
    rng = np.random.default_rng(SEED)
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
        ax, r"of (\d+) wanted orders: worst (\S+?)(?:; undetermined: (.*))?\.$"
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


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_a_model_and_its_orders(errors_in, per) -> None:
    rng = np.random.default_rng(SEED + 1)
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
