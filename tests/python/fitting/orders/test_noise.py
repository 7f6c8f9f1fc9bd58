"""Noise from repeats against dense matrices: residual and rank of places and zeros."""

import numpy as np
import pytest

from trueangle.fitting.orders.noise import pure_error
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings
from trueangle.runs.aliasing import Positions

SEED = 46_700


def drawn(rng, groups):
    """Units over places of their group alone, so that no place connects groups."""
    units, index = [], []
    for unit in range(int(rng.integers(2, 7))):
        own = unit % groups
        places = 5 * own + rng.integers(0, 5, int(rng.integers(1, 9)))
        weights = rng.uniform(0.5, 2.0, places.size)
        error = rng.normal(size=places.size)
        units.append(ZeroGroupReadings(places / 20.0, error, weights, str(unit)))
        index.append(places)
    used, place = np.unique(np.concatenate(index), return_inverse=True)
    return units, Positions(used / 20.0, place, None, ())


@pytest.mark.parametrize("groups", [1, 2, 3])
def test_degrees_of_freedom_are_readings_less_the_rank(groups):
    """Of groups of units that no place connects each has a zero of its own to spare."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, groups])
    seen = 0
    for _ in range(200):
        units, positions = drawn(rng, groups)
        unit = np.repeat(np.arange(len(units)), [u.turns.size for u in units])
        design = np.column_stack(
            [positions.index[:, None] == np.arange(len(positions)),
             unit[:, None] == np.arange(len(units))]
        ).astype(float)  # fmt: skip
        root = np.sqrt(np.concatenate([u.weights for u in units]))
        error = np.concatenate([u.error for u in units]) * root
        design = design * root[:, None]
        rest = error - design @ np.linalg.lstsq(design, error, rcond=None)[0]
        freedom = error.size - np.linalg.matrix_rank(design)
        found = pure_error(units, positions)
        if freedom < 1:
            assert found is None
            continue
        seen += 1
        assert (found.degrees_of_freedom, found.source) == (freedom, "repeats")
        # Means are taken by turns, twenty times: of unlike weights a part in a thousand is left.
        assert found.variance == pytest.approx(float(rest @ rest) / freedom, rel=0.02, abs=1e-9)
    assert seen > 60
