"""Which cause a table of joints names."""

from types import SimpleNamespace

import pytest

from trueangle.reports.robot import diagnosed_rank


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
