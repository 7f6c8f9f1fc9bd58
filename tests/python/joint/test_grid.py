"""Uniform grids of positions, whole or in part."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.joint.grid import UniformGrid, uniform_grid

SEED = 55_900


@pytest.mark.parametrize("n", [3, 7, 36])
def test_orders_that_look_alike_on_a_grid(n):
    """Slow: two orders are alike where their cosines are so at every position."""
    grid = UniformGrid(n)
    angle = 2.0 * np.pi * np.arange(n) / n

    def alike(a, b):
        return np.allclose(np.cos(a * angle), np.cos(b * angle), atol=1e-9)

    for order in range(1, 3 * n):
        assert grid.folded(order) == next(m for m in range(n) if alike(m, order))
        wanted = [m for m in range(9 * n) if alike(m, order) and m != order]
        for count in (0, 1, 4):
            assert grid.aliases(order, count) == wanted[:count]


@pytest.mark.parametrize("shift", [0.0, 0.3, -2.0])
@pytest.mark.parametrize(("n", "found"), [(2, None), (3, 3), (36, 36), (10_000, 10_000),
                                          (10_001, None)])  # fmt: skip
def test_a_uniform_grid_is_told_wherever_it_begins(n, found, shift):
    rng = np.random.default_rng(n)
    theta = rng.permutation(np.concatenate([np.arange(n), np.arange(n) + 2 * n]))
    grid = uniform_grid((theta / n + shift) * 2.0 * np.pi)
    assert (grid and grid.positions) == found


def test_how_far_readings_may_stand_from_a_grid():
    turns = np.arange(36.0) / 36.0
    for away, told in ((0.019, True), (0.021, False), (-0.019, True), (-0.021, False)):
        # Two, so that the others' mean stays where it was.
        moved = turns.copy()
        moved[[5, 20]] += np.array([away, -away]) / 36.0
        assert (uniform_grid(2.0 * np.pi * moved) is not None) == told
    # Two readings of one position are one; farther apart two.
    for apart, positions in ((1e-5, 36), (3e-5, None)):
        again = np.append(turns, turns[7] + apart)
        grid = uniform_grid(2.0 * np.pi * again)
        assert (grid and grid.positions) == positions
    # At the places that are left the same orders look alike.
    assert uniform_grid(2.0 * np.pi * np.delete(turns, 3)) == UniformGrid(36)


@pytest.mark.parametrize("positions", [12, 36, 360])
@pytest.mark.parametrize("share", [0.4, 0.9])
def test_an_arc_of_equal_steps_is_the_grid_of_its_turn(positions, share):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    count = max(round(share * positions), 6)
    start = rng.uniform(0.0, 2.0 * np.pi)
    theta = start + np.arange(count) * 2.0 * np.pi / positions
    assert uniform_grid(theta) == UniformGrid(positions)
    # A third of the places left out, the ends kept, and readings there and back.
    kept = np.sort(rng.permutation(np.arange(1, count - 1))[count // 3 :])
    kept = np.concatenate([[0], kept, [count - 1]])
    if kept.size >= 6 and np.diff(kept).min() == 1:
        assert uniform_grid(np.concatenate([theta[kept], theta[kept][::-1]])) == UniformGrid(
            positions
        )
    # Orders that look alike there do so at each place.
    grid = uniform_grid(theta)
    for alias in grid.aliases(5.0, 3):
        line, other = (np.exp(1j * m * (theta - start)) for m in (5.0, alias))
        np.testing.assert_allclose(
            np.minimum(abs(line - other), abs(line - other.conj())), 0.0, atol=1e-9
        )


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_free_angles_are_no_grid_however_they_are_printed(digits):
    rng = np.random.default_rng(SEED)
    theta = np.radians(np.round(rng.uniform(40.0, 230.0, 200), digits))
    assert uniform_grid(theta) is None
