"""Pictures: what they show is what the results say, every axis has a unit."""

from __future__ import annotations

import sys
from itertools import pairwise

import numpy as np
import pytest

import trueangle as ta
from trueangle import plots, simulation
from trueangle.diagnosis.factors.factor import Factor, FactorCurve
from trueangle.errors import ArgumentError, MissingExtraError, RankError
from trueangle.fitting.phases import run_phases
from trueangle.planning import plan_mounts, plan_tilts
from trueangle.plots import curves, palette
from trueangle.plots.amplitudespectrum import OrderAxis
from trueangle.plots.diagnosispictures import draw_factor, factor_title
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation
from trueangle.support.display_units import error_unit, significant_digits

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

#: Labels of axes must end with "/ unit" or name a pure number or category.
UNITS = ("/ deg", "/ arcsec", "/ s", "/ (deg/s)", "/ °C", "/ Nm", "/ cycles per output turn")
UNITLESS = ("direction of travel", "standard error (1 = ideal)")


@pytest.fixture(scope="module")
def runs() -> list[ta.CalibrationRun]:
    sim = Simulation(
        Joint(100.0, "circular_spline", "motor"),
        harmonics=(Harmonic("output", 1, 14.1, 243.75), Harmonic("motor", 1, 18.0, 46.5)),
        sigma_arcsec=2.0,
        runs=tuple(RunDesign(label=f"r{i}", direction=(-1) ** i, samples=180) for i in range(4)),
    )
    return ta.simulate(sim, seed=3)


@pytest.fixture(scope="module")
def fit(runs: list[ta.CalibrationRun]) -> ta.FitResult:
    return ta.fit(runs[:3], {"output": [1, 2], "motor": [1]}, gear_ratio=100)


def check_labels(ax) -> None:
    labels = [ax.get_xlabel(), ax.get_ylabel()]
    if ax.name == "polar":
        labels = labels[:1]
    for label in labels:
        assert label in UNITLESS or any(unit in label for unit in UNITS), label
    # Axes among others have captions of theirs.
    assert bool(ax.get_title()) == (len(ax.figure.axes) == 1)


def legend_texts(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


def nothing_clipped(ax) -> None:
    """Every text lies inside the figure."""
    figure = ax.figure
    figure.canvas.draw()
    frame = figure.bbox
    low, high = sorted(ax.get_ylim())
    ticks = [t for t in ax.get_yticklabels() if low <= t.get_position()[1] <= high]
    texts = [ax.xaxis.label, ax.yaxis.label, *ticks]
    texts += list(ax.texts) + (list(ax.get_legend().get_texts()) if ax.get_legend() else [])
    for text in texts:
        if not (text.get_text() and text.get_visible()):
            continue
        box = text.get_window_extent()
        assert frame.x0 - 1 <= box.x0 < box.x1 <= frame.x1 + 1, text.get_text()
        assert frame.y0 - 1 <= box.y0 < box.y1 <= frame.y1 + 1, text.get_text()


def test_gear_orders_are_drawn_as_an_envelope(fit: ta.FitResult) -> None:
    ax = plots.error_curves(fit)
    check_labels(ax)
    assert legend_texts(ax) == ["run r0", "run r1", "run r2", "envelope of the model"]
    (band,) = ax.collections
    drawn = band.get_paths()[0].vertices[:, 1]
    curve = curves.model_curve(fit.model)
    assert drawn.max() == pytest.approx(curve.error.max())
    assert drawn.min() == pytest.approx(curve.error.min())
    angle, least, most = curves.curve_envelope(curve)
    near = np.abs(curve.angle[:, None] - angle).argmin(axis=1)
    # Places that lie between two parts may belong to either.
    inside = (curve.error >= least[near]) & (curve.error <= most[near])
    assert inside.mean() > 0.95


def test_error_curves_show_readings_model_and_band(runs: list[ta.CalibrationRun]) -> None:
    fit = ta.fit(runs[:3], [1, 2])
    ax = plots.error_curves(fit)
    check_labels(ax)
    nothing_clipped(ax)
    assert legend_texts(ax) == ["run r0", "run r1", "run r2", "model", "95 % band"]
    model = ax.lines[3]
    angle, error = model.get_data()
    expected = 3600.0 * (fit.model.error(angle) - fit.model.constant)
    np.testing.assert_allclose(error, expected, atol=1e-9)
    # The readings are the residuals about that model.
    x, y = ax.lines[0].get_data()
    left = y - 3600.0 * (fit.model.error(x) - fit.model.constant)
    np.testing.assert_allclose(left, 3600.0 * fit.residuals[: x.size], atol=1e-6)


def test_readings_are_the_same_in_every_unit(runs: list[ta.CalibrationRun]) -> None:
    shown = []
    for scale, period in ((1.0, 360.0), (1.0 / 360.0, 1.0)):
        scaled = [
            ta.CalibrationRun(r.reference * scale, r.indicated * scale + 0.3 * period, period)
            for r in runs[:2]
        ]
        shown.append(curves.error_points(ta.fit(scaled, [1, 2], loss="linear")))
    for a, b in zip(*shown, strict=True):
        np.testing.assert_allclose(a.x, b.x, atol=1e-9)
        np.testing.assert_allclose(a.y, b.y, atol=1e-6)


def test_spectrum_of_a_fit_shows_amplitudes_in_order(fit: ta.FitResult) -> None:
    ax = plots.amplitude_spectrum(fit)
    check_labels(ax)
    nothing_clipped(ax)
    dots = ax.containers[0].lines[0].get_ydata()
    np.testing.assert_allclose(dots, 3600.0 * fit.amplitudes[np.argsort(fit.orders)])
    assert [t.get_text() for t in ax.get_xticklabels()] == ["1", "2", "100"]
    assert ax.get_yscale() == "log"


def test_phases_of_systematic_orders_stay_together(fit: ta.FitResult) -> None:
    ax = plots.phases_over_runs(fit)
    check_labels(ax)
    found = {p.order: p for p in run_phases(fit)}
    # Order 100, 18 arcsec at 46.5 deg; noise 2 arcsec over 180 readings: 0.7 deg per run.
    np.testing.assert_allclose(np.degrees(found[100.0].phase), 46.5, atol=4.0)
    np.testing.assert_allclose(found[100.0].amplitude, 18.0, atol=1.0)


def test_phases_refuse_runs_that_hold_no_order_alone() -> None:
    theta = np.linspace(0.0, 350.0, 4)
    run = ta.CalibrationRun(theta, theta + 0.1, period=360.0)
    other = ta.CalibrationRun(theta + 40.0, theta + 40.1, period=360.0)
    result = ta.fit([run, other], [1, 2], loss="linear")
    with pytest.raises(RankError, match="no run alone determines"):
        plots.phases_over_runs(result)


def test_before_after_states_rms_and_peak_to_peak(fit: ta.FitResult, runs) -> None:
    ax = plots.before_after(fit.model, runs[3:])
    check_labels(ax)
    nothing_clipped(ax)
    left = 3600.0 * (fit.model.correct(runs[3].indicated) - runs[3].reference)
    left -= left.mean()
    rms, ptp = np.sqrt(np.mean(left**2)), np.ptp(left)
    assert (
        legend_texts(ax)[1]
        == f"after: rms {significant_digits(rms)}, peak-to-peak {significant_digits(ptp)} arcsec"
    )
    assert rms < 2.5


def test_before_after_refuses_another_unit(fit: ta.FitResult) -> None:
    run = ta.CalibrationRun([0.0, 0.5], [0.0, 0.5], period=1.0)
    with pytest.raises(ArgumentError, match="period 1, the model 360"):
        plots.before_after(fit.model, run)


@pytest.mark.parametrize("against", sorted(curves.SIGNALS))
def test_residuals_against_every_signal(fit: ta.FitResult, against: str) -> None:
    ax = plots.residuals(fit, against)
    check_labels(ax)
    nothing_clipped(ax)
    if against != "direction":
        shown = np.concatenate([line.get_ydata() for line in ax.lines[:3]])
        np.testing.assert_allclose(shown, 3600.0 * fit.residuals, atol=1e-9)


def test_residuals_refuse_unknown_and_missing_signals() -> None:
    theta = np.arange(0.0, 360.0, 10.0)
    result = ta.fit(ta.CalibrationRun(theta, theta + 0.1, period=360.0), [1], loss="linear")
    with pytest.raises(ArgumentError, match="no run has temperature"):
        plots.residuals(result, "temperature")
    with pytest.raises(ArgumentError, match="against must be one of"):
        plots.residuals(result, "colour")


def test_many_runs_put_the_legend_beside(runs) -> None:
    many = [ta.CalibrationRun(r.reference, r.indicated, 360.0) for r in runs for _ in range(3)]
    ax = plots.error_curves(ta.fit(many, [1], loss="linear"))
    nothing_clipped(ax)
    ax.figure.canvas.draw()
    assert ax.get_legend().get_window_extent().x0 >= ax.get_window_extent().x1


def test_partial_travel_is_drawn_where_it_was_seen() -> None:
    theta = np.mod(np.linspace(-90.0, 90.0, 400), 360.0)
    run = ta.CalibrationRun(theta, theta + 0.1 * np.sin(np.radians(theta)), period=360.0)
    ax = plots.error_curves(ta.fit(run, [1], loss="linear"))
    low, high = ax.get_xlim()
    assert high - low == pytest.approx(180.0, abs=1.0)
    x = ax.lines[0].get_xdata()
    assert x.min() >= low - 1e-6
    assert x.max() <= high + 1e-6


@pytest.mark.parametrize("make", [lambda: plan_mounts(100, 36, 3), lambda: plan_tilts(100)])
def test_plan_pictures(make) -> None:
    plan = make()
    positions, factors = plots.plan_positions(plan), plots.plan_factors(plan)
    for ax in (positions, factors):
        check_labels(ax) if ax is factors else None
        nothing_clipped(ax)
    heights = [patch.get_height() for patch in factors.patches]
    np.testing.assert_allclose(heights, [f for f in plan.noise_factors.values() if f < np.inf])


def test_given_axes_are_drawn_on_and_returned(fit: ta.FitResult) -> None:
    from matplotlib import pyplot

    _, ax = pyplot.subplots()
    assert plots.error_curves(fit, ax=ax) is ax
    assert fit.plot("residuals", ax=ax, against="time") is ax
    with pytest.raises(ArgumentError, match="kind must be one of"):
        fit.plot("pie")


#: Least contrast of a mark with its paper (WCAG 1.4.11), and the papers: white, black.
CONTRAST = 3.0
PAPERS = (1.0, 0.0)

#: Linear RGB as who lacks red or green receptors sees it (Viénot, Brettel, Mollon 1999).
BLINDNESS = {
    "protanopia": [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]],
    "deuteranopia": [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]],
}


def linear(colour: str) -> np.ndarray:
    c = np.array(matplotlib.colors.to_rgb(colour))
    return np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)


def luminance(colour: str) -> float:
    return float(linear(colour) @ [0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("colour", sorted({*palette.RUNS, palette.BEFORE, palette.AFTER,
                                           palette.WARNING, palette.MUTED}))  # fmt: skip
def test_colours_stand_out_of_white_and_of_black_paper(colour: str) -> None:
    for paper in PAPERS:
        high, low = sorted((luminance(colour), paper), reverse=True)
        assert (high + 0.05) / (low + 0.05) >= CONTRAST


@pytest.mark.parametrize("kind", [None, *BLINDNESS])
def test_runs_next_to_each_other_are_told_apart(kind: str | None) -> None:
    """By colour as the colour-blind see it, and by a marker of their own for grey print."""
    assert len(set(palette.RUNS)) == len(set(palette.MARKERS)) == len(palette.RUNS)
    seen = [linear(colour) for colour in palette.RUNS]
    if kind is not None:
        seen = [np.array(BLINDNESS[kind]) @ colour for colour in seen]
    for one, other in pairwise(seen):
        assert np.abs(one - other).max() > 0.1


def test_before_and_after_differ_in_grey() -> None:
    assert luminance(palette.BEFORE) > 1.5 * luminance(palette.AFTER)


def test_ink_follows_the_paper() -> None:
    from matplotlib import pyplot

    with pyplot.style.context("dark_background"):
        _, dark = pyplot.subplots()
    _, light = pyplot.subplots()
    assert (palette.ink(dark), palette.ink(light)) == ("#FFFFFF", "#000000")


def test_missing_matplotlib_is_named(fit: ta.FitResult, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtraError, match=r"trueangle\[plot\]"):
        plots.error_curves(fit)


@pytest.fixture(scope="module")
def selection(runs: list[ta.CalibrationRun]) -> ta.OrderSelection:
    return ta.select_orders(runs, gear_ratio=100)


def test_an_amplitude_beyond_its_threshold_is_an_order_that_is_retained(selection) -> None:
    for row in selection.table:
        assert np.isfinite(row.needed)
        assert (row.amplitude >= row.needed) == row.retained, row.order
    # Least is needed of orders known of shafts; then the less the lower among those of a shaft.
    needed = {row.order: row.needed / row.standard_error for row in selection.table}
    assert [needed[k] for k in (1, 2, 4, 100, 200, 400)] == pytest.approx([3.1] * 6, abs=0.1)
    rising = [needed[k] for k in (400, 101, 202, 3, *range(5, 18), 201)]
    assert rising == sorted(rising)
    assert rising[3] == pytest.approx(needed[300], rel=1e-3)


def test_spectrum_of_a_selection_marks_the_retained(selection) -> None:
    ax = selection.plot()
    check_labels(ax)
    nothing_clipped(ax)
    kept = [row for row in selection.table if row.retained]
    np.testing.assert_allclose(
        ax.containers[0].lines[0].get_ydata(), [3600.0 * row.amplitude for row in kept]
    )
    assert "retained" in legend_texts(ax)
    assert "needed to be significant" in legend_texts(ax)


def test_spectrum_names_the_aliases_of_folded_orders() -> None:
    theta = np.arange(0.0, 360.0, 10.0)
    rng = np.random.default_rng(0)
    runs = [
        ta.CalibrationRun(
            theta, theta + 0.01 * np.sin(np.radians(14 * theta)) + rng.normal(0, 1e-4, 36), 360.0
        )
        for _ in range(3)
    ]
    ax = ta.select_orders(runs, gear_ratio=100).plot()
    nothing_clipped(ax)
    assert any("202" in text.get_text() for text in ax.texts)


@pytest.fixture(scope="module")
def diagnosed():
    sim = Simulation(
        harmonics=(Harmonic("output", 1, 20.0, 30.0),),
        sigma_arcsec=2.0,
        runs=tuple(
            RunDesign(samples=120, turns=2.0, reversals=(0.5,), speed_deg_s=speed)
            for speed in (5.0, 30.0, 5.0, 30.0)
        ),
    )
    runs = ta.simulate(sim.with_effects([simulation.Backlash(6.0)]), seed=2)
    return ta.diagnose(runs, sim), runs, sim


def test_diagnosis_pictures(diagnosed) -> None:
    diagnosis, runs, sim = diagnosed
    gains = diagnosis.plot()
    left = plots.error_left(diagnosis)
    compared = plots.measured_and_simulated(runs, sim)
    for ax in (gains, left, compared):
        nothing_clipped(ax)
    gain = diagnosis.findings[0].gain
    assert gains.patches[0].get_width() == pytest.approx(100.0 * gain.reducible_share)
    # With all causes, then without this one: the numbers of its gain.
    after, before = (float(line.get_xdata()[0]) for line in left.lines[:2])
    assert (before, after) == (gain.before[0], gain.after[0])
    # Backlash of 6 and noise of 2 arcsec before, the noise after.
    assert before == pytest.approx(np.hypot(6.0, 2.0), rel=0.1)
    assert after == pytest.approx(2.0, rel=0.1)
    assert legend_texts(compared) == ["measured", "simulated", "difference, moved down"]
    # Lines of another shaft are an envelope: the places of the output would make them an alias.
    value = 33.0 * np.sin(np.radians(202.0 * np.linspace(0.0, 360.0, 73) + 20.0))
    curve = FactorCurve(np.linspace(0.0, 360.0, 73), "deg", value, value - 1.0, value + 1.0)
    factor = Factor("place", "motor", (2.0,), 23.0, 22.0, 24.0, 0.9, 40.0, ("a_b",), (), curve)
    draw_factor(ax := matplotlib.figure.Figure().subplots(), factor, error_unit("arcsec"))
    ends = ax.collections[0].get_datalim(ax.transData).intervaly / np.abs(value).max()
    np.testing.assert_allclose([*ax.lines[0].get_ydata(), *ends], [*np.zeros(73), -1.0, 1.0])
    assert factor_title(factor) == "place of the motor (order 2): a b"


def test_diagnosis_without_findings_has_no_gain_to_draw(diagnosed) -> None:
    _, _, sim = diagnosed
    nothing = ta.diagnose(ta.simulate(sim, seed=1), sim)
    assert nothing.findings == []
    with pytest.raises(ArgumentError, match="no finding"):
        nothing.plot()


def pictures(fit, runs, diagnosed, selection):
    diagnosis, simulated_runs, sim = diagnosed
    plan = plan_mounts(100, 36, 2)
    return {
        "errors": lambda ax=None: plots.error_curves(fit, ax),
        "spectrum": lambda ax=None: plots.amplitude_spectrum(fit, ax),
        "selection": lambda ax=None: selection.plot(ax),
        "held out": lambda ax=None: plots.before_after(fit.model, runs[3:], ax),
        "residuals": lambda ax=None: plots.residuals(fit, ax=ax),
        "simulated": lambda ax=None: plots.measured_and_simulated(simulated_runs, sim, ax),
        "left": lambda ax=None: plots.error_left(diagnosis, ax),
        "gains": lambda ax=None: plots.gains(diagnosis, ax),
        "positions": lambda ax=None: plots.plan_positions(plan, ax),
        "factors": lambda ax=None: plots.plan_factors(plan, ax),
        "phases": lambda ax=None: plots.phases_over_runs(fit, ax),
    }


def test_every_picture_says_what_is_seen(fit, runs, diagnosed, selection) -> None:
    for name, draw in pictures(fit, runs, diagnosed, selection).items():
        text = plots.text_alternative(draw())
        assert text.endswith("."), name
        assert any(letter.isdigit() for letter in text), f"{name}: {text}"


def test_legends_cover_no_neighbour(fit, runs, diagnosed, selection) -> None:
    """Six pictures in one figure, a fit of many runs among them."""
    from matplotlib import pyplot

    many = [ta.CalibrationRun(r.reference, r.indicated, 360.0) for r in runs for _ in range(3)]
    drawn = pictures(ta.fit(many, [1], loss="linear"), runs, diagnosed, selection)
    figure, axes = pyplot.subplots(2, 3, figsize=(13.0, 7.0), layout="constrained")
    names = ["errors", "selection", "held out", "residuals", "simulated", "spectrum"]
    for ax, name in zip(axes.flat, names, strict=True):
        drawn[name](ax)
    figure.canvas.draw()
    for ax in axes.flat:
        box = ax.get_legend().get_window_extent()
        for other in axes.flat:
            if other is not ax:
                assert not box.overlaps(other.get_tightbbox())
        assert box.y1 <= ax.get_window_extent().y1 + 1.0


def test_the_axis_of_orders_is_broken_between_the_groups(selection) -> None:
    ax = selection.plot()
    axis = OrderAxis.of([float(row.order) for row in selection.table])
    assert len(axis.groups) >= 3
    place = axis.places([1, 2, 17, 100, 101])
    assert place[1] - place[0] == pytest.approx((place[2] - place[0]) / 16)
    assert place[3] > place[2]
    # Dots use the width: the last group ends near the right border.
    last = max(max(drawn.lines[0].get_xdata()) for drawn in ax.containers)
    low, high = ax.get_xlim()
    assert (last - low) / (high - low) > 0.9
    assert sum(line.get_label() == "_break" for line in ax.lines) == 2 * (len(axis.groups) - 1)


def test_ticks_of_orders_do_not_overlap(selection) -> None:
    ax = selection.plot()
    ax.figure.canvas.draw()
    boxes = [label.get_window_extent() for label in ax.get_xticklabels() if label.get_text()]
    assert all(a.x1 < b.x0 for a, b in pairwise(boxes))


def test_completion_shows_functions_and_no_modules() -> None:
    import inspect

    from trueangle import plots

    assert dir(plots) == sorted(plots.__all__)
    assert not any(inspect.ismodule(getattr(plots, name)) for name in dir(plots))


def test_an_unknown_picture_is_refused_with_those_there_are() -> None:
    # Lists are taken, by their types too.
    run = ta.CalibrationRun([0.0, 90.0, 180.0, 270.0], [0.1, 90.0, 180.0, 270.0], 360.0)
    fit = ta.fit([run], orders=[1])
    with pytest.raises(ArgumentError, match="errors, spectrum, phases, residuals, got 'foo'"):
        fit.plot("foo")  # type: ignore[arg-type]
