"""Rows of the table: mean and rms of pulls, evenness of p values, and whether they miss."""

from __future__ import annotations

import math
import warnings
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from asked import Case, Pull
from trueangle.errors import UnlikeRunsWarning

#: How far rms may be from 1 and a mean from 0 with so many seeds; fewer tell them less well.
NEAR, ENOUGH = 0.15, 200

#: Standard errors within which a mean is compatible with 0, beyond `NEAR` too.
COMPATIBLE = 3.5

#: Chance (of Kolmogorov and Smirnov, or of a count) below which p values are not even.
UNEVEN = 1e-3

#: Levels at which p values that are careful are counted.
LEVELS = (0.01, 0.05, 0.1)

#: Share of the seeds that must tell a number: what is told only where it comes out large is biased.
TELLING = 0.95


@dataclass(frozen=True)
class Row:
    """One number over the seeds."""

    name: str
    text: str
    misses: str

    def line(self) -> str:
        """As it stands in the table."""
        missed = f"  MISSES: {self.misses}" if self.misses else ""
        return f"{self.name:<42} {self.text}{missed}"


def rows_of(name: str, case: Case, seeds: range) -> Iterator[Row]:
    """A row for every number that a case tells."""
    pulls: dict[str, dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    chances: dict[str, dict[int, list[float]]] = defaultdict(lambda: defaultdict(list))
    careful: dict[str, str] = {}
    for seed in seeds:
        try:
            with warnings.catch_warnings():
                # Of runs that are unlike by design.
                warnings.simplefilter("ignore", UnlikeRunsWarning)
                for told in case(seed):
                    kind = pulls if isinstance(told, Pull) else chances
                    kind[told.name][seed].append(told.value)
                    careful[told.name] = told.careful
        except Exception as error:
            error.add_note(f"case {name!r}, seed {seed}")
            raise
    if not pulls and not chances:
        yield Row("nothing", f"{0:5d}", "no seed tells it")
    for number, by_seed in pulls.items():
        yield pull_row(number, list(by_seed.values()), careful[number], len(seeds))
    for number, by_seed in chances.items():
        yield chance_row(number, list(by_seed.values()), careful[number])


def pull_row(name: str, by_seed: list[list[float]], careful: str, seeds: int) -> Row:
    """Mean and rms with errors by how seeds scatter: numbers of one seed may hang together."""
    told = len(by_seed)
    if told < 2:
        return Row(name, f"{told:5d}", f"told by {told} of {seeds} seeds")
    means = np.array([np.mean(one) for one in by_seed])
    squares = np.array([np.mean(np.square(one)) for one in by_seed])
    mean, rms = float(means.mean()), math.sqrt(float(squares.mean()))
    mean_error = float(means.std(ddof=1)) / math.sqrt(told)
    rms_error = float(squares.std(ddof=1)) / math.sqrt(told) / max(2.0 * rms, 1e-300)
    near = NEAR * max(1.0, math.sqrt(ENOUGH / told))
    wrong = []
    if not (0.0 if careful else 1.0 - near) <= rms <= 1.0 + near:
        wrong.append(f"rms {rms:.2f}")
    if not abs(mean) <= max(near, COMPATIBLE * mean_error):
        wrong.append(f"mean {mean:+.2f}")
    if told < TELLING * seeds:
        wrong.append(f"told by {told} of {seeds} seeds")
    text = f"{told:5d}  mean {mean:+.2f} ± {mean_error:.2f}  rms {rms:.2f} ± {rms_error:.2f}"
    text += _one_side(careful)
    return Row(name, text, ", ".join(wrong))


def chance_row(name: str, by_seed: list[list[float]], careful: str) -> Row:
    """Evenness of p values; of careful ones whether small ones come oftener than they say.

    Whether a test can be made is a matter of the design that a seed draws, not of its noise.
    """
    values: NDArray[np.float64] = np.concatenate([np.asarray(one) for one in by_seed])
    n, below = values.size, [int(np.count_nonzero(values <= level)) for level in LEVELS]
    if careful:
        tails = [stats.binom.sf(k - 1, n, level) for k, level in zip(below, LEVELS, strict=True)]
        chance = min(len(LEVELS) * float(min(tails)), 1.0)
    else:
        chance = float(stats.kstest(values, "uniform").pvalue)
    counts = ", ".join(f"{k}" for k in below)
    text = f"{len(by_seed):5d}  mean  {values.mean():.2f}  below 1, 5, 10 %: {counts} of {n}"
    text += f"  p of p {chance:.2g}{_one_side(careful)}"
    return Row(name, text, "" if chance >= UNEVEN else f"p of p {chance:.1g}")


def _one_side(careful: str) -> str:
    return f"  (one side: {careful})" if careful else ""
