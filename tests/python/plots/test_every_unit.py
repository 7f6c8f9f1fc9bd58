"""Pictures, pages and words are the same whichever unit the readings are in."""

from __future__ import annotations

import json

import numpy as np
import pytest

import trueangle as ta
from transcripts.figures import figure_marks
from trueangle import plots
from trueangle.effects import Backlash
from trueangle.reports.robot import fitted_rank
from trueangle.reports.watched import WatchReport
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

SEED = 91_300
PERIODS = {"rad": 2.0 * np.pi, "turn": 1.0, "count": 4096.0}
#: Readings of some 1e-3 deg are differences of angles: ten digits fewer than a double has.
NEAR = 1e-5


def measured(period: float) -> list[ta.CalibrationRun]:
    """Four runs there and back over an arc, of two speeds, loads and temperatures."""
    rng, unit = np.random.default_rng(SEED), period / 360.0
    runs = []
    for k, speed in enumerate((20.0, -20.0, 60.0, -60.0)):
        time = np.arange(120) * 2.0 / abs(speed)
        theta = (200.0 if speed < 0.0 else -40.0) + speed * time
        time = time + 0.3 / abs(speed) * np.sin(np.arange(120.0))  # no two steps of one speed
        error = 0.01 * np.sin(np.radians(theta) + 0.4) + 0.004 * np.cos(np.radians(3.0 * theta))
        error += rng.normal(0.0, 1e-3, theta.size) + 0.5 * k
        runs.append(
            ta.CalibrationRun(
                theta * unit, (theta + error) * unit, period, time=time, label=f"r{k}",
                torque=float(k), temperature=20.0 + 3.0 * k, mount=10.0 * k * unit, unit=f"u{k}",
            )
        )  # fmt: skip
    return runs


def drawn(period: float) -> dict[str, object]:
    """Every picture of them."""
    runs = measured(period)
    fit = ta.fit(runs[:3], [1, 3], loss="linear")
    fleet = ta.fleet(runs, orders=[1, 3])
    simulation = ta.Simulation(sigma_arcsec=4.0)
    angle = np.arange(0.0, 40.0, 1.0 / 36.0)
    sizes = fit.model.error(angle * period) + 1e-6 * period * np.sin(np.arange(angle.size) ** 2)
    windows = ta.Monitor(fit.model).windows_of(angle * period, sizes)
    found = {
        **{kind: fit.plot(kind) for kind in ("errors", "spectrum", "phases")},
        **{s: fit.plot("residuals", against=s) for s in plots.curves.SIGNALS},
        "selection": ta.select_orders(runs, [1, 2, 3]).plot(),
        "model": fit.model.plot(),
        "held out": plots.before_after(fit.model, runs[3:]),
        "simulated": plots.measured_and_simulated(runs, simulation),
        **{f"fleet {kind}": fleet.plot(kind) for kind in ("overview", "patterns", "sizes")},
        "windows": plots.watched_windows(windows, period),
        "words": WatchReport(windows, period).summary(),
        "rank": fitted_rank("a", runs, fit)[1:],
    }
    return {name: seen(one) if hasattr(one, "figure") else one for name, one in found.items()}


def seen(ax) -> tuple[list[str], list[np.ndarray]]:
    """Words and marks of a picture, which is closed."""
    figure, told = ax.figure, []
    for one in figure.axes:
        legend = one.get_legend()
        # As everywhere in the pictures: a frame would look like one more thing drawn.
        assert legend is None or not legend.get_frame_on()
        names = [t.get_text() for t in legend.get_texts()] if legend else []
        told += [one.get_title(), one.get_xlabel(), one.get_ylabel(), one.get_label(), *names]
    marks = [points for one in figure.axes for *_, points in figure_marks(one)]
    matplotlib.pyplot.close(figure)
    return told, marks


@pytest.fixture(scope="module")
def degrees():
    print("seed", SEED)
    return drawn(360.0)


@pytest.mark.parametrize("unit", PERIODS)
def test_pictures_are_alike(unit, degrees):
    for name, other in drawn(PERIODS[unit]).items():
        wanted = degrees[name]
        if name == "words":
            assert other == wanted
        elif name == "rank":
            sizes = pytest.approx(wanted[:2], rel=NEAR)
            assert (other[:2], other[2:]) == (sizes, wanted[2:])
        else:
            assert other[0] == wanted[0], name
            for a, b in zip(wanted[1], other[1], strict=True):
                np.testing.assert_allclose(b, a, rtol=NEAR, atol=NEAR * 40.0, err_msg=name)


def alike(one, two, path=""):
    """Values of two contents, name by name."""
    if isinstance(one, dict):
        assert one.keys() == two.keys(), path
        for key in one.keys() - {"provenance", "unit", "period", "notes"}:
            alike(one[key], two[key], f"{path}.{key}")
    elif isinstance(one, list):
        assert len(one) == len(two), path
        for k, pair in enumerate(zip(one, two, strict=True)):
            alike(*pair, f"{path}[{k}]")
    elif isinstance(one, float):
        assert two == pytest.approx(one, rel=1e-4, abs=1e-6), path
    else:
        assert one == two, path


@pytest.mark.parametrize("unit", PERIODS)
def test_the_numbers_of_a_page_are_alike(unit):
    pytest.importorskip("jinja2")
    one, two = (
        json.loads(json.dumps(ta.report(measured(p), orders=[1, 3], title="x").content))
        for p in (360.0, PERIODS[unit])
    )
    alike(one, two)


matplotlib.use("Agg")


@pytest.fixture(scope="module")
def wide() -> list[ta.CalibrationRun]:
    """Two degrees of error."""
    sim = Simulation(
        Joint(encoder_side="output"),
        harmonics=(Harmonic("output", 1, 7200.0, 30.0),),
        sigma_arcsec=20.0,
        runs=tuple(RunDesign(label=f"r{i}", samples=180) for i in range(4)),
    )
    return ta.simulate(sim, seed=11)


def _drawn_values(ax) -> np.ndarray:
    """Greatest extents of what is drawn along the axis of errors."""
    lines = [np.asarray(line.get_ydata(), dtype=float) for line in ax.lines]
    dots = [np.max(drawn.lines[0].get_ydata()) for drawn in ax.containers]
    largest = [np.abs(y).max() for y in lines if y.size > 2 and np.isfinite(y).all()]
    return np.array([*largest, *dots])


@pytest.mark.parametrize(
    "draw",
    [
        lambda fit, runs, sim, unit: fit.plot(errors_in=unit),
        lambda fit, runs, sim, unit: fit.plot("spectrum", errors_in=unit),
        lambda fit, runs, sim, unit: fit.plot("phases", errors_in=unit),
        lambda fit, runs, sim, unit: plots.residuals(ta.fit(runs[:3], [3]), errors_in=unit),
        lambda fit, runs, sim, unit: ta.select_orders(runs, [1, 2, 3]).plot(errors_in=unit),
        lambda fit, runs, sim, unit: plots.before_after(fit.model, runs[3:], errors_in=unit),
        lambda fit, runs, sim, unit: plots.measured_and_simulated(runs, sim, errors_in=unit),
    ],
    ids=["errors", "spectrum", "phases", "residuals", "selection", "held out", "simulated"],
)
def test_pictures_choose_their_unit(draw, wide: list[ta.CalibrationRun]) -> None:
    fit = ta.fit(wide[:3], [1])
    sim = Simulation(Joint(encoder_side="output"), sigma_arcsec=20.0)
    shown = {}
    for unit in ("auto", "deg", "arcsec", "mrad", 65536):
        ax = draw(fit, wide, sim, unit)
        name = {"auto": "deg", 65536: "count"}.get(unit, unit)
        assert f"/ {name}" in (ax.get_xlabel() if ax.name == "polar" else ax.get_ylabel())
        told = plots.text_alternative(ax)
        assert name == "arcsec" or "arcsec" not in told
        shown[unit] = _drawn_values(ax)
    np.testing.assert_array_equal(shown["auto"], shown["deg"])
    # One turn is 1 296 000 arcsec, 360 deg, 2000 pi mrad, 65536 counts.
    for unit, turn in (("deg", 360.0), ("mrad", 2000.0 * np.pi), (65536, 65536.0)):
        np.testing.assert_allclose(
            shown[unit][0] / shown["arcsec"][0], turn / 1_296_000.0, rtol=1e-6
        )


def test_what_a_diagnosis_leaves_is_drawn_in_its_unit() -> None:
    sim = Simulation(
        sigma_arcsec=2.0,
        runs=tuple(
            RunDesign(samples=120, turns=2.0, reversals=(0.5,), speed_deg_s=speed)
            for speed in (5.0, 30.0, 5.0, 30.0)
        ),
    )
    diagnosis = ta.diagnose(ta.simulate(sim.with_effects([Backlash(6.0)]), seed=2), sim)
    (gain,) = [finding.gain for finding in diagnosis.findings]
    for unit, turn in (("auto", 1_296_000.0), ("deg", 360.0), (65536, 65536.0)):
        factor = turn / 1_296_000.0
        ax = plots.error_left(diagnosis, errors_in=unit)
        drawn = [float(line.get_xdata()[0]) for line in ax.lines[:2]]
        assert drawn == pytest.approx([factor * gain.after[0], factor * gain.before[0]])
        assert {1.0: "/ arcsec", 1.0 / 3600.0: "/ deg"}.get(factor, "/ count") in ax.get_xlabel()
        written = [float(text.get_text()) for text in ax.texts[:2]]
        assert written == pytest.approx(drawn, rel=0.001)
