"""What a proof says of a table: orders it loses, what its numbers leave, bounds between inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.export import proof as room
from trueangle.export.knots import rounding_floor
from trueangle.export.proof import Proof, enough_bits, lost_orders, prove_export, rounded_up
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


@pytest.mark.parametrize("asked", [1, 11, 12, 32])
@pytest.mark.parametrize("entries", [1, 47, 255, 256, 257, 65_536])
def test_so_many_bits_put_sixteen_inputs_on_a_line(asked: int, entries: int) -> None:
    bits = enough_bits(asked, entries)
    assert bits >= asked
    assert 2**bits >= 16 * entries
    assert bits == asked or 2 ** (bits - 1) < 16 * entries


@pytest.mark.parametrize("asked", [0, 33, -5])
def test_a_reading_has_1_to_32_bits(asked: int) -> None:
    with pytest.raises(ArgumentError, match=f"bits must be from 1 to 32, got {asked}"):
        enough_bits(asked, 4)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("batch", [1 << 16, 1 << 7, 1000])
def test_of_several_variants_the_worst_counts(
    batch: int, swapped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One is far off at a single input, and by whole turns; the other a little all over."""
    monkeypatch.setattr(room, "_BATCH", batch)
    spike = 700

    def alone(places: np.ndarray) -> np.ndarray:
        at = places >> 20
        return 9.0 / ARCSEC * (at == spike) + 1.0 * (at % 3 == 0) - 2.0 * (at % 5 == 0)

    def wide(places: np.ndarray) -> np.ndarray:
        return wave(2, 4.0, 0.3)(places / TURN)

    variants = [wide, alone] if swapped else [alone, wide]
    found = prove_export(iter(variants), np.zeros_like, 12)
    assert found.max_arcsec == pytest.approx(9.0, abs=1e-4)
    assert found.rms_arcsec == pytest.approx(4.0 / np.sqrt(2.0), rel=1e-9)
    assert (found.worst, found.inputs) == (spike << 20, 4096)
    assert (found.every_input, found.margin_arcsec) == (True, 0.0)


@pytest.mark.parametrize("batch", [1 << 16, 1 << 6])
@pytest.mark.parametrize(
    ("bits", "turns", "inputs"),
    [
        (10, 1, 1 << 8),
        (8, 1, 1 << 8),
        (7, 1, 1 << 7),
        (7, 2, 2 << 7),
        (7, 3, 3 << 6),
        (9, 3, 3 << 6),
    ],
)
def test_finer_inputs_are_bounded_by_those_evaluated(
    bits: int, turns: int, inputs: int, batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a budget of 256 inputs: against every single one, of every turn."""
    monkeypatch.setattr(room, "EVERY_INPUT_BITS", 8)
    monkeypatch.setattr(room, "_BATCH", batch)

    def table(places: np.ndarray) -> np.ndarray:
        x = places / TURN
        return wave(2, 30.0, 0.4)(x) + wave(1.0 / turns, 20.0, 1.0)(x)

    found = prove_export([table], wave(1, 15.0, 0.2), bits, turns=turns)
    every = np.arange(turns << bits, dtype=np.int64) << (32 - bits)
    difference = np.abs(table(every) - wave(1, 15.0, 0.2)(every / TURN)) * ARCSEC
    assert (found.inputs, found.turns) == (inputs, turns)
    assert found.every_input == (inputs == turns << bits)
    assert (
        difference.max() <= found.max_arcsec <= difference.max() + 2.0 * found.margin_arcsec + 2e-6
    )
    at = every.tolist().index(found.worst)
    assert difference[at] == pytest.approx(found.max_arcsec - found.margin_arcsec, abs=2e-6)
    step = (turns << bits) // inputs
    looked_at = difference[::step]
    assert found.rms_arcsec == pytest.approx(np.sqrt(np.mean(looked_at**2)), rel=1e-9)


def test_lost_orders_are_whole_and_up_to_the_highest() -> None:
    """Whole turns are nothing; 16.6 is looked for as 17; of no order nothing is lost."""
    top = 129.0

    def coarse(places: np.ndarray) -> np.ndarray:
        jumps = 1.0 * (places >> 31) - 3.0 * (places >> 30 == 1)
        return jumps + wave(top, 0.5, 0.3)(places / TURN) + wave(17, 0.25, 1.0)(places / TURN)

    found = lost_orders(coarse, np.zeros_like, [16.6, top, 3.2, 17.4])
    assert found == pytest.approx({3: 0.0, 17: 0.25, 129: 0.5}, abs=1e-6)
    assert lost_orders(coarse, np.zeros_like, []) == {}


@pytest.mark.parametrize("top", [5, 128, 129, 1000])
def test_the_highest_order_has_32_readings_a_cycle_at_least(top: int) -> None:
    seen: list[int] = []

    def counted(places: np.ndarray) -> np.ndarray:
        seen.append(places.size)
        return np.zeros(places.size)

    assert list(lost_orders(counted, np.zeros_like, [1, top])) == [1, top]
    (size,) = seen
    assert size >= max(4096, 32 * top)
    assert size == 4096 or size < 64 * top


def test_an_order_beyond_what_can_be_evaluated_is_not_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(room, "EVERY_INPUT_BITS", 6)
    found = lost_orders(lambda places: wave(32, 2.0, np.pi / 2)(places / TURN), np.zeros_like,
                        [31, 32, 33])  # fmt: skip
    assert list(found) == [31, 32]
