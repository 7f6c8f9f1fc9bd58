"""Noise alone is called noise, whatever its kind and whatever was run."""

from __future__ import annotations

import pytest

from trueangle.diagnosis.goodness import LEVEL, goodness_of_fit

from .readings import DESIGNS, NOISES, leftover

#: Data sets of each design and kind; false alarms allowed of all sets of a kind. At a level of
#: 1 % the 24 sets have 4 or more in 0.01 % of such tests.
SETS, ALARMS = 3, 3

#: Top order that is looked for.
TOP = 110


@pytest.mark.parametrize("kind", NOISES)
def test_noise_alone_is_not_unexplained(kind: str) -> None:
    alarms = []
    for design in DESIGNS:
        for seed in range(SETS):
            fit = goodness_of_fit(leftover(design, kind, 7_000 + seed), TOP)
            if fit.found:
                alarms.append((design, seed, fit.firing[0]))
    assert len(alarms) <= ALARMS, alarms


def test_p_values_are_not_only_small_but_spread() -> None:
    """A test that can never fire has no size: p values below a half must be common."""
    smallest = [
        min(item.p for item in goodness_of_fit(leftover("split", "gauss", 300 + s), TOP).evidence)
        for s in range(8)
    ]
    assert min(smallest) > LEVEL / 100.0
    assert sum(p < 0.5 for p in smallest) >= 4, smallest
