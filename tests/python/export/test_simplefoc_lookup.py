"""What the firmware's look-up gives, against interpolation in double precision."""

import numpy as np
import pytest

from trueangle.export import simplefoc

SEED = 63
#: Single precision of angles up to a turn, and of places among the entries.
SINGLE = 4e-6


@pytest.mark.parametrize("entries", [16, 50, 128])
@pytest.mark.parametrize("contracted", [False, True])
def test_the_short_table_is_interpolated_and_wrapped(entries, contracted):
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    table = (simplefoc._MIDDLE + rng.integers(-300, 300, entries)).astype(np.uint16)
    raw = rng.uniform(-2.0, 8.0, 500).astype(np.float32)
    found = simplefoc.corrected_short(raw, table, contracted)
    knots = (np.append(table, table[0]).astype(float) - simplefoc._MIDDLE) / simplefoc._PER_RADIAN
    turn = np.mod(raw.astype(float), 2.0 * np.pi)
    offset = np.interp(turn / (2.0 * np.pi) * entries, np.arange(entries + 1), knots)
    apart = np.mod(found - (turn - offset) + np.pi, 2.0 * np.pi) - np.pi
    np.testing.assert_allclose(apart, 0.0, atol=SINGLE)
    assert ((found >= 0.0) & (found < 6.2832)).all()
