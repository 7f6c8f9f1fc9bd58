"""The tests that decide whether something is unexplained: a test is a file and a line here."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from .events import reversal_test, start_test
from .evidence import Evidence
from .leftover import Leftover
from .noise import Noise
from .periodogram import order_test, time_test
from .place import place_tests
from .steps import steps_test
from .zeros import run_test


@dataclass(frozen=True, eq=False)
class TestedResidual:
    """The residual that is tested.

    Attributes
    ----------
    left : Leftover
        What the whole account leaves.
    loose : Leftover
        The same with free paths in time left in: they would follow anything bound to time.
    noise : Noise
    top : float
        Highest output order that is looked for.
    """

    left: Leftover
    loose: Leftover
    noise: Noise
    top: float


#: Every test, in the order in which equally sure ones are reported.
DECIDING: tuple[Callable[[TestedResidual], Iterable[Evidence | None]], ...] = (
    lambda asked: place_tests(asked.left, asked.top),
    lambda asked: [order_test(asked.left, asked.top, asked.noise.correlation)],
    lambda asked: [time_test(asked.left, asked.noise.correlation)],
    lambda asked: [run_test(asked.left, asked.noise)],
    lambda asked: [reversal_test(asked.loose)],
    lambda asked: [start_test(asked.loose)],
    lambda asked: [steps_test(asked.loose)],
)


def evidence_of_tests(asked: TestedResidual) -> list[Evidence]:
    """Evidence of every test that can be made of such readings."""
    return [item for test in DECIDING for item in test(asked) if item is not None]
