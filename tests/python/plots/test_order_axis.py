"""An axis of orders broken where none are: groups as wide as the root of what they span."""

import math

import pytest

from trueangle.plots.amplitudespectrum import OrderAxis

#: Share of a group's width left to each side of its orders, least width, and what is between.
MARGIN, LEAST, GAP = 0.06, 2.5, 1.0


@pytest.mark.parametrize("last", [3, 5, 17, 26])
def test_a_group_takes_the_root_of_its_span(last):
    orders = [*range(1, last + 1), 100, 101, 102]
    axis = OrderAxis.of(orders)
    assert axis.groups == [(1, last), (100, 102)]
    widths = [max(math.sqrt(last - 1), LEAST), LEAST]
    at = axis.places([1, last, 100, 102])
    inside = 1.0 - 2.0 * MARGIN
    assert at[1] - at[0] == pytest.approx(inside * widths[0])
    assert at[3] - at[2] == pytest.approx(inside * widths[1])
    assert at[2] - at[1] == pytest.approx(GAP + MARGIN * sum(widths))
    # Even within a group.
    assert axis.places(2) - at[0] == pytest.approx(inside * widths[0] / (last - 1))
