"""Tables of the firmware's arithmetic: how many numbers there must be, and what lies between."""

import numpy as np
import pytest

from trueangle import _core
from trueangle.errors import ArgumentError

#: Numbers a knot takes: a value, and for a cubic its slope over a segment.
PER_KNOT = {"linear": 1, "cubic": 2}


def ramp(method, bits, dtype, rise):
    """Knots of a line that rises so much a segment."""
    values = rise * np.arange(2**bits + 1)
    knots = values if method == "linear" else np.column_stack([values, np.full_like(values, rise)])
    return np.ascontiguousarray(knots.ravel(), dtype=dtype)


@pytest.mark.parametrize("method", PER_KNOT)
@pytest.mark.parametrize("bits", [1, 2, 7])
def test_a_line_is_a_line_between_its_knots(method, bits):
    angles = np.linspace(0, 2**32 - 1, 999).astype(np.uint32)
    along = angles / 2.0**32 * 2**bits
    for dtype, rise, near in (
        (np.float32, 0.125, 1e-5),
        (np.int32, 1 << 16, 1.0),
        (np.int16, 9, 1.0),
    ):
        knots = ramp(method, bits, dtype, rise)
        assert knots.size == (2**bits + 1) * PER_KNOT[method]
        found = _core.table_correction(method, knots, bits, 0, angles)
        np.testing.assert_allclose(found, rise * along, rtol=0, atol=near, err_msg=str(dtype))


@pytest.mark.parametrize("method", PER_KNOT)
@pytest.mark.parametrize("bits", [1, 4, 16])
def test_a_table_has_a_knot_at_each_end_of_each_segment(method, bits):
    angles = np.zeros(3, dtype=np.uint32)
    wanted = (2**bits + 1) * PER_KNOT[method]
    assert not _core.table_correction(method, np.zeros(wanted, "i2"), bits, 15, angles).any()
    for size in (wanted - 1, wanted + 1, wanted // 2, 2 * wanted):
        with pytest.raises(ArgumentError, match=f"needs {wanted} numbers.* got {size} numbers"):
            _core.table_correction(method, np.zeros(size, "i2"), bits, 0, angles)
    with pytest.raises(ArgumentError, match="a shift of 16"):
        _core.table_correction(method, np.zeros(wanted, "i2"), bits, 16, angles)


@pytest.mark.parametrize("bits", [0, 17])
def test_a_table_has_1_to_16_bits(bits):
    with pytest.raises(ArgumentError, match="1 to 16 bits"):
        _core.table_correction("linear", np.zeros(2, "i2"), bits, 0, np.zeros(1, dtype=np.uint32))
    with pytest.raises(ArgumentError, match="no method"):
        _core.table_correction("square", np.zeros(3, "i2"), 1, 0, np.zeros(1, dtype=np.uint32))
