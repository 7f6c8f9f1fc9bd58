"""Held-out error of a correction by the methods that people use, on data that anybody can get.

    python benches/public.py --data FOLDER            # print the tables
    python benches/public.py --data FOLDER --write    # into docs/benchmarks.md

FOLDER (or ``$TRUEANGLE_DATA``) holds the files that `SOURCES` names; what is missing is named with
where it is, and left out. Every method gets the same readings and the joint's own angle, and is
judged by runs that it did not see: rms of what it leaves, the mean of a run removed, in arcsec.
Each run in turn is fitted and all others tested (*from 1*), and each in turn is held out (*from
n - 1*). The best of a column is bold, whoever it is.
"""

from __future__ import annotations

import argparse
import inspect
import os
import re
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

import trueangle as ta

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "benchmarks.md"
BEGIN, END = "<!-- python benches/public.py --write -->\n", "<!-- end of what it printed -->\n"
ARCSEC = 3600.0


class Source(NamedTuple):
    """Where a data set is published."""

    title: str
    file: str
    repository: str
    commit: str
    path: str
    licence: str
    orders: tuple[int, ...]  # what an expert would declare for it


SOURCES = {
    "motor": Source(
        "A stepper motor with a 14-bit magnetic encoder, measured five times",
        "Mechaduino_00.ino",
        "https://github.com/WillChurch/Mechaduino-Firmware",
        "d5d0e78",
        "Mechaduino_00/Mechaduino_00/Mechaduino_00.ino",
        "CC BY-SA 4.0",
        (1, 2, 4, 50, 100),
    ),
    "servo": Source(
        "A hobby servo's potentiometer over 217 deg, four sweeps, two of them under load",
        "outputEncoderData.txt",
        "https://github.com/adamb314/ServoProject",
        "68a5dba",
        "Python/tests/dataFiles/outputEncoderData.txt",
        "CC BY 3.0 US",
        (1, 2, 3, 4, 5, 6),
    ),
}
#: Tables of the file that are one motor, of 16384 counts; every eighth is used.
MOTOR_TABLES, COUNTS, EVERY = (1, 2, 3, 5, 6), 16384, 8
#: Whole sweeps between reversals, as samples; the counts of its turn; every tenth is used.
SWEEPS = ((3700, 10200), (10400, 16900), (25700, 32200), (32350, 38900))
SERVO_COUNTS, SERVO_EVERY = 4096.0, 10


def motor(file: Path) -> list[ta.CalibrationRun]:
    """The tables of the firmware: true angle, from the motor's full steps, of each count."""
    text = file.read_text(encoding="utf-8", errors="replace")
    found = next(
        b for b in re.findall(r"lookup\[\w*\]\s*=\s*\{([^}]*)", text) if len(b) > 1_000_000
    )
    tables = np.array(re.findall(r"-?\d+\.\d+", found), dtype=float)
    tables = tables[: len(tables) // COUNTS * COUNTS].reshape(-1, COUNTS)[:, ::EVERY]
    counts = np.arange(0, COUNTS, EVERY) * 360.0 / COUNTS
    return [
        ta.CalibrationRun(tables[k], counts, period=360.0, label=f"measurement {k}")
        for k in MOTOR_TABLES
    ]


def servo(file: Path) -> list[ta.CalibrationRun]:
    """Time, potentiometer and its difference from the motor's encoder, in counts."""
    _, indicated, difference = np.loadtxt(file).T * 360.0 / SERVO_COUNTS
    difference -= difference.mean()
    runs = []
    for start, stop in SWEEPS:
        at = slice(start, stop, SERVO_EVERY)
        reference = indicated[at] - difference[at]
        runs.append(ta.CalibrationRun(reference, indicated[at], period=360.0))
    return runs


# The methods: everything in the body is what a user writes. x is the joint's own angle in degrees,
# e the error with the mean of its run removed; what is returned predicts e.


def table_of_64(x, e, runs, orders):
    place = np.arange(64) * 360 / 64
    nearest = np.round(x * 64 / 360).astype(int) % 64
    count = np.bincount(nearest, minlength=64)
    mean = np.bincount(nearest, e, 64) / np.maximum(count, 1)
    return lambda y: np.interp(y, place[count > 0], mean[count > 0], period=360)


def table_of_1024(x, e, runs, orders):
    place = np.arange(1024) * 360 / 1024
    nearest = np.round(x * 1024 / 360).astype(int) % 1024
    count = np.bincount(nearest, minlength=1024)
    mean = np.bincount(nearest, e, 1024) / np.maximum(count, 1)
    return lambda y: np.interp(y, place[count > 0], mean[count > 0], period=360)


def design(x, orders):
    angle = np.outer(np.radians(x), orders)
    return np.hstack([np.ones((len(x), 1)), np.cos(angle), np.sin(angle)])


def fourier_5(x, e, runs, orders):
    c = np.linalg.lstsq(design(x, np.arange(1, 6)), e)[0]
    return lambda y: design(y, np.arange(1, 6)) @ c


def fourier_12(x, e, runs, orders):
    c = np.linalg.lstsq(design(x, np.arange(1, 13)), e)[0]
    return lambda y: design(y, np.arange(1, 13)) @ c


def fourier_25(x, e, runs, orders):
    c = np.linalg.lstsq(design(x, np.arange(1, 26)), e)[0]
    return lambda y: design(y, np.arange(1, 26)) @ c


def lasso(x, e, runs, orders):
    from sklearn.linear_model import LassoCV

    k = np.arange(1, 121)
    model = LassoCV(alphas=30, cv=5).fit(design(x, k)[:, 1:], e)
    return lambda y: model.predict(design(y, k)[:, 1:])


def glsar(x, e, runs, orders):
    from statsmodels.regression.linear_model import GLSAR

    fit = GLSAR(e, design(x, orders), rho=1).iterative_fit(5)
    return lambda y: design(y, orders) @ fit.params


def spline(x, e, runs, orders):
    from scipy.interpolate import make_smoothing_spline

    x, same = np.unique(x % 360, return_inverse=True)
    e = np.bincount(same, e) / np.bincount(same)
    x, e = np.concatenate([x - 360, x, x + 360]), np.tile(e, 3)
    fit = make_smoothing_spline(x, e)
    return lambda y: fit(y % 360)


def trueangle_default(x, e, runs, orders):
    model = ta.fit(runs).model
    return lambda y: ARCSEC * ta.wrap(y - model.correct(y), 360.0)


def trueangle_with_its_gear(x, e, runs, orders):
    model = ta.fit(runs, gear_ratio=100).model
    return lambda y: ARCSEC * ta.wrap(y - model.correct(y), 360.0)


METHODS: dict[str, Callable] = {
    "table, 64 entries": table_of_64,
    "table, 1024 entries": table_of_1024,
    "numpy, orders 1-5": fourier_5,
    "numpy, orders 1-12": fourier_12,
    "numpy, orders 1-25": fourier_25,
    "scikit-learn `LassoCV`, orders 1-120": lasso,
    "statsmodels `GLSAR`, declared orders": glsar,
    "scipy `make_smoothing_spline`": spline,
    "`ta.fit(runs)`": trueangle_default,
}
#: The simulated joint has a gear.
TOLD = {"`ta.fit(runs, gear_ratio=100)`": trueangle_with_its_gear}


def centred(run: ta.CalibrationRun) -> tuple[np.ndarray, np.ndarray]:
    """The joint's own angle in degrees, and its error in arcsec without the mean."""
    error = ARCSEC * np.asarray(run.error)
    # The zero of a run may be anywhere, at the seam of the wrap too.
    zero = np.degrees(np.angle(np.exp(1j * np.radians(error / ARCSEC)).mean()))
    error = ARCSEC * ta.wrap(error / ARCSEC - zero, 360.0)
    return np.asarray(run.indicated) % 360.0, error - error.mean()


def fitted(
    method: Callable, runs: list, orders: tuple[int, ...], tested: list
) -> tuple[float, float]:
    """Mean variance of what is left in the runs tested, nan where refused; seconds of the fit."""
    x, e = (np.concatenate(part) for part in zip(*map(centred, runs), strict=True))
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            predict = method(x, e, runs, np.array(orders))
        except ta.errors.NoModelError:  # a refusal, with its reason, where a correction may harm
            return np.nan, time.perf_counter() - start
        taken = time.perf_counter() - start
        left = [(error - predict(y)).var() for y, error in map(centred, tested)]
    return float(np.mean(left)), taken


def lines_of(method: Callable) -> int:
    """Lines of code that the user writes, with those of the design matrix where it is used."""
    source = inspect.getsource(method)
    body = [line for line in source.splitlines()[1:] if line.strip()]
    return len(body) + (3 if "design(" in source else 0)


def judged(runs: list, orders: tuple[int, ...]) -> Iterator[tuple[str, list[float], float]]:
    """Every method: held-out rms from one run and from all but one, seconds of the latter."""
    some = range(len(runs))
    for name, method in METHODS.items():
        one = [fitted(method, [runs[k]], orders, runs[:k] + runs[k + 1 :]) for k in some]
        most = [fitted(method, runs[:k] + runs[k + 1 :], orders, [runs[k]]) for k in some]
        rms = [float(np.sqrt(np.mean([left for left, _ in found]))) for found in (one, most)]
        yield name, rms, float(np.median([taken for _, taken in most]))


def table(columns: list[str], rows: list[tuple[str, list[float], float]]) -> Iterator[str]:
    """A table in Markdown; the best of each column of errors is bold."""
    base = next(taken for name, _, taken in rows if name == "numpy, orders 1-12")
    best = np.nanmin([errors for _, errors, _ in rows], axis=0)
    yield f"| method | {' | '.join(columns)} | time | lines |"
    yield "| --- " * (len(columns) + 3) + "|"
    for name, errors, taken in rows:
        shown = ["refused" if np.isnan(e) else f"{e:.4g}" for e in errors]
        marked = [
            f"**{s}**" if e <= b * 1.005 else s for s, e, b in zip(shown, errors, best, strict=True)
        ]
        ratio = f"{taken / base:.1f}" if taken < 10 * base else f"{taken / base:.0f}"
        yield f"| {name} | {' | '.join(marked)} | {ratio} | {lines_of((METHODS | TOLD)[name])} |"


#: A simulated joint like those of the paper: at 36 positions its gear orders look like 8, 14, 16.
SIMULATED = {("output", 1): (14.1, 243.8), ("output", 4): (6.9, 26.7), ("motor", 1): (18.0, 46.5),
             ("motor", 2): (33.0, 20.8), ("wave_generator", 2): (19.6, 247.9)}  # fmt: skip


#: Degrees between the mounts of `trueangle plan --gear-ratio 100 --positions 36 --mounts 2`.
MOUNT = 2.14


def simulated() -> dict[str, tuple[list, list]]:
    """By column: the runs that are fitted, and the one that is tested."""
    lines = "".join(
        f'[[harmonic]]\nshaft = "{shaft}"\norder = {order}\n'
        f"amplitude_arcsec = {size}\nphase_deg = {at}\n"
        for (shaft, order), (size, at) in SIMULATED.items()
    )
    text = f"[joint]\ngear_ratio = 100.0\n{lines}[noise]\nsigma_arcsec = 3.0\n"
    starts = [0.0] * 6 + [0.0, MOUNT, 0.0, MOUNT, 0.0]
    at = '[[run]]\nsamples = 36\nspacing = "uniform"\nstart_deg = '
    text += "".join(f"{at}{start}\n" for start in starts)
    text += '[[run]]\nsamples = 720\nspacing = "random"\n'
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "joint.toml")
        file.write_text(text, encoding="utf-8")
        runs = ta.simulate(ta.load_simulation(file), seed=0)
    return {
        "from 1 run, same positions": (runs[:1], [runs[5]]),
        "from 1 run, between": (runs[:1], [runs[-1]]),
        "from 5 runs, same positions": (runs[:5], [runs[5]]),
        "from 5 runs, between": (runs[:5], [runs[-1]]),
        "from 5 runs at 2 planned mounts, between": (runs[6:11], [runs[-1]]),
    }


def judged_simulated() -> Iterator[tuple[str, list[float], float]]:
    """Every method, and the one that is told of the gear."""
    orders = (1, 4, 8, 12, 14, 15, 16)  # as the paper chose
    columns = simulated().values()
    for name, method in {**METHODS, **TOLD}.items():
        found = [fitted(method, runs, orders, tested) for runs, tested in columns]
        yield name, [float(np.sqrt(left)) for left, _ in found], found[-1][1]


def found_in(folder: Path, source: Source) -> list | None:
    """Runs of a data set; None where its file is missing."""
    file = folder / source.file
    if file.is_file():
        return {"Mechaduino_00.ino": motor, "outputEncoderData.txt": servo}[source.file](file)
    return None


def printed(folder: Path) -> Iterator[str]:
    """The tables, line by line."""
    for source in SOURCES.values():
        runs = found_in(folder, source)
        yield from (f"## {source.title}", "")
        where = f"`{source.path}` of <{source.repository}> at `{source.commit}`, {source.licence}"
        if runs is None:
            yield from (f"Missing: {folder / source.file}; it is {where}.", "")
            print(f"missing: {folder / source.file}: {where}", file=sys.stderr)
            continue
        before = np.sqrt(np.mean([centred(run)[1].var() for run in runs]))
        readings = ", ".join(dict.fromkeys(str(len(run.indicated)) for run in runs))
        yield f"{where}. {len(runs)} runs of {readings} readings;"
        yield f"{before:.4g} arcsec rms uncorrected; declared orders"
        yield f"{', '.join(map(str, source.orders))}."
        yield ""
        columns = ["from 1 run", f"from {len(runs) - 1} runs"]
        yield from table(columns, list(judged(runs, source.orders)))
        yield ""
    yield from ("## A simulated joint at 36 positions", "")
    before = np.sqrt(sum(size**2 / 2 for size, _ in SIMULATED.values()))
    yield "Orders 1 and 4 of the output, 1 and 2 of the motor, 2 of the wave generator (100 : 1),"
    yield f"noise 3 arcsec; {before:.4g} arcsec rms uncorrected; declared: the orders of the paper."
    yield ""
    yield from table(list(simulated()), list(judged_simulated()))
    yield ""


def main(argv: list[str] | None = None) -> int:
    """Print, or write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("TRUEANGLE_DATA", ".")))
    parser.add_argument("--write", action="store_true", help=f"into {PAGE.relative_to(ROOT)}")
    args = parser.parse_args(argv)
    text = "\n".join(printed(args.data))
    print(text)
    if args.write:
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        PAGE.write_text(f"{before}{BEGIN}\n{text}\n{END}{after}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
