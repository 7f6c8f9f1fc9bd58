"""Beliefs about play, and an extended simulation that leaves nothing to find."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Backlash, Harmonic, Joint, Simulation

from .case import Case, pose
from .causes import CAUSES
from .sweeps import measured, route

#: Seeds that nothing was chosen on; `make exam` asks more.
LARGE = os.environ.get("TRUEANGLE_EXAM_SEEDS")
SEEDS = range(9500, 9500 + int(LARGE)) if LARGE else range(9500, 9501)

#: Half width and noise, arcsec.
WIDTH, SIGMA = 6.0, 2.0

#: Causes whose extended simulation is diagnosed again in the ordinary run.
FEW = ("missing_order", "backlash", "presliding_hysteresis")

#: Those of which a simulation can say how large they are at every reading.
PREDICTED = ("missing_order", "sidebands", "backlash", "presliding_hysteresis", "latency",
             "torsional_compliance", "scale_error", "thermal_drift", "local_defect")  # fmt: skip


def sweeps_with_play(rng, half_width, line):
    """Sweeps there and back at one speed of a joint with play, or single ones in turn."""
    runs = []
    single = bool(rng.integers(2))
    for k in range(int(rng.integers(2, 5)) if single else int(rng.integers(1, 4))):
        theta, time = route("turn" if single else "there and back", rng)
        theta = theta[::-1] if single and k % 2 else theta
        way = np.sign(np.gradient(theta))
        error = half_width * way + line * np.sin(np.radians(theta + 50.0))
        runs.append(measured(theta, time, error + rng.normal(0.0, SIGMA, theta.size), str(k)))
    return runs


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(
    ("half_width", "believed", "verdict"),
    [
        (WIDTH, 2.0 * WIDTH, "overestimated"),
        (WIDTH, 0.5 * WIDTH, "underestimated"),
        (0.0, WIDTH, "absent"),
        (WIDTH, WIDTH, "confirmed"),
    ],
)
def test_beliefs_about_play(half_width, believed, verdict, seed):
    print(f"seed {seed}")
    rng = np.random.default_rng([seed, int(believed)])
    runs = sweeps_with_play(rng, half_width, 14.0)
    sim = Simulation(
        Joint(50.0, "circular_spline"),
        (Harmonic("output", 1, 14.0, 50.0),),
        (Backlash(believed),),
        SIGMA,
    )
    result = ta.diagnose(runs, sim)
    (belief,) = [belief for belief in result.beliefs if belief.what == "backlash"]
    assert belief.verdict == verdict, result.summary()
    assert [f.cause for f in result.findings if f.confirmed] == []
    widths = [e.half_width_arcsec for e in result.extended.effects if e.kind == "backlash"]
    if verdict == "absent":
        assert widths == []
    else:
        assert widths == [pytest.approx(half_width, abs=0.6)]
    again(result, runs)


def again(result, runs):
    """The extended simulation, measured in the same motion: nothing is left to find."""
    rng = np.random.default_rng(len(runs))
    error = result.extended.predict(runs) + rng.normal(0.0, SIGMA, sum(map(len, runs)))
    error = np.split(np.radians(error / 3600.0), np.cumsum([len(run) for run in runs])[:-1])
    turned = [r.period / (2.0 * np.pi) * e for r, e in zip(runs, error, strict=True)]
    made = [replace(r, indicated=r.reference + e) for r, e in zip(runs, turned, strict=True)]
    told = ta.diagnose(made, result.extended, gain=False)
    assert [f.cause for f in told.findings] == [], told.summary()
    assert [b.what for b in told.beliefs if b.verdict != "confirmed"] == [], told.summary()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("cause", PREDICTED if LARGE else FEW)
def test_an_extended_simulation_leaves_nothing(cause, seed, tmp_path):
    assert cause in CAUSES
    print(f"seed {seed}")
    question = pose(Case((cause,), 1.0, seed))
    path = tmp_path / "joint.toml"
    path.write_text(question.simulation, encoding="utf-8")
    result = ta.diagnose(question.runs, ta.load_simulation(path))
    assert cause in [finding.cause for finding in result.findings if finding.confirmed]
    again(result, question.runs)
