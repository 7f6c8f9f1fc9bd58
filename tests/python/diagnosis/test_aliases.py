"""A line of free order whose phase is new in every run, read at equal steps."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.joint.lattice import aliases_of
from trueangle.simulation import Harmonic, Joint, NonIntegerOrder, RunDesign, Simulation, simulate

#: Standard errors within which an order is the hidden one.
STANDARD_ERRORS = 4.0

EVEN = RunDesign(samples=105, spacing="uniform", turns=0.7)  # 150 steps a turn


def at_speeds(sim: Simulation) -> Simulation:
    """The runs at speeds of their own: at one speed a line in time is the same."""
    speeds = (5.0, 12.0, 20.0, 33.0)
    runs = (replace(run, speed_deg_s=v) for run, v in zip(sim.runs, speeds, strict=False))
    return replace(sim, runs=tuple(runs))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(
    ("runs", "rate"),
    [
        ((EVEN, replace(EVEN, start_deg=33.3), replace(EVEN, direction=-1, start_deg=80.0)), 150.0),
        ((replace(EVEN, samples=98, turns=1.6, reversals=(0.5,)),) * 3, 61.25),
        ((replace(EVEN, samples=93, turns=0.8),) * 4, 116.25),  # steps that do not close
    ],
)
def test_the_lowest_of_orders_that_are_the_same_numbers_is_named_and_the_others_told(
    runs, rate, seed
):
    """Order 624 +- 0.007 had been confirmed, for one of 24."""
    base = at_speeds(Simulation(Joint(80.0, "flexspline", "output"), (), (), 1.0, runs))
    hidden = NonIntegerOrder(24.37, 9.0)
    found = ta.diagnose(simulate(base.with_effects([hidden]), seed), base)
    (named,) = [finding for finding in found.findings if finding.confirmed]
    assert named.cause == "non_integer_order"
    order = named.parameters["order"]
    assert abs(order.value - hidden.order) < STANDARD_ERRORS * order.std
    told = named.parameters["aliases"].value
    assert told == pytest.approx(aliases_of(order.value, rate, 3), rel=1e-9)
    assert told[0] == pytest.approx(rate - order.value)


def test_an_order_that_the_steps_do_not_show_is_among_the_aliases():
    """Two readings in a cycle at least: 24.37 at 40 steps a turn is read as 15.63."""
    runs = (replace(EVEN, samples=80, turns=2.0),) * 3
    base = at_speeds(Simulation(Joint(), (Harmonic("output", 1, 30.0),), (), 1.0, runs))
    found = ta.diagnose(simulate(base.with_effects([NonIntegerOrder(24.37, 9.0)]), 3), base)
    (named,) = [finding for finding in found.findings if finding.confirmed]
    order, told = named.parameters["order"], named.parameters["aliases"].value
    assert abs(order.value - 15.63) < STANDARD_ERRORS * order.std
    assert min(abs(alias - 24.37) for alias in told) < STANDARD_ERRORS * order.std


def test_free_angles_have_no_aliases():
    runs = (RunDesign(samples=105, turns=0.9),) * 3
    base = at_speeds(Simulation(Joint(80.0, "flexspline", "output"), (), (), 1.0, runs))
    found = ta.diagnose(simulate(base.with_effects([NonIntegerOrder(24.37, 9.0)]), 2), base)
    (named,) = [finding for finding in found.findings if finding.confirmed]
    assert named.cause == "non_integer_order"
    assert "aliases" not in named.parameters
