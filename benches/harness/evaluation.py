"""Evaluation and correction of batches and single samples, beside a memory copy and peers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from harness.evaluationpeers import evaluation_peers
from harness.interleaved import Timing, interleave
from trueangle import _core
from trueangle.joint.shafts import Shaft
from trueangle.model.model import HarmonicModel

#: Orders of the models timed, by name.
ORDERS: dict[str, Sequence[int]] = {
    "17 orders": range(1, 18),
    "512 orders": range(1, 513),
    "1,2,100,200,202,400": (1, 2, 100, 200, 202, 400),
}

#: Calls of a single-sample function that are timed together.
_CALLS = 10_000


class EvaluationRow(NamedTuple):
    """What one way took for so many samples."""

    name: str
    samples: int
    timing: Timing

    @property
    def nanoseconds(self) -> float:
        """Median time of one sample."""
        return self.timing.median / self.samples * 1e9


def evaluated_model(
    orders: Sequence[int], period: float = 2.0 * math.pi, seed: int = 0
) -> HarmonicModel:
    """Model of random phases whose amplitudes sum to a thousandth of the slope limit."""
    rng = np.random.default_rng(seed)
    size = 1e-3 * period / (2.0 * math.pi) / sum(orders)
    phase = rng.uniform(0.0, 2.0 * math.pi, len(orders))
    cosine, sine = size * np.cos(phase), size * np.sin(phase)
    shaft = Shaft("output", 1.0, tuple(orders), tuple(cosine.tolist()), tuple(sine.tolist()))
    return HarmonicModel(period=period, shafts=(shaft,))


def _rows(ways: dict[str, Callable[[], object]], samples: int, rounds: int) -> list[EvaluationRow]:
    timings = interleave(ways, rounds)
    return [EvaluationRow(name, samples, timing) for name, timing in timings.items()]


def evaluate_batches(samples: int, rounds: int) -> list[EvaluationRow]:
    """Our paths and number types, and copies of the same arrays; random angles, seed 0."""
    rng = np.random.default_rng(0)
    theta = rng.uniform(0.0, 2.0 * math.pi, samples)
    out = np.empty_like(theta)
    theta32, out32 = theta.astype(np.float32), np.empty(samples, np.float32)
    counts = rng.integers(0, 65536, samples, dtype=np.uint16)
    models = {name: evaluated_model(orders) for name, orders in ORDERS.items()}
    dense = models["17 orders"]
    encoder = evaluated_model(ORDERS["17 orders"], period=65536.0)
    ways: dict[str, Callable[[], object]] = {
        "copy float64": partial(np.copyto, out, theta),
        "copy float32": partial(np.copyto, out32, theta32),
        "copy uint16 to float64": partial(np.copyto, out, counts),
    }
    for n in (1, 2):
        note = f"{n} thread{'s' * (n > 1)}"
        for name, model in models.items():
            ways[f"error, {name}, {note}"] = partial(model.error, theta, out=out, threads=n)
        ways[f"correct, 17 orders, {note}"] = partial(dense.correct, theta, out=out, threads=n)
        ways[f"float32, {note}"] = partial(dense.error, theta32, out=out32, threads=n)
        ways[f"16-bit counts, {note}"] = partial(encoder.error, counts, out=out, threads=n)
        ways[f"exact path, {note}"] = partial(
            dense._series.error, theta, out=out, threads=n, path="exact"
        )
    return _rows(ways, samples, rounds)


def evaluate_peers(samples: int, rounds: int) -> tuple[list[EvaluationRow], list[str]]:
    """The peers on 17 orders, with ours beside them, and the names of those missing."""
    theta = np.random.default_rng(0).uniform(0.0, 2.0 * math.pi, samples)
    out = np.empty_like(theta)
    model = evaluated_model(ORDERS["17 orders"])
    ready, missing = evaluation_peers(model)
    ways: dict[str, Callable[[], object]] = {
        "trueangle": partial(model.error, theta, out=out),
        "trueangle, 1 thread": partial(model.error, theta, out=out, threads=1),
        "trueangle, exact path, 1 thread": partial(
            model._series.error, theta, out=out, threads=1, path="exact"
        ),
        "numpy.copyto": partial(np.copyto, out, theta),
    }
    ways |= {name: partial(way, theta) for name, way in ready.items()}
    return _rows(ways, samples, rounds), missing


def evaluate_small(samples: int = 37, rounds: int = 200) -> list[EvaluationRow]:
    """Whole calls on few samples."""
    theta = np.random.default_rng(0).uniform(0.0, 2.0 * math.pi, samples)
    out = np.empty_like(theta)
    model = evaluated_model(ORDERS["17 orders"])
    reference = evaluation_peers(model)[0]["numpy per order (reference)"]
    calls = range(100)

    def repeat(way: Callable[[], object]) -> Callable[[], object]:
        return lambda: [way() for _ in calls]

    ways: dict[str, Callable[[], object]] = {
        "error": repeat(lambda: model.error(theta, out=out)),
        "correct": repeat(lambda: model.correct(theta, out=out)),
        "numpy.copyto": repeat(lambda: np.copyto(out, theta)),
        "numpy per order (reference)": repeat(lambda: reference(theta)),
    }
    return _rows(ways, len(calls), rounds)


def evaluate_single(rounds: int = 200) -> list[EvaluationRow]:
    """One float in, one float out; the loop around it is in every figure."""
    compensator = _core.Compensator(evaluated_model(ORDERS["17 orders"])._series)
    calls = range(_CALLS)
    functions: dict[str, Callable[[float], float]] = {
        "step": compensator.step,
        "math.sin": math.sin,
        "empty C function (math.fabs)": math.fabs,
        "empty PyO3 method": compensator._empty_step,
    }

    def repeat(function: Callable[[float], float]) -> Callable[[], object]:
        def loop() -> None:
            x = 0.7
            for _ in calls:
                function(x)

        return loop

    return _rows({name: repeat(function) for name, function in functions.items()}, _CALLS, rounds)
