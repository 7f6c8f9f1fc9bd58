"""Orders that positions can tell: below half of their number, whatever is left to the planner."""

import pytest

from trueangle.planning import plan_mounts


@pytest.mark.parametrize(
    ("positions", "highest"), [(5, 2), (6, 2), (7, 3), (8, 3), (9, 4), (12, 5)]
)
def test_low_orders_end_below_half_of_the_positions(positions, highest):
    plan = plan_mounts(101, positions=positions, mounts=6)
    assert [order for order in plan.noise_factors if order < 101] == [*range(1, highest + 1)]
