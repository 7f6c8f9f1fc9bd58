"""Which runs differ from the others, and by how many times their noise."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.estimation.linear import NormalEquations
from trueangle.fitting.unlikeruns import far_runs

SEED = 47_700


def sums_of(pairs, count=90, noise=None):
    """Of a run at places all around, with these coefficients of one order and others."""
    x = 2.0 * np.pi * np.arange(count) / count
    design = np.column_stack([f(k * x) for k in range(1, len(pairs) // 2 + 1)
                              for f in (np.cos, np.sin)])  # fmt: skip
    error = design @ np.asarray(pairs)
    return NormalEquations.of_rows(design, error if noise is None else error + noise)


@pytest.mark.parametrize("turn", [0.0, 1.3, -2.0])
@pytest.mark.parametrize("runs", [2, 3, 5])
def test_a_run_is_unlike_the_others_from_a_fifth_of_its_energy_on(runs, turn):
    """Of two runs as of many: by how far it is from the other, whose half is in what they share."""
    size = np.array([np.cos(turn), np.sin(turn), 0.5, -0.5])
    rng = np.random.default_rng(SEED + 2)
    small = 1e-4 * rng.normal(size=(runs, 90))
    for share, seen in ((0.205, True), (0.195, False)):
        # One coefficient less than the others': of the run's own energy it is this share.
        own = float(size @ size)
        across = np.array([-size[1], size[0], 0.5, 0.5])
        across *= np.sqrt(own / float(across @ across) * share / (1.0 - share))
        odd = size + across
        assert float(across @ across) / float(odd @ odd) == pytest.approx(share)
        pairs = [size] * (runs - 1) + [odd]
        for place in (0, runs - 1):
            order = np.roll(pairs, place + 1, axis=0)
            found = far_runs([sums_of(p, noise=n) for p, n in zip(order, small, strict=True)])
            named = [i for i, _ in found]
            if runs > 2:
                assert named == ([place] if seen else [])
            else:  # of two either may be the odd one; the smaller is farther by its own energy
                assert (place in named) == seen


@pytest.mark.parametrize("runs", [2, 4])
def test_how_far_a_run_is_is_told_in_the_scatter_of_its_coefficients(runs):
    """n/2 of the squares of the distance, over the noise of all and its coefficients."""
    print("seed", SEED + 3)
    rng = np.random.default_rng(SEED + 3)
    noise = 0.05 * rng.normal(size=(runs, 90))
    pairs = np.array([[1.0, 0.0]] * (runs - 1) + [[-1.0, 0.5]])
    sums = [sums_of(p, noise=n) for p, n in zip(pairs, noise, strict=True)]
    alone = np.array([np.linalg.solve(one.gram, one.moment) for one in sums])
    left = sum(one.squares - float(one.moment @ b) for one, b in zip(sums, alone, strict=True))
    variance = left / (runs * (90.0 - 3.0))
    apart = alone[1] - alone[0] if runs == 2 else alone[-1] - np.median(alone, axis=0)
    found = dict(far_runs(sums))
    assert found[runs - 1] == pytest.approx(45.0 * float(apart @ apart) / (2.0 * variance))
