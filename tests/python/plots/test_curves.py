"""Numbers that pictures draw are those of the results, in the unit of the axis."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import binomtest, norm

import trueangle as ta
from trueangle import plots
from trueangle.certificate.typesetting import certified_errors
from trueangle.fitting.phases import run_phases
from trueangle.plots import curves
from trueangle.plots.canvas import plain_logarithms
from trueangle.plots.curves import Points
from trueangle.plots.diagnosispictures import error_left, gains
from trueangle.plots.planpictures import detection
from trueangle.plots.readingpictures import before_after_picture, residual_picture
from trueangle.rehearsal.result import RehearsedCause
from trueangle.support.display_units import error_unit

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

SEED = 54_100
PERIODS = (360.0, 2.0 * np.pi, 1.0)
#: Half width of a 95 % band: 1.96 of scipy's 1.959964.
NINETY_FIVE = 1e-4


def fitted(period=360.0):
    """Three runs, unlike in every condition: speed, load, temperature and direction."""
    rng = np.random.default_rng(SEED)
    runs = []
    for k, speed in enumerate((10.0, -25.0, 40.0)):
        time = np.arange(180) * 2.0 / abs(speed)
        theta = np.mod(speed * time, 360.0)
        error = 0.01 * np.sin(np.radians(theta) + 0.4) + rng.normal(0.0, 1e-3, theta.size)
        error += 0.004 * np.cos(np.radians(3.0 * theta))
        unit = period / 360.0
        runs.append(
            ta.CalibrationRun(
                theta * unit, (theta + error) * unit, period, time=time, label=f"r{k}",
                torque=np.linspace(k, k + 1.0, 180), temperature=20.0 + 3.0 * k,
            )
        )  # fmt: skip
    return ta.fit(runs, [1, 3], loss="linear")


@pytest.fixture(scope="module")
def fit():
    print("seed", SEED)
    return fitted()


@pytest.mark.parametrize("period", PERIODS)
def test_residuals_stand_at_the_signal_of_their_own_run(period):
    found = fitted(period)
    wanted = {
        "speed": lambda run: run.speed * 360.0 / period,
        "torque": lambda run: run.torque,
        "temperature": lambda run: run.temperature,
        "time": lambda run: run.time,
        "direction": lambda run: run.direction,
        "angle": lambda run: run.reference * 360.0 / period,
    }
    assert wanted.keys() == curves.SIGNALS.keys()
    for against, signal in wanted.items():
        parts = curves.residual_points(found, against)
        for part, run in zip(parts, found.runs, strict=True):
            np.testing.assert_allclose(part.x, signal(run), atol=1e-9)
        left = np.concatenate([part.y for part in parts])
        np.testing.assert_allclose(left, found.residuals * 1_296_000.0 / period, rtol=1e-9)
    means = [float(part.x.mean()) for part in curves.residual_points(found, "speed")]
    assert means == pytest.approx([10.0, -25.0, 40.0], rel=0.02)


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_bands_and_intervals_hold_95_percent(fit, errors_in, per):
    ax = plots.model_error(fit.model, errors_in=errors_in)
    angle, error = ax.lines[0].get_data()
    half = norm.ppf(0.975) * fit.model.band(angle) * 3600.0 * per
    wanted = (fit.model.error(angle) - fit.model.constant) * 3600.0 * per
    np.testing.assert_allclose(error, wanted, atol=1e-9)
    (band,) = ax.collections
    edges = {}
    for x, y in band.get_paths()[0].vertices:
        edges.setdefault(round(float(x), 6), set()).add(float(y))
    for k in (5, 100, 300):
        low, high = min(edges[round(angle[k], 6)]), max(edges[round(angle[k], 6)])
        assert (high - low) / 2.0 == pytest.approx(half[k], rel=NINETY_FIVE)
    bars = plots.amplitude_spectrum(fit, errors_in=errors_in).containers[0].lines[2][0]
    ends = np.array([segment[:, 1] for segment in bars.get_segments()])
    order = np.argsort(fit.orders)
    half = norm.ppf(0.975) * fit.amplitude_std[order] * 3600.0 * per
    np.testing.assert_allclose(np.diff(ends)[:, 0] / 2.0, half, rtol=NINETY_FIVE)
    np.testing.assert_allclose(ends.mean(axis=1), fit.amplitudes[order] * 3600.0 * per)


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_phases_of_runs_and_their_mean(fit, errors_in, per):
    ax = plots.phases_over_runs(fit, errors_in=errors_in)
    found = sorted(run_phases(fit), key=lambda p: p.order)
    for order, dots, mean in zip(found, ax.lines[::2], ax.lines[1::2], strict=True):
        own = order.amplitude * np.exp(1j * order.phase)
        drawn = dots.get_ydata() * np.exp(1j * dots.get_xdata())
        np.testing.assert_allclose(drawn, per * own, atol=1e-9)
        end = mean.get_ydata()[1] * np.exp(1j * mean.get_xdata()[1])
        np.testing.assert_allclose(end, per * own.mean(), atol=1e-9)
    # Runs keep their numbers where one of two readings is left out.
    theta = np.arange(0.0, 360.0, 5.0)
    error = 0.1 * np.sin(np.radians(theta))
    runs = [ta.CalibrationRun(x, x + e, 360.0) for x, e in
            ((theta, error), (theta[:2], error[:2]), (theta, error))]  # fmt: skip
    assert run_phases(ta.fit(runs, [1]))[0].labels == ("1", "3")


def test_gains_end_at_both_ends_of_their_intervals():
    def finding(cause, share, low, high):
        gain = SimpleNamespace(reducible_share=share, interval=(low, high))
        return SimpleNamespace(cause=cause, gain=gain, parameters={}, confirmed=True)

    rows = [("backlash", 0.6, 0.35, 0.8), ("latency", 0.25, 0.2, 0.45)]
    diagnosis = SimpleNamespace(findings=[finding(*row) for row in rows])
    ax = gains(diagnosis)
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([60.0, 25.0])
    bars = ax.containers[-1].lines[2][0].get_segments()
    assert [segment[:, 0].tolist() for segment in bars] == [
        pytest.approx([100.0 * low, 100.0 * high]) for _, _, low, high in rows
    ]


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_what_is_left_with_all_causes_and_without_each(errors_in, per):
    def finding(cause, before, share):
        # Rms, peak-to-peak and largest error of the readings held out.
        gain = SimpleNamespace(before=(before, 5.0 * before, 3.0 * before), after=(4.0, 19.0, 11.0),
                               reducible_share=share)  # fmt: skip
        return SimpleNamespace(cause=cause, gain=gain, parameters={})

    found = [finding("backlash", 30.0, 0.6), finding("tilt", 12.0, None), finding("lag", 7.0, 0.2)]
    ax = error_left(SimpleNamespace(findings=found, noise=3.0), errors_in=errors_in)
    names = [mark.get_text() for mark in ax.get_yticklabels()]
    assert names == ["with all causes", "without backlash", "without lag"]
    assert ax.yaxis_inverted()  # as a list, from the top down
    *dots, noise = ax.lines
    drawn = np.concatenate([line.get_xdata() for line in dots])
    assert drawn == pytest.approx([4.0 * per, 30.0 * per, 7.0 * per])
    assert noise.get_xdata()[0] == pytest.approx(3.0 * per)


@pytest.mark.parametrize("low", [0.1, 0.27, 0.6, 4.0, 55.0])
@pytest.mark.parametrize("span", [2.0, 3.1, 9.0, 17.0, 40.0, 300.0, 2e4, 3e6])
def test_sizes_are_marked_evenly_on_their_logarithmic_axis(low, span):
    """Of 1, 2 and 5 a decade, of 1 and 3, of 1: at most four, and none far from the next."""
    _, ax = matplotlib.pyplot.subplots()
    ax.set_xscale("log")
    ax.set_xlim(low, span * low)
    plain_logarithms(ax, "x", 4)
    marks = ax.get_xticks()
    assert 1 <= marks.size <= 4
    assert low * (1.0 - 1e-9) <= marks.min() <= marks.max() <= span * low * (1.0 + 1e-9)
    assert [float(t.get_text()) for t in ax.get_xticklabels()] == pytest.approx(marks, rel=5e-3)
    gaps = np.diff(np.log10(marks))
    # From 2 to 5 and from 1 to 2.
    assert gaps.size == 0 or gaps.max() / gaps.min() < 1.001 * np.log10(2.5) / np.log10(2.0)
    if span >= 9.0:
        assert marks.size >= 2


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_certified_errors_have_bars_of_their_expanded_uncertainty(errors_in, per):
    positions = [
        {"angle_deg": 30.0 * k, "error_arcsec": 4.0 * k - 20.0, "expanded_arcsec": 1.0 + 0.2 * k}
        for k in range(12)
    ]
    ax = certified_errors(positions, errors_in=errors_in)
    (bars,) = ax.containers[0].lines[2]
    for segment, row in zip(bars.get_segments(), positions, strict=True):
        error, expanded = (per * row[f"{name}_arcsec"] for name in ("error", "expanded"))
        assert segment[:, 0].tolist() == [row["angle_deg"]] * 2
        assert segment[:, 1].tolist() == pytest.approx([error - expanded, error + expanded])


def test_shares_named_have_their_binomial_intervals():
    tried = {2.0: (3, 20), 4.0: (11, 25), 8.0: (20, 20)}
    cause = RehearsedCause("backlash", "half width / arcsec", tried, 4.5, None, {}, {}, {}, {})
    (ax,) = detection(SimpleNamespace(causes=[cause])).axes
    container = ax.containers[0]
    size, share = container.lines[0].get_data()
    assert (size.tolist(), share.tolist()) == ([2.0, 4.0, 8.0], [0.15, 0.44, 1.0])
    for segment, (named, count) in zip(
        container.lines[2][0].get_segments(), tried.values(), strict=True
    ):
        exact = binomtest(named, count).proportion_ci(method="wilson")
        assert segment[:, 1].min() == pytest.approx(exact.low, abs=0.05)
        assert segment[:, 1].max() == pytest.approx(exact.high, abs=0.05)
    assert [line.get_xdata()[0] for line in ax.lines if line.get_linestyle() == "--"] == [4.5]


@pytest.mark.parametrize(("unit", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_sizes_are_told_about_nought_and_what_is_left_by_its_deviation(fit, unit, per):
    """A zero that is left counts in the rms of held-out runs."""
    before = Points("a", np.arange(4.0), np.array([300.0, 500.0, 300.0, 500.0]))
    after = Points("a", np.arange(4.0), np.array([1.0, -1.0, 3.0, 1.0]))
    picture = before_after_picture([(0, before, after)], (0.0, 360.0), error_unit(unit))
    told = re.findall(r"rms (\S+), peak-to-peak (\S+) ", picture.told)
    wanted = [(np.sqrt(170_000.0), 200.0), (np.sqrt(3.0), 4.0)]
    for numbers, sizes in zip(told, wanted, strict=True):
        assert [float(x) for x in numbers] == pytest.approx(per * np.array(sizes), rel=6e-4)
    picture = residual_picture(fit, "torque", error_unit(unit))
    found = re.search(r"leaves of (\d+) readings against torque: (\S+) \S+ rms", picture.told)
    assert int(found[1]) == fit.residuals.size
    rms = np.sqrt(np.mean(np.square(fit.residuals)))
    assert float(found[2]) == pytest.approx(per * 3600.0 * rms, rel=6e-3)


matplotlib.use("Agg")


@pytest.fixture(scope="module")
def stepper() -> list[ta.CalibrationRun]:
    """Steps of a motor: order 4 of degrees, and many small ones that few positions confuse."""
    theta = np.arange(0.0, 360.0, 1.8)
    rng = np.random.default_rng(20261122)
    angle = np.radians(theta)
    error = 7.4 * np.sin(4.0 * angle)
    for order in (1, 2, 3, 5, 6, 8, 12, 16, 20, 41, 43, 44, 45, 46):
        error += rng.uniform(0.02, 0.2) * np.sin(order * angle + rng.uniform(0.0, 6.0))
    return [
        ta.CalibrationRun(theta, theta + error + rng.normal(0.0, 1e-3, theta.size), 360.0)
        for _ in range(4)
    ]


def test_aliases_of_neighbours_do_not_stand_on_each_other(stepper) -> None:
    ax = ta.select_orders(stepper).plot()
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) >= 4
    for number, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[number + 1 :])
    matplotlib.pyplot.close(ax.figure)


def test_small_orders_of_a_gear_do_not_widen_the_model_to_a_ribbon(stepper) -> None:
    """Where low orders are steep, an envelope is as wide as they rise within its places."""
    fit = ta.fit(stepper, [1, 2, 3, 4, 5, 6, 8, 12, 16, 20, 41, 43])
    ax = plots.error_curves(fit)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "model" in names
    assert "envelope of the model" not in names
    matplotlib.pyplot.close(ax.figure)


def test_long_names_leave_room_for_the_picture() -> None:
    """Five names of some length once made a legend of one line that left no axes."""
    theta = np.arange(20.0, 80.0, 1.5)
    noise = np.random.default_rng(3).normal(0.0, 0.002, (5, theta.size))
    runs = [
        ta.CalibrationRun(theta, theta + e, 360.0, label=f"{'a rather long label ' * 4}{i}")
        for i, e in enumerate(noise)
    ]
    ax = ta.fit(runs, [3]).plot("residuals")
    figure = ax.figure
    figure.canvas.draw()
    assert ax.bbox.width > 0.8 * figure.bbox.width
    box = ax.get_legend().get_window_extent()
    assert figure.bbox.x0 <= box.x0
    assert box.x1 <= figure.bbox.x1
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(set(names)) == 5  # what is left out is in the middle
    matplotlib.pyplot.close(figure)
