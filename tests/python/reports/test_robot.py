"""The rank of a joint: its verdict in every case, its sizes as they were measured."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.pattern import Harmonic
from trueangle.reports.robot import (
    JointRank,
    checked_rank,
    diagnosed_rank,
    fitted_rank,
    ranked,
    ranking_text,
)
from trueangle.simulation import RunDesign, Simulation

SIZE, NOISE = 40.0, 1.0


@pytest.fixture(scope="module")
def found():
    """A diagnosis of one line of 40 arcsec that the simulation lacks."""
    line = Harmonic("output", 2, SIZE)
    hidden = Simulation(harmonics=(line,), sigma_arcsec=NOISE)
    return ta.diagnose(ta.simulate(hidden, runs=[RunDesign(samples=720)]), Simulation(), gain=False)


@pytest.mark.parametrize("named", [False, True])
@pytest.mark.parametrize("left", [None, False, True])
def test_the_verdict_is_what_a_diagnosis_found_and_left(found, named, left):
    """Unexplained where something is, not where it was looked for."""
    (finding,) = found.findings
    assert finding.confirmed
    rest = None if left is None else replace(found.unexplained, found=left)
    open_ = replace(finding, status="not_confirmed")
    case = replace(found, findings=[open_, *[finding] * named], unexplained=rest)
    rank = diagnosed_rank("elbow", case)
    wanted = "explained" if named else "differs, not named"
    assert rank.verdict == ("unexplained" if left else wanted)
    assert rank.first_cause == (finding.cause if named else None)
    assert rank.peak_to_peak_before_arcsec == pytest.approx(2.0 * SIZE, abs=8.0 * NOISE)


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi, 1.0])
def test_the_rank_of_a_fit_is_in_arcsec_whatever_the_unit(period):
    x = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    rest = np.where(np.arange(720) % 2, 1.0, -1.0)
    error = (20.0 * np.sin(x) + 30.0 * np.sin(3.0 * x) + rest) / 1_296_000.0
    runs = [ta.CalibrationRun(x / (2.0 * np.pi) * period, (x / (2.0 * np.pi) + error) * period,
                              period)]  # fmt: skip
    rank = fitted_rank("elbow", runs, ta.fit(runs, orders=[1, 3]))
    # Of 720 readings with five coefficients.
    assert rank.rms_left_arcsec == pytest.approx(np.sqrt(720.0 / 715.0), rel=1e-6)
    assert rank.peak_to_peak_before_arcsec == pytest.approx(np.ptp(error) * 1_296_000.0, rel=1e-6)
    assert (rank.verdict, rank.first_cause) == ("calibrated", "order 3 of output")


@pytest.mark.parametrize("faults", [(), ("stale_samples",), ("wrong_sign", "mixed_units")])
@pytest.mark.parametrize("usable", [False, True])
def test_the_rank_of_a_check_is_its_first_fault(faults, usable):
    found = SimpleNamespace(data_faults=[SimpleNamespace(fault=f) for f in faults], usable=usable)
    verdict = "usable" if usable else "not usable"
    cause = faults[0] if faults else None
    assert checked_rank("hip", found, None) == JointRank("hip", None, None, verdict, cause)
    assert checked_rank("hip", found, []) == JointRank("hip", None, None, verdict, cause)


def test_what_cannot_be_used_stands_first_then_the_largest():
    rows = [
        JointRank("a", 3.0, 1.0, "calibrated", None),
        JointRank("b", None, None, "no model: none", None),
        JointRank("c", 7.5, 2.0, "calibrated", "order 1 of output"),
    ]
    assert [row.joint for row in ranked(rows)] == ["b", "c", "a"]
    lines = ranking_text("Fit:", ranked(rows), "arcsec").splitlines()
    assert [line.split()[0] for line in lines[-3:]] == ["b", "c", "a"]
    assert [float(cell) for cell in lines[-2].split()[1:3]] == [7.5, 2.0]


@pytest.mark.parametrize(
    ("findings", "first", "verdict"),
    [
        ([("a", True), ("b", True), ("c", True)], "a", "explained"),
        ([("a", False), ("b", True), ("c", True)], "b", "explained"),
        ([("a", False)], None, "differs, not named"),
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
        in_question=[],
        factors=[],
    )
    row = diagnosed_rank("knee", found)
    assert row.first_cause == first
    assert row.verdict == ("unexplained" if is_open else verdict)
    assert (row.peak_to_peak_before_arcsec, row.rms_left_arcsec) == (17.0, 3.0)
