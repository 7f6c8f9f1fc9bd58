"""Figures and measured tables of the documentation, made anew by every build."""

from __future__ import annotations

import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

import trueangle as ta
from trueangle import plots
from trueangle.diagnosis import diagnose
from trueangle.effects import Backlash
from trueangle.planning import plan_mounts
from trueangle.reports.demo import demo_simulation

__all__ = ["everything"]

#: Size of the batches that are timed.
SAMPLES = 200_000


def everything(folder: Path) -> None:
    """Write all figures and tables into ``folder``."""
    folder.mkdir(exist_ok=True)
    figures(folder)
    (folder / "performance.md").write_text(performance(), encoding="utf-8")


def figures(folder: Path) -> None:
    """One picture for each part of the method, all of the same simulated joint."""
    sim = demo_simulation()
    runs = ta.simulate(replace(sim, effects=(Backlash(8.0),)), seed=0)
    fit = ta.fit(runs[:6], gear_ratio=100.0)
    diagnosis = diagnose(runs, sim)
    plan = plan_mounts(100, positions=36, mounts=2)
    drawn = {
        "errors": plots.error_curves(fit),
        "spectrum": plots.amplitude_spectrum(fit),
        "phases": plots.phases_over_runs(fit),
        "held-out": plots.before_after(fit.model, runs[6:]),
        "direction": plots.residuals(fit, "direction"),
        "simulated": plots.measured_and_simulated(runs, sim),
        "left": plots.error_left(diagnosis, runs, sim),
        "gains": plots.gains(diagnosis),
        "positions": plots.plan_positions(plan),
        "factors": plots.plan_factors(plan),
        "folded": folded(),
    }
    for name, ax in drawn.items():
        ax.figure.savefig(folder / f"{name}.svg")
        mpl.pyplot.close(ax.figure)


def folded() -> mpl.axes.Axes:
    """Order 202 and order 14 at 36 positions: the same numbers."""
    _, ax = mpl.pyplot.subplots(figsize=(7.5, 3.2), layout="constrained")
    theta = np.linspace(0.0, 60.0, 4001)
    at = np.arange(0.0, 61.0, 10.0)
    # 202 = 6 * 36 - 14: at multiples of 10 degrees sin(202 x) = -sin(14 x).
    ax.plot(theta, np.sin(np.radians(202 * theta)), color="#E69F00", label="order 202")
    ax.plot(theta, -np.sin(np.radians(14 * theta)), color="#0072B2", label="order 14")
    ax.plot(at, np.sin(np.radians(202 * at)), "o", color="#000000", label="every 10 degrees")
    ax.set_xlabel("output angle / deg")
    ax.set_ylabel("error / amplitude")
    ax.set_ylim(-1.2, 1.6)
    ax.legend(loc="upper center", ncols=3, frameon=False)
    return ax


def performance() -> str:
    """The text that ``trueangle bench`` prints on the machine of this build."""
    command = [sys.executable, "-m", "trueangle", "bench", "--samples", str(SAMPLES)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    head = f"Nanoseconds per sample, measured by this build ({platform.machine()}):"
    return f"{head}\n\n```text\n{done.stdout}```\n"
