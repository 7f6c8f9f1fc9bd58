"""Which way the mount of the reference counts: one way for all of its lines."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.simulation import (
    Harmonic,
    LoadDependentGearError,
    ReferenceLines,
    RunDesign,
    Simulation,
    simulate,
)

SWEEP = RunDesign(samples=60, turns=2.0, reversals=(0.5,), speed_deg_s=4.0)
LINES = (Harmonic("output", 1, 12.0, 70.0), Harmonic("output", 4, 25.0))

#: Standard errors within which an amplitude is the hidden one.
STANDARD_ERRORS = 4.0


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("order", [2.0, 3.0])
def test_a_line_of_another_size_in_either_run_is_no_reference(order, seed):
    """Load and mount changed together: two lines of one order, the mount counted both ways."""
    runs = (
        replace(SWEEP, torque_Nm=9.0, temperature_C=20.0, mount_deg=50.0),
        replace(SWEEP, torque_Nm=18.0, temperature_C=31.0, mount_deg=85.0),
    )
    base = Simulation(sigma_arcsec=1.0, harmonics=LINES, runs=runs)
    hidden = LoadDependentGearError(((order, 0.3, 54.0),))
    found = ta.diagnose(simulate(base.with_effects([hidden]), seed), base)
    assert "reference_error" not in [f.cause for f in found.findings if f.confirmed]


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_all_lines_of_a_reference_have_its_sign(sign, seed):
    runs = tuple(replace(SWEEP, mount_deg=mount) for mount in (0.0, 50.0, 130.0, 205.0))
    base = Simulation(sigma_arcsec=1.0, harmonics=LINES, runs=runs)
    hidden = ReferenceLines((1.0, 2.0, 5.0), (9.0, 6.0, 4.0), (20.0, 130.0, 250.0), sign)
    found = ta.diagnose(simulate(base.with_effects([hidden]), seed), base)
    (named,) = [finding for finding in found.findings if finding.confirmed]
    assert named.cause == "reference_error"
    told = {name: named.parameters[name] for name in ("orders", "amplitudes", "mount_sign")}
    assert told["mount_sign"].value == [sign] * 3
    found_lines = zip(*(told[name].value for name in ("orders", "amplitudes")), strict=True)
    hidden_lines = dict(zip(hidden.orders, hidden.amplitudes_arcsec, strict=True))
    for (order, size), std in zip(found_lines, told["amplitudes"].std, strict=True):
        assert abs(size - hidden_lines[order]) < STANDARD_ERRORS * std
