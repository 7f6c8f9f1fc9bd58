"""Which sizes are tried next: a bracket first, then where the chance is least known."""

from __future__ import annotations

import pytest

from trueangle.rehearsal.rehearse import next_sizes

LOWEST, HIGHEST = -16, 20


@pytest.mark.parametrize(
    ("tried", "wanted"),
    [
        ({}, [0, 0]),
        # Never named: larger, as far as there is something larger.
        ({0: (0, 2)}, [8, 8]),
        ({0: (0, 2), 16: (0, 2)}, [HIGHEST] * 2),
        ({0: (0, 2), HIGHEST: (0, 3)}, [HIGHEST] * 2),
        ({0: (0, 2), HIGHEST: (0, 4)}, []),
        # Always named: smaller, as far as there is something smaller.
        ({0: (2, 2)}, [-6, -6]),
        ({0: (2, 2), -12: (2, 2)}, [LOWEST] * 2),
    ],
)
def test_the_bracket(tried: dict[int, tuple[int, int]], wanted: list[int]) -> None:
    assert next_sizes(tried, LOWEST, HIGHEST, 20) == wanted


@pytest.mark.parametrize(
    "tried", [{0: (1, 2)}, {0: (3, 4), 6: (4, 4)}, {LOWEST: (2, 2)}, {LOWEST: (1, 2), 0: (2, 2)}]
)
def test_between_sizes_that_are_named_and_not_the_chance_is_asked(
    tried: dict[int, tuple[int, int]],
) -> None:
    """Of four chances, the larger at larger sizes."""
    steps = next_sizes(tried, LOWEST, HIGHEST, 20)
    assert len(steps) == 4
    assert steps == sorted(steps)
    assert steps[-1] > steps[0] or tried == {LOWEST: (2, 2)}
    assert LOWEST <= steps[0] <= steps[-1] <= HIGHEST


@pytest.mark.parametrize("left", [0, 1, 3])
def test_no_more_trials_than_are_left(left: int) -> None:
    assert len(next_sizes({0: (4, 8)}, LOWEST, HIGHEST, 8 + left)) == left
    assert len(next_sizes({0: (8, 8)}, LOWEST, HIGHEST, 8 + left)) == min(left, 2)
