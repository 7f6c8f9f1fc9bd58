"""Pictures choose the unit of their errors as summaries do."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle import plots
from trueangle.effects import Backlash
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def _closed():
    yield
    from matplotlib import pyplot

    pyplot.close("all")


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
