"""The fewest readings that serve, by scales that count nothing but readings."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from trueangle.planning.planner import LEAST, NEAR, RunSearch
from trueangle.planning.worth import Worth
from trueangle.simulation import RunDesign

GOAL = (1, 0, False, 0)


def fewest(samples: list[int], needed: int) -> tuple[int, list[int], Worth]:
    """How often it was asked, and the readings of each run, where so many in all serve."""
    asked = []

    def weighed(designs: list[RunDesign], *_: Any) -> Worth:
        asked.append(sum(design.samples for design in designs))
        return Worth(int(asked[-1] >= needed), 0, False, 0, 0, 0, float(asked[-1]))

    scales: Any = SimpleNamespace(over=False, weighed=weighed)
    limits: Any = None
    designs = [RunDesign(samples=n) for n in samples]
    all_of_them = weighed(designs)
    found, worth = RunSearch(scales, limits)._fewest(designs, all_of_them, GOAL, None)
    assert asked.count(sum(design.samples for design in found)) >= 1
    return len(asked), [design.samples for design in found], worth


@pytest.mark.parametrize("samples", [[2000], [400, 400, 400], [1000, 300]])
@pytest.mark.parametrize("share", [0.99, 0.6, 0.21, 0.07])
def test_a_tenth_fewer_would_not_serve(samples: list[int], share: float) -> None:
    needed = round(share * sum(samples))
    count, found, worth = fewest(samples, needed)
    assert needed <= sum(found) <= NEAR * needed + len(samples)
    assert worth.seconds == sum(found)
    # Halving of a logarithm.
    assert count < 12


def test_a_run_has_a_least_number_of_readings() -> None:
    assert fewest([2000, 500], 1)[1] == [LEAST, LEAST]
    # One that has fewer keeps them.
    assert fewest([2000, 10], 1)[1] == [LEAST, 10]
