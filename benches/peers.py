"""What users wait for, next to what they would use instead: ``python benches/peers.py``.

Both sides of a line do the same job in turns in one process (commands: one process each,
processor time), and the least of the rounds count, so that ratios hold on a machine that others
use. ``--write`` puts the table into docs/performance.md.
"""

from __future__ import annotations

import argparse
import datetime
import importlib.util
import math
import os
import platform
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
import trueangle as ta
from harness.evaluation import evaluated_model
from harness.interleaved import interleave
from startup import environment, made, seconds

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "performance.md"
BEGIN, END = "<!-- python benches/peers.py --write -->\n", "<!-- end of what it printed -->\n"
ORDERS = range(1, 18)
Ways = dict[str, Callable[[], object]]


def single(model: ta.HarmonicModel) -> Ways:
    """One reading corrected, ten thousand times."""
    from scipy.interpolate import CubicSpline

    angles = np.random.default_rng(0).uniform(0.0, 6.28, 10_000).tolist()
    grid = np.linspace(0.0, 2.0 * math.pi, 4097)
    spline = CubicSpline(grid, model.error(grid))
    knots = model.error(grid)
    ways = {
        "`step`": model.compensator(),
        "`math.sin`": math.sin,
        "`numpy.interp`, 4096 entries": lambda x: np.interp(x, grid, knots),
        "scipy `CubicSpline`": spline,
    }
    return {name: partial(_over, way, angles) for name, way in ways.items()}


def _over(way: Callable[[float], object], angles: list[float]) -> None:
    deque(map(way, angles), maxlen=0)


def batch(model: ta.HarmonicModel) -> Ways:
    """A million readings, 17 orders."""
    from scipy.interpolate import CubicSpline

    x = np.random.default_rng(0).uniform(0.0, 2.0 * math.pi, 1_000_000)
    out = np.empty_like(x)
    grid = np.linspace(0.0, 2.0 * math.pi, 65537)
    knots = model.error(grid)
    spline = CubicSpline(grid, knots)
    cosine, sine = (np.array(getattr(model.shafts[0], name)) for name in ("cosine", "sine"))

    def per_order() -> None:
        total = np.zeros_like(x)
        for k, a, b in zip(ORDERS, cosine, sine, strict=True):
            total += a * np.cos(k * x) + b * np.sin(k * x)

    return {
        "`model.correct`, one thread": partial(model.correct, x, out=out, threads=1),
        "`numpy.copyto`": partial(np.copyto, out, x),
        "`numpy.interp`, 65536 entries": lambda: np.interp(x, grid, knots),
        "scipy `CubicSpline`": lambda: spline(x),
        "numpy, per order": per_order,
    }


def fit() -> Ways:
    """100 000 readings, 17 orders, as arrays."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0.0, 360.0, 100_000)
    y = 0.1 * np.sin(np.radians(x)) + 0.01 * rng.standard_normal(x.size)
    run = ta.CalibrationRun(x, x + y, period=360.0)

    def lstsq() -> None:
        angle = np.outer(np.radians(x), ORDERS)
        np.linalg.lstsq(np.hstack([np.ones((x.size, 1)), np.cos(angle), np.sin(angle)]), y)

    ways: Ways = {"`ta.fit`": lambda: ta.fit(run, ORDERS), "`numpy.linalg.lstsq`": lstsq}
    if importlib.util.find_spec("astropy"):
        from astropy.timeseries import LombScargle

        ways["astropy `LombScargle`"] = lambda: LombScargle(x, y, nterms=17).model_parameters(
            1 / 360
        )
    return ways


def log(folder: Path, model: ta.HarmonicModel) -> Ways:
    """Two million rows of Parquet corrected, beside pyarrow's own read and rewrite."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    x = np.cumsum(np.full(2_000_000, 1e-3)) % (2.0 * math.pi)
    source, ours, theirs = (folder / f"{name}.parquet" for name in ("log", "ours", "theirs"))
    pq.write_table(pa.table({"time_s": np.arange(x.size) * 1e-3, "indicated_rad": x}), source)

    def corrected() -> None:
        ours.unlink(missing_ok=True)
        ta.correct_logs(source, model, ours)

    return {
        "`trueangle correct`, verified": corrected,
        "pyarrow, read and write": lambda: pq.write_table(pq.read_table(source), theirs),
    }


def commands(folder: Path, rounds: int) -> dict[str, dict[str, float]]:
    """Processor seconds of commands, each in a process; least of the rounds."""
    run = str(made(folder / "run.csv"))
    joint = folder / "joint.toml"
    lines = (
        '[[harmonic]]\nshaft = "output"\norder = 1\namplitude_arcsec = 60.0\n'
        "[noise]\nsigma_arcsec = 2.0\n"
    )
    runs = "".join(
        f'[[run]]\nlabel = "{k}"\nsamples = 2000\ndirection = {1 - k % 2 * 2}\n' for k in range(4)
    )
    joint.write_text(lines + '[[effect]]\nkind = "backlash"\nhalf_width_arcsec = 8.0\n' + runs)
    measured, assumed = folder / "measured.csv", folder / "assumed.toml"
    assumed.write_text(lines)
    ta.write_runs(ta.simulate(ta.load_simulation(joint), seed=0), measured)
    page, model = str(folder / "page.html"), str(folder / "model.json")
    lasso = (
        "import numpy, sklearn.linear_model as s; x = numpy.random.rand(8000, 240);"
        "s.LassoCV(alphas=30).fit(x, x[:, 0])"
    )
    diagnose = ["diagnose", str(measured), "--simulation", str(assumed)]
    groups: dict[str, dict[str, list[str]]] = {
        "a first fit from the shell": {
            "`trueangle fit`": ["-m", "trueangle", "fit", run, "-o", model],
            "`import numpy`": ["-c", "import numpy"],
            "`import scipy.optimize`": ["-c", "import scipy.optimize"],
            "`import statsmodels.api`": ["-c", "import statsmodels.api"],
        },
        "causes of 8000 readings": {
            "`trueangle diagnose`": ["-m", "trueangle", *diagnose],
            "scikit-learn `LassoCV`, 240 columns": ["-c", lasso],
        },
        "a page of 4 runs": {
            "`trueangle report`": ["-m", "trueangle", "report", str(measured), "-o", page],
            "`import matplotlib.pyplot, pandas`": ["-c", "import matplotlib.pyplot, pandas"],
        },
    }
    env = environment(folder / "compiled")
    found: dict[str, dict[str, float]] = {}
    for job, ways in groups.items():
        taken: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(rounds + 1):
            for way, words in ways.items():
                taken[way].append(seconds(words, env))
        found[job] = {way: min(times[1:]) for way, times in taken.items()}
    return found


def table(found: dict[str, dict[str, float]]) -> Iterator[str]:
    """Ours, theirs and their ratio."""
    yield "| job | trueangle | instead of it | time, ratio |"
    yield "| --- | --- | --- | --- |"
    for job, ways in found.items():
        (ours, least), *others = ways.items()
        for n, (name, taken) in enumerate(others):
            head = f"{job} | {ours}, {shown(least)}" if n == 0 else " | "
            ratio = f"{taken / least:.0f}" if taken > 10 * least else f"{taken / least:.1f}"
            yield f"| {head} | {name} | {shown(taken)}, {ratio} |"


def shown(taken: float) -> str:
    """A time in its unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if taken >= size:
            return f"{taken / size:.3g} {unit}"
    return f"{taken * 1e9:.3g} ns"


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--write", action="store_true")
    args = parser.parse_args()
    model = evaluated_model(ORDERS)
    with tempfile.TemporaryDirectory() as name:
        jobs = {
            "one reading corrected": (single(model), 1e4),
            "a million readings corrected, 17 orders": (batch(model), 1.0),
            "100 000 readings fitted, 17 orders": (fit(), 1.0),
            "2 000 000 rows of Parquet corrected": (log(Path(name), model), 1.0),
        }
        found = {
            job: {
                way: timing.least / calls for way, timing in interleave(ways, args.rounds).items()
            }
            for job, (ways, calls) in jobs.items()
        }
        found |= commands(Path(name), max(2, args.rounds // 3))
    versions = ", ".join(
        f"{name} {importlib.import_module(name).__version__}"
        for name in ("numpy", "scipy", "sklearn", "statsmodels", "pyarrow", "astropy")
        if importlib.util.find_spec(name)
    )
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else math.nan
    lines = [
        f"`python benches/peers.py`, {datetime.date.today()}, {platform.machine()},"
        f" {os.cpu_count()} cores, least of {args.rounds} rounds; load average {load:.0f}: ratios"
        f" count, times do not. {versions}.",
        "",
        *table(found),
    ]
    text = "\n".join(lines)
    print(text)
    if args.write:
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        PAGE.write_text(f"{before}{BEGIN}\n{text}\n\n{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
