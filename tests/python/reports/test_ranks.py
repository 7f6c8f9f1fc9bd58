"""Which cause a table of joints names, and where a still picture puts its categories."""

from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.reports.robot import diagnosed_rank
from trueangle.reports.stills import _Placement


@pytest.mark.parametrize(
    ("findings", "first", "verdict"),
    [
        ([("a", True), ("b", True), ("c", True)], "a", "explained"),
        ([("a", False), ("b", True), ("c", True)], "b", "explained"),
        ([("a", False)], None, "simulation is enough"),
        ([], None, "simulation is enough"),
    ],
)
@pytest.mark.parametrize("is_open", [False, True])
def test_the_first_confirmed_cause_is_the_first(findings, first, verdict, is_open):
    found = SimpleNamespace(
        findings=[SimpleNamespace(cause=c, confirmed=sure) for c, sure in findings],
        unexplained=SimpleNamespace(found=is_open),
        gain={"rms_after_arcsec": 3.0},
        discrepancy=SimpleNamespace(peak_to_peak=17.0),
    )
    row = diagnosed_rank("knee", found)
    assert row.first_cause == first
    assert row.verdict == ("unexplained" if is_open else verdict)
    assert (row.peak_to_peak_before_arcsec, row.rms_left_arcsec) == (17.0, 3.0)


def test_categories_of_a_still_stand_from_the_top_down():
    """Pixels grow downwards: the first category is the highest one, each at its middle."""
    names = ["first", "second", "third"]
    across = SimpleNamespace(log=False, limits=(0.0, 1.0), categories=None)
    up = SimpleNamespace(log=False, limits=None, categories=names)
    placed = _Placement([], across, up, (0.0, 100.0), (90.0, 0.0))
    np.testing.assert_allclose(placed.of(names, 1), [15.0, 45.0, 75.0])
