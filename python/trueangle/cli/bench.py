"""``trueangle bench``: what this machine reaches against plain numpy, in about ten seconds."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from typing import Any, Final

from ..errors import ArgumentError
from ..support.plainresult import json_text
from .parser import declare

HELP = "measure steps, batches and fits on this machine against numpy"
EXAMPLE = "trueangle bench --json"

#: The orders of the model measured, and a polygon's readings.
_ORDERS: Final = range(1, 18)
_POLYGON: Final = 37

#: Calls of a single-sample function that are timed together.
_CALLS: Final = 10_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    declare(parser, "--samples N", int, "readings in a batch", default=100_000)
    declare(parser, "--rounds", int, "rounds of each measurement", default=5)
    declare(parser, "--json", bool, "print the medians as JSON")


def run(args: argparse.Namespace) -> int:
    """Measure and print."""
    import statistics

    if args.samples < _POLYGON or args.rounds < 1:
        raise ArgumentError(
            f"--samples must be {_POLYGON} or more and --rounds 1 or more, "
            f"got {args.samples} and {args.rounds}"
        )
    medians: dict[str, dict[str, float]] = {}
    for part, ways in _ways(args.samples).items():
        seconds: dict[str, list[float]] = {name: [] for name in ways}
        for way, _ in ways.values():
            way()  # the first call fills caches
        for _ in range(args.rounds):  # interleaved: ratios hold where the machine changes speed
            for name, (way, _) in ways.items():
                start = time.perf_counter()
                way()
                seconds[name].append(time.perf_counter() - start)
        medians[part] = {
            name: 1e9 * statistics.median(seconds[name]) / count
            for name, (_, count) in ways.items()
        }
    if args.json:
        print(json_text({"path": _series_path(), "nanoseconds": medians}, indent=2))
        return 0
    print(f"default path: {_series_path()}")
    for part, rows in medians.items():
        print(f"\n{part.replace('_', ' ')}: median of {args.rounds}, over the last line")
        base = list(rows.values())[-1]
        for name, value in rows.items():
            print(f"  {name:32s} {value:14.2f} ns  {value / base:8.3f}")
    print("\nAgainst other libraries, and over sizes: benches/ in the source repository")
    return 0


def _model() -> Any:
    """Orders 1 to 17 of random phases (seed 0)."""
    import numpy as np

    from ..joint.shafts import Shaft
    from ..model.model import HarmonicModel

    cosine, sine = 1e-5 * np.random.default_rng(0).normal(size=(2, len(_ORDERS)))
    return HarmonicModel(
        period=2.0 * math.pi,
        shafts=(
            Shaft("output", 1.0, tuple(_ORDERS), tuple(cosine.tolist()), tuple(sine.tolist())),
        ),
    )


def _series_path() -> str:
    return str(_model()._series.path)


def _ways(samples: int) -> dict[str, dict[str, tuple[Callable[[], object], int]]]:
    """Calls by part and name with what their time is divided by; the last one is the base."""
    import numpy as np

    from ..estimation import reference
    from ..fitting.fit import fit
    from ..runs.run import CalibrationRun

    model = _model()
    step = model.compensator()
    rng = np.random.default_rng(1)
    theta = rng.uniform(0.0, 2.0 * math.pi, samples)
    out = np.empty_like(theta)
    readings = theta + model.error(theta) + 1e-6 * rng.normal(size=samples)

    def calls(function: Callable[[float], float]) -> Callable[[], object]:
        def loop() -> None:
            for _ in range(_CALLS):
                function(0.7)

        return loop

    parts: dict[str, dict[str, tuple[Callable[[], object], int]]] = {
        "single_samples": {
            "step": (calls(step), _CALLS),
            "math.sin": (calls(math.sin), _CALLS),
        },
        "batches": {
            "error": (lambda: model.error(theta, out=out), samples),
            "correct": (lambda: model.correct(readings, out=out), samples),
            "numpy per order (reference)": (lambda: reference.error(model, theta), samples),
        },
    }
    for size, orders in ((_POLYGON, range(1, 6)), (samples, _ORDERS)):
        measured = CalibrationRun(theta[:size], readings[:size], period=2.0 * math.pi)
        error = readings[:size] - theta[:size]
        shafts = [(1.0, tuple(orders))]

        def by_numpy(error: Any = error, size: int = size, shafts: Any = shafts) -> object:
            columns = reference.design_matrix(theta[:size], shafts)
            return np.linalg.lstsq(columns, error, rcond=None)

        parts[f"fit_{size}_readings_{len(orders)}_orders"] = {
            "trueangle.fit(...).model": (
                lambda run=measured, orders=orders: fit(run, orders=orders).model,  # type: ignore[misc]
                1,
            ),
            "numpy.linalg.lstsq": (by_numpy, 1),
        }
    return parts
