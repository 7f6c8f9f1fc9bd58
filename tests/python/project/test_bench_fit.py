"""The fit benchmark compares like with like: all ways give the same coefficients."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))

from harness import fit
from harness.fit import Case, fit_peers, measure_fits, quick_fits

# Ours relative to the largest coefficient; the error is a difference of angles of a turn.
AGREES = 1e-11


@pytest.mark.parametrize(
    ("case", "methods"),
    [
        (Case(500, 3), ("plain", "moments", "qr")),
        (Case(2000, 3, counts=200), ("plain", "moments", "counts")),
    ],
)
def test_every_way_solves_the_same_problem(case, methods):
    rows = measure_fits(case, rounds=1, methods=methods)
    names = {row.name for row in rows}
    assert names >= {"trueangle, 1 thread", "trueangle, 2 threads", "numpy.linalg.lstsq"}
    assert names >= set(fit_peers()[0])
    for row in rows:
        assert row.deviation < AGREES, row
        assert row.timing.least <= row.timing.median <= row.timing.most


def test_a_way_that_differs_is_told_by_the_share_of_the_largest_coefficient(monkeypatch):
    def off(theta, error, highest):
        found = fit_peers()[0]["numpy.linalg.lstsq"](theta, error, highest)
        moved = np.zeros_like(found)
        moved[np.argmin(np.abs(found))] = 0.25 * np.abs(found).max()
        return found + moved

    monkeypatch.setattr(fit, "fit_peers", lambda: ({"off": off}, []))
    (row,) = [row for row in measure_fits(Case(300, 3), rounds=1) if row.name == "off"]
    assert row.deviation == pytest.approx(0.25, rel=1e-6)


def test_quick_fits_are_a_polygon_and_a_log():
    """17 orders of a log: with five, all that differs is how fast the readings are read."""
    asked = {(row.case.samples, row.case.highest) for row in quick_fits(700, rounds=1)}
    assert asked == {(37, 5), (700, 17)}
