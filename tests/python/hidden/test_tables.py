"""Tables of equal steps in other designs: few positions, any order, neighbours that share noise."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

from .openworld.logs import LINES, table

#: Orders and arcsec.
FEW, SEVERAL = ((1, 38.0), (4, 10.0)), ((1, 23.0), (3, 19.0), (5, 9.0))

#: Positions, runs, lines, order of the positions, share of noise, seed.
CASES = {
    "order 72 is a constant and no other line": (72, 1, ((5, 90.0),), "forward", 0.0, 2),
    "positions left out of a random order": (20, 1, FEW, "random", 0.8, 2),
    "lines that look like wander": (200, 1, SEVERAL, "back", 0.8, 6),
    "between two lines there is no third": (400, 1, LINES, "forward", 0.0, 104),
    "noise whose steps are no lost counts": (72, 1, (), "forward", 0.8, 4),
}


@pytest.mark.parametrize("case", CASES)
def test_lines_of_a_table_and_nothing_else(case):
    positions, runs, lines, visited, shared, seed = CASES[case]
    rng = np.random.default_rng(seed)
    result = ta.diagnose(table(positions, runs, rng, lines, visited, shared), Simulation())
    found = [(f.cause, f.parameters["output_order"].value) for f in result.findings if f.confirmed]
    assert sorted(found) == [("missing_order", m) for m, _ in lines], result.summary()
    assert not result.unexplained.found
