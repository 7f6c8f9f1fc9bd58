"""What the account says first, in units and shares that agree with each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle import CalibrationRun
from trueangle.cli import main
from trueangle.diagnosis.summary import diagnosis_summary
from trueangle.simulation import Backlash, Joint, LocalDefect, RunDesign, Simulation, ZeroSlip

SIGMA = 2.0


@pytest.fixture(scope="module")
def geared():
    """Order 1 of 60 arcsec of a geared joint, and order 2 of 5."""
    rng = np.random.default_rng(4711)
    runs = []
    for _ in range(3):
        theta = np.sort(rng.uniform(0.0, 2.0 * np.pi, 300))
        error = 60.0 * np.sin(theta) + 5.0 * np.sin(2.0 * theta) + rng.normal(0.0, SIGMA, 300)
        runs.append(CalibrationRun(theta, theta + np.radians(error / 3600.0), time=theta))
    found = ta.diagnose(runs, Simulation(joint=Joint(gear_ratio=100.0)))
    # Without readings no further runs are planned, which takes ten times as long as the rest.
    return replace(found, runs=[])


def test_a_headline_says_which_line_and_how_large(geared):
    first = " ".join(geared.summary().split())  # at whatever width
    one, two = (f.parameters["amplitude_arcsec"] for f in geared.findings)
    sizes = [f"({x.value:.2f} +- {x.std:.2f} arcsec)" for x in (one, two)]
    what = f"periodic error of the output, order 1 {sizes[0]}, 2 {sizes[1]}"
    assert first.startswith(f"Confirmed: {what}. ")
    # One unit for all of a joint.
    in_degrees = geared.summary(errors_in="deg")
    assert f"order 1 ({one.value / 3600.0:.6f} +- {one.std / 3600.0:.6f} deg)" in in_degrees


def test_shares_are_of_the_variance_of_the_readings(geared):
    # Order 1 alone takes 42.6 arcsec rms to 4.1.
    assert geared.structure["missing_order"] == pytest.approx(1.0 - (4.06 / 42.6) ** 2, abs=0.003)


def test_the_noise_is_what_is_left(geared):
    assert not geared.unexplained.found
    assert geared.noise == pytest.approx(geared.gain["rms_after_arcsec"], rel=0.01)
    assert geared.noise == pytest.approx(SIGMA, rel=0.1)


def test_what_was_not_asked_is_one_line(geared):
    text, in_full = geared.summary(), geared.summary(verbose=True)
    assert "whether missing_order is due to torsional_compliance" in text
    assert "no temperature was recorded" not in text
    (line,) = [x for x in text.split("\n\n")[-1].split("- ")[-1].split("\n") if "cannot show" in x]
    assert "These runs also cannot show" in line
    assert "no temperature was recorded" in in_full
    assert "cannot show, or not name" not in in_full
    # What may have made order 1 is not said of order 2.
    said = [f.parameters["explanations"].value for f in geared.findings]
    assert [any("gravity" in x for x in found) for found in said] == [True, False]
    # Nothing is lost on the way to one line.
    causes = {cause for spot in geared.not_identifiable for cause in spot.causes}
    assert all(cause in text for cause in causes)


def test_every_kind_of_size_has_its_unit():
    designs = tuple(
        RunDesign(samples=400, reversals=(0.5,), speed_deg_s=speed) for speed in (5, 30) * 3
    )
    sim = Simulation(sigma_arcsec=1.0, runs=designs)
    hidden = (Backlash(8.0), ZeroSlip(10.0), LocalDefect(120.0, 4.0, 9.0, "output"))
    result = ta.diagnose(ta.simulate(sim.with_effects(hidden), 3), sim)
    first = " ".join(result.summary().split("\n\n")[0].split())
    (bump,) = [f.parameters["place_deg"].value for f in result.findings if "local" in f.cause]
    for cause in ("backlash (", "zero slip (", f"local defect of the output at {bump:.3f} +- "):
        assert cause in first, first
    assert first.count("arcsec)") == 2
    assert "(half width 8.000" in first
    text = result.summary()
    assert "no correction can remove it" in " ".join(text.split())
    assert "fits worse by" in text
    assert "would explain" not in text
    assert diagnosis_summary(result) == text


def test_the_command_line_tells_in_full_where_asked(tmp_path, capsys):
    rng = np.random.default_rng(1)
    theta = np.sort(rng.uniform(0.0, 360.0, 200))
    rows = [f"{x:.6f},{x + e:.6f}" for x, e in zip(theta, rng.normal(0, 1e-3, 200), strict=True)]
    path = tmp_path / "runs.csv"
    path.write_text("reference_deg,indicated_deg\n" + "\n".join(rows) + "\n")
    said = []
    for options in ([], ["--verbose"]):
        assert main(["diagnose", str(path), "--gear-ratio", "1", *options]) == 0
        said.append(" ".join(capsys.readouterr().out.split()))
    assert "(why: --verbose)" in said[0]
    assert "no temperature was recorded" not in said[0]
    assert "no temperature was recorded" in said[1]


def test_a_headline_ends_with_what_to_do(geared):
    first = " ".join(geared.summary().split("\n\n")[0].split())
    assert first.endswith("What to do: write the correction model (`diagnosis.correction()`).")
    # What is in question comes after it, by the runs that separate it or by a measurement.
    spot = replace(geared.not_identifiable[0], supported=True, common="", measure="turn the mount")
    open_still = replace(geared, not_identifiable=[spot])
    assert open_still.next_steps[1:] == ["to confirm backlash: turn the mount"]
    # What no corrector can subtract is told with its reason, and a doubt asks for more runs.
    jitter = replace(geared.findings[0], cause="timestamp_jitter", effects=[])
    (step,) = replace(geared, findings=[jitter], factors=[]).next_steps
    assert step.startswith("timestamp jitter cannot be corrected (scatter has no value")
    doubt = replace(geared.findings[0], status="not_confirmed")
    assert "measure more runs" in replace(geared, findings=[doubt]).next_steps[-1]
