"""What a proof says of a table: orders it loses, what its numbers leave, bounds between inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.export.oneturn import rounding_floor
from trueangle.export.proof import Proof, lost_orders, prove_export, rounded_up
from trueangle.export.table import make_table

ARCSEC = 1_296_000.0
TURN = 2.0**32


def wave(order: float, size: float, phase: float):
    return lambda x: size / ARCSEC * np.sin(2.0 * np.pi * order * x + phase)


def test_an_order_is_lost_by_the_amplitude_that_differs() -> None:
    """3 arcsec of order 2 and 0.4 of order 7, whatever a constant is off by."""
    two, seven, exact = wave(2, 3.0, 0.4), wave(7, 0.4, 2.0), wave(1, 500.0, 1.0)
    found = lost_orders(
        lambda places: sum(f(places / TURN) for f in (two, seven, exact)) + 1e-3, exact, [1, 2, 7]
    )
    assert found == pytest.approx({1: 0.0, 2: 3.0, 7: 0.4}, abs=1e-6)


@pytest.mark.parametrize("continuous", [False, True])
def test_a_proof_has_the_largest_and_the_mean_of_squares(continuous: bool) -> None:
    """Of a sine of 5 arcsec; between inputs half of a step more, and the target's rounding."""
    size, resolution = 5.0, 0.01 / ARCSEC
    found = prove_export(
        [lambda places: wave(3, size, 0.1)(places / TURN)], np.zeros_like, 12,
        resolution, continuous=continuous,
    )  # fmt: skip
    assert found.rms_arcsec == pytest.approx(size / np.sqrt(2.0), rel=1e-9)
    step = size * 2.0 * np.pi * 3.0 / 2**12
    margin = step / 2.0 + 0.01 if continuous else 0.0
    assert found.every_input == (margin == 0.0)
    assert found.margin_arcsec == pytest.approx(margin, rel=1e-4)
    assert found.max_arcsec == pytest.approx(size + margin, abs=2e-4)
    assert abs(wave(3, size, 0.1)(found.worst / TURN)) * ARCSEC == pytest.approx(size, abs=2e-4)


def test_what_rounded_numbers_leave_is_that_of_lines_between_them() -> None:
    """Knots off by up to half a step, each by itself, and lines between: a root of 1/18."""
    rng = np.random.default_rng(74_000)
    table = make_table("output", 1.0, wave(1, 3000.0, 0.0), "linear", "q15", 256)
    knots = rng.uniform(-0.5, 0.5, 20_001) * table.step
    lines = np.interp(rng.uniform(0.0, 20_000.0, 100_000), np.arange(20_001), knots)
    expected = np.sqrt(np.mean(lines**2)) * ARCSEC
    assert table.floor_arcsec == pytest.approx(expected, rel=0.03)
    assert rounding_floor(table.step) == pytest.approx(expected, rel=0.03)


@pytest.mark.parametrize("digits", [2, 4, 6])
def test_a_bound_that_is_printed_stays_one(digits: int) -> None:
    for value in 10.0 ** np.random.default_rng(digits).uniform(-6.0, 4.0, 200):
        shown = rounded_up(float(value), digits)
        assert value <= shown <= value * (1.0 + 1.001 * 10.0 ** (1 - digits))
        assert float(f"{shown:.{digits}g}") == shown


@pytest.mark.parametrize(("turns", "over"), [(1, ""), (2, " over 2 turns")])
def test_inputs_are_told_with_the_turns_that_they_are_over(turns, over):
    proof = Proof(0.1, 0.05, 4096, True, 0.02, 7, turns)
    assert proof.how == f"every one of 4096 inputs{over} evaluated"
    between = replace(proof, every_input=False).how
    assert between.startswith(f"4096 inputs{over} evaluated, and 0.02 arcsec for what lies")
