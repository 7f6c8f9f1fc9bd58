"""Independent units of what is left: every run, or pieces of few runs, and each reading once."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from trueangle.diagnosis.goodness import Leftover


def leftover(*sizes: int) -> Leftover:
    n = sum(sizes)
    residual = np.random.default_rng(5).normal(size=n)
    # Each run travels twice as far as the one before it.
    theta = np.concatenate([2.0**k * np.linspace(1.0, -1.0, m) for k, m in enumerate(sizes)])
    run = np.repeat(np.arange(len(sizes)), sizes)
    return Leftover(residual, theta, np.ones(n), run, np.arange(float(n)))


@pytest.mark.parametrize(
    ("sizes", "pieces"),
    [
        ((29,), [1]),
        ((59,), [1]),
        ((60,), [2]),
        ((360,), [12]),
        ((9000,), [12]),
        # Twelve together of five runs: three of each.
        ((89, 1, 90, 29, 500), [2, 1, 3, 1, 3]),
        # From eight runs on they are the units, however long.
        ((400,) * 7, [2] * 7),
        ((400,) * 8, [1] * 8),
    ],
)
def test_few_runs_are_cut_into_even_pieces_and_none_is_lost(
    sizes: tuple[int, ...], pieces: list[int]
) -> None:
    left = leftover(*sizes)
    units = left.units()
    assert [a for a, _ in units] == [0, *(b for _, b in units[:-1])]
    assert units[-1][1] == sum(sizes)
    bounds = left.bounds
    assert [b - a for a, b in bounds] == list(sizes)
    for (start, stop), count in zip(bounds, pieces, strict=True):
        within = [b - a for a, b in units if start <= a and b <= stop]
        assert len(within) == count
        assert sum(within) == stop - start
        assert max(within) - min(within) <= 1
    assert len(units) == sum(pieces)


@pytest.mark.parametrize("sizes", [(7,), (7, 12, 5), (5, 12, 7)])
def test_turns_are_those_of_the_run_that_goes_farthest(sizes: tuple[int, ...]) -> None:
    assert leftover(*sizes).turns == pytest.approx(2.0 ** len(sizes) / (2.0 * np.pi), rel=1e-12)


def test_each_stretch_is_put_about_its_own_mean_and_nothing_else() -> None:
    left = leftover(10, 20)
    given = left.residual.copy()
    edges = [0, 4, 10, 11, 30]
    found = left.centred(list(itertools.pairwise(edges)))
    for a, b in itertools.pairwise(edges):
        assert found[a:b].mean() == pytest.approx(0.0, abs=1e-12)
        np.testing.assert_allclose(np.diff(found[a:b]), np.diff(given[a:b]), atol=1e-12)
    np.testing.assert_array_equal(left.residual, given)
