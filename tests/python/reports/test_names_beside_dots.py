"""Where the name of an order stands beside its dot: above, below, or nowhere."""

import pytest

from trueangle.plots.orderlines import OrderLine
from trueangle.reports.spectrum import _apart, _sides

LOW, HIGH = 0.0, 100.0


def name(order):
    """As long as its number; those of the output are shortened."""
    return f"output {order:g}"


@pytest.mark.parametrize(
    ("ratio", "side"),
    [
        (0.3, False),
        (0.7, False),
        (0.95, None),  # in the way of both
        (1.05, None),
        (1.5, True),  # its dot stands where the name would: below then
        (2.5, False),  # far above the name
    ],
)
def test_a_name_stands_where_no_dot_is(ratio, side):
    line, other = OrderLine(10.0, 2.0), OrderLine(11.0, 2.0 * ratio)
    assert _sides([line], [line, other], LOW, HIGH, name).get(line) is side


@pytest.mark.parametrize(("order", "beside"), [(10.0, 14.7), (10.0, 5.3), (7.0, 9.3)])
def test_dots_further_away_than_the_name_is_long_are_in_nobodys_way(order, beside):
    """A letter takes 1.2 % of the axis to each side, twice to be clear."""
    line, other = OrderLine(order, 2.0), OrderLine(beside, 2.0)
    assert line not in _sides([line], [line, other], LOW, HIGH, name)
    step = 0.3 if beside > order else -0.3
    away = OrderLine(beside + step, 2.0)
    assert _sides([line], [line, away], LOW, HIGH, name) == {line: False}


@pytest.mark.parametrize(("ratio", "both"), [(1.0, False), (1.9, False), (2.1, True), (30.0, True)])
def test_of_names_that_run_into_each_other_both_stand_if_one_dot_is_far_higher(ratio, both):
    tall, small = OrderLine(10.0, 2.0), OrderLine(11.0, 2.0 / ratio)
    assert _apart([tall, small], LOW, HIGH, name) == [tall, small][: 1 + both]
    # The first stands whatever its size, and one that is left out is in nobody's way.
    assert _apart([small, tall], LOW, HIGH, name) == [small, tall][: 1 + both]
    third = OrderLine(13.0, 2.0 / ratio)
    beside = OrderLine(16.0, 2.0 / ratio)
    assert _apart([tall, third, beside], LOW, HIGH, name) == (
        [tall, third] if both else [tall, beside]
    )
    away = OrderLine(60.0, 2.0)
    assert _apart([tall, away], LOW, HIGH, name) == [tall, away]
