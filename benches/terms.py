"""Corrections by models with terms: what each costs beside a copy and a loop in C.

    python benches/terms.py [--samples 1000000] [--rounds 5] [--only backlash] [--steps]

A row is a model of 17 orders and a term. Nanoseconds of processor time a reading, one thread, the
least of rounds in turn: a copy of the columns; `error`; `correct`; the same correction in C (``gcc
-Ofast -march=native``, libmvec): what a user would write, Horner's rule for the orders and
three steps of the fixed point, which reach 1e-12 of a turn; then the ratio of `correct` to C (and
of the medians), and `correct` by the clock with all threads. The greatest difference from C
stands last, in parts of a turn. ``--steps`` times single steps beside ``math.sin`` instead.
"""

from __future__ import annotations

import argparse
import ctypes
import math
import tempfile
import time
from collections.abc import Callable
from functools import partial

import numpy as np

import trueangle as ta
from termloops import CASES, SERIES, TURN, Case, library


def columns(samples: int) -> dict[str, np.ndarray]:
    """A joint that swings over 340 degrees, read with a little noise, and its signals."""
    rng = np.random.default_rng(0)
    t = np.arange(samples)
    angle = 165.0 * np.sin(t * (2.0 * math.pi / 50_000)) + rng.normal(0.0, 1e-4, samples)
    return {
        "": angle,
        "velocity": 21.4 * np.cos(t * (2.0 * math.pi / 50_000)) + 1e-9,
        "temperature": 20.0 + 5.0 * np.sin(t / 1e5),
        "torque": 3.0 * np.sin(t / 1e3),
        "current": np.cos(t / 700.0),
    }


def model_of(case: Case) -> ta.HarmonicModel:
    return ta.HarmonicModel(period=TURN, shafts=(SERIES,), terms=case.model)


def compiled(function: ctypes._CFuncPtr, x: np.ndarray, v: np.ndarray, out: np.ndarray) -> None:
    pointers = (ctypes.c_void_p(column.ctypes.data) for column in (x, v, out))
    function(*pointers, ctypes.c_size_t(x.size))


def timed(
    ways: dict[str, Callable[[], object]], rounds: int, samples: int
) -> dict[str, list[float]]:
    """Nanoseconds of each way in each round, in turn: of the clock where it takes all threads."""
    taken: dict[str, list[float]] = {name: [] for name in ways}
    for way in ways.values():
        way()
    for _ in range(rounds):
        for name, way in ways.items():
            clock = time.perf_counter if name == "all" else time.process_time
            start = clock()
            way()
            taken[name].append((clock() - start) / samples * 1e9)
    return taken


def batches(only: str, samples: int, rounds: int) -> None:
    given = columns(samples)
    x, out, by_hand = given[""], np.empty(samples), np.empty(samples)
    title = f"{'term':34s}   copy  error correct      C  ratio (medians)    all  difference"
    print(f"{title}\n{'-' * len(title)}")
    with tempfile.TemporaryDirectory() as folder:
        functions = library(folder)
        for i, (name, case) in enumerate(CASES.items()):
            if only not in name:
                continue
            model, v = model_of(case), given[case.signal]
            signals = {case.signal: v} if case.signal else {}
            function = getattr(functions, f"case_{i}")
            read = [x, v] if case.signal else [x]
            taken = timed(
                {
                    "copy": lambda read=read: [np.copyto(out, column) for column in read],
                    "error": partial(model.error, x, out=out, threads=1, **signals),
                    "correct": partial(model.correct, x, out=out, threads=1, **signals),
                    "c": partial(compiled, function, x, v, by_hand),
                    "all": partial(model.correct, x, out=out, **signals),
                },
                rounds,
                samples,
            )
            least = {way: min(values) for way, values in taken.items()}
            middle = {way: sorted(values)[rounds // 2] for way, values in taken.items()}
            print(
                f"{name:34s} {least['copy']:6.2f} {least['error']:6.2f} {least['correct']:7.2f}"
                f" {least['c']:6.2f} {least['correct'] / least['c']:6.2f}"
                f" ({middle['correct'] / middle['c']:7.2f}) {least['all']:6.2f}"
                f"  {np.abs(out - by_hand).max() / TURN:10.1e}",
                flush=True,
            )


def steps(only: str, rounds: int, calls: int = 10_000) -> None:
    """One reading a call, the loop's own time included."""
    values = {name: float(column[7]) for name, column in columns(8).items()}

    def repeat(function: Callable[..., object], *angle: float, **signals: float) -> object:
        for _ in range(calls):
            function(*angle, **signals)
        return None

    ways: dict[str, Callable[[], object]] = {"math.sin": partial(repeat, math.sin, 1.2)}
    for name, case in CASES.items():
        if only in name:
            signals = {case.signal: values[case.signal]} if case.signal else {}
            ways[name] = partial(repeat, model_of(case).compensator(), 12.3, **signals)
    for name, taken in timed(ways, rounds, calls).items():
        print(f"{name:34s} {min(taken):8.1f} ns a step ({sorted(taken)[rounds // 2]:.1f})")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", default="", metavar="PART", help="of the name of a term")
    parser.add_argument("--steps", action="store_true", help="single steps instead")
    args = parser.parse_args()
    if args.steps:
        steps(args.only, args.rounds)
    else:
        batches(args.only, args.samples, args.rounds)


if __name__ == "__main__":
    main()
