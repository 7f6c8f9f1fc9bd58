"""What a case is: of a seed, the numbers that are told there with the truth known."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from scipy import stats

from trueangle.estimation.quantity import Quantity


class Pull(NamedTuple):
    """(value - truth) / stated error of one number; ``careful`` says why the error may be wide."""

    name: str
    value: float
    careful: str = ""


class Chance(NamedTuple):
    """A p value where nothing is the matter; ``careful`` says why it may be too large."""

    name: str
    value: float
    careful: str = ""


Told: TypeAlias = Iterable[Pull | Chance]
Case: TypeAlias = Callable[[int], Told]


def generator(seed: int, case: str) -> np.random.Generator:
    """Of a seed and a case alone: no two cases share their noise."""
    return np.random.default_rng(entropy(seed, case))


def entropy(seed: int, case: str) -> list[int]:
    """What numpy makes a generator of."""
    return [seed, *case.encode()]


def scored(pull: float, freedom: float) -> float:
    """A pull of Student's distribution as one of a normal one.

    An error that few runs tell is itself not known: pulls have tails that its degrees of freedom
    say, and their rms is above 1 where all is well.
    """
    if not math.isfinite(freedom) or freedom > 1e6:
        return pull
    tail = stats.t.logsf(abs(pull), freedom)
    return math.copysign(float(stats.norm.isf(math.exp(max(tail, -600.0)))), pull)


def angle_apart(value: float, truth: float) -> float:
    """Difference of two angles in degrees, the shortest way."""
    return (value - truth + 180.0) % 360.0 - 180.0


def pulls_of(parameters: Mapping[str, Quantity], true: Mapping[str, Any]) -> Iterator[Pull]:
    """Of every parameter that states an error; none where another form was found.

    Numbers without an error that the truth has (orders, places) say which form it is, and so do
    those with one of which the truth is None.

    Raises
    ------
    KeyError
        An error is stated of what the truth does not name.
    """
    for name, told in parameters.items():
        is_form = name in true and (told.std is None or true[name] is None)
        if is_form and not np.array_equal(told.value, true[name]):
            return
    for name, told in parameters.items():
        if told.std is None:
            continue
        if name not in true:
            raise KeyError(f"{name} states an error, and its truth is not given")
        values, errors, truths = (np.atleast_1d(x) for x in (told.value, told.std, true[name]))
        if values.shape != truths.shape:
            raise KeyError(f"{name} has {values.size} numbers, its truth {truths.size}")
        for k, (value, error, truth) in enumerate(zip(values, errors, truths, strict=True)):
            away = angle_apart(value, truth) if name.startswith("phase") else value - truth
            yield Pull(name if values.size == 1 else f"{name} {k + 1}", float(away / error))
