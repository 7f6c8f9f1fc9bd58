"""What a proof says of a table: orders it loses, what its numbers leave, bounds between inputs."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
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


SHAFTS = {
    "of whole turns": [ta.Shaft("output", 1, [1, 3], [0.3, 0.0], [0.1, 0.05])],
    "of a fraction": [ta.Shaft("motor", 100.5, [1, 2], [0.004, 0.0], [0.002, 0.001])],
    "both": [
        ta.Shaft("output", 1, [1], [0.3], [0.1]),
        ta.Shaft("motor", 50.25, [1, 2], [0.004, 0.0], [0.002, 0.001]),
    ],
}
ROWS = {
    "c": r"\{(-?\d+), UINT32_C\((\d+)\), UINT32_C\((\d+)\)\}",
    # Without turns where one is like the other.
    "rust": r"^ *\((?:(-?\d+), )?(\d+), (\d+)\),$",
}


@pytest.mark.parametrize("target", ROWS)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("shafts", SHAFTS)
def test_what_a_self_test_wants_is_the_corrected_angle(
    shafts: str, argument: str, target: str
) -> None:
    """Of several turns where a shaft does not come back to its start after one."""
    model = ta.HarmonicModel(SHAFTS[shafts], constant=3.0, period=360.0, argument=argument)
    made = ta.export_model(model, target, bits=10)
    found = re.findall(ROWS[target], made.text, re.M)
    rows = np.array([[float(part or 0) for part in row] for row in found])
    assert len(rows) == 8
    turns, reading, wanted = rows[:, 0], rows[:, 1] / 2.0**32, rows[:, 2] / 2.0**32
    assert (np.ptp(turns) > 0.0) == (shafts != "of whole turns")
    left = np.asarray(model.correct((turns + reading) * 360.0)) / 360.0 - wanted
    left -= np.rint(left)
    assert np.max(np.abs(left)) * 1_296_000.0 <= made.max_difference_arcsec + 0.01


SEED = 52_900

#: Target, options, largest amplitude in degrees: the lines between so many entries leave far less
#: than their rounding; and by how much the mean of four draws may be off.
CASES = {
    "c": ({"number": "q15", "entries": 4096, "bits": 14}, 0.5, 0.05),
    "c, 32 bits": ({"number": "q31", "entries": 4096, "bits": 14}, 2e-7, 0.4),
    "rust": ({"number": "q15", "entries": 4096, "bits": 14}, 0.5, 0.05),
    "csv": ({"entries": 3600}, 5e-4, 0.1),
    "simplefoc": ({"entries": 4000, "bits": 16}, 0.5, 0.2),
    "simplefoc, float": ({"entries": 4000, "bits": 16, "variant": "minus-float"}, 0.5, 0.1),
    "moteus": ({"bits": 16}, 0.5, 0.12),
    "linuxcnc": ({"entries": 255}, 1e-4, 0.1),
    "twincat": ({"entries": 1440}, 0.5, 0.1),
    "twincat, nc": ({"entries": 3600, "variant": "nc"}, 5e-4, 0.1),
    "mechaduino": ({}, 0.5, 0.05),
    "tinymovr": ({"bits": 14, "entries": 256}, 0.5, 0.15),
    "minicheetah": ({}, 0.5, 0.1),
    "siemens840d": ({"entries": 3600}, 0.01, 0.1),
    "pmac": ({"counts_per_turn": 1 << 16, "entries": 4096}, 0.5, 0.1),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_what_rounding_leaves_is_what_is_told(case):
    options, size, near = CASES[case]
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    left = []
    for _ in range(4):
        cosine, sine = rng.uniform(0.4 * size, size, 2)
        model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [cosine], [sine])], period=360.0)
        made = ta.export_model(model, case.partition(",")[0], **options)
        left.append(made.rms_difference_arcsec / made.floor_arcsec)
    print(f"{case}: {left}, floor {made.floor_arcsec}")
    assert np.mean(left) == pytest.approx(1.0, abs=near)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("case", CASES)
def test_a_table_takes_off_what_the_model_does_whichever_angle_it_is_of(case, argument):
    """The wrong argument would leave the square of the pattern: 8 arcsec of half a degree."""
    options, _, _ = CASES[case]
    shaft = ta.Shaft("output", 1, [1, 2], [0.4, 0.0], [0.1, 0.2])
    model = ta.HarmonicModel([shaft], period=360.0, argument=argument, constant=0.1)
    made = ta.export_model(model, case.partition(",")[0], **options)
    coarse = {"tinymovr": 60.0, "simplefoc": 9.0, "moteus": 9.0, "minicheetah": 12.0}
    assert made.rms_difference_arcsec < coarse.get(case, 1.0)
    assert made.max_difference_arcsec < 6.0 * made.rms_difference_arcsec
    target = case.partition(",")[0]
    if target not in ("simplefoc", "pmac"):  # whose tables have a zero of their own
        assert made.zero_deg == pytest.approx(0.0 if target in ("c", "rust") else 0.1, abs=1e-9)


@pytest.mark.parametrize("size", [0.5, 0.01])
def test_numbers_of_24_bits_are_as_fine_as_their_neighbours(size):
    """What rounding to the nearest of single precision leaves of the largest knot, in arcsec."""
    print("seed", SEED)
    cosine, sine = np.random.default_rng(SEED).uniform(0.4 * size, size, 2)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [cosine], [sine])], period=360.0)
    largest = np.float32(np.radians(np.hypot(cosine, sine)))
    apart = float(np.nextafter(largest, np.float32(np.inf)) - largest)
    for target in ("c", "rust"):
        made = ta.export_model(model, target, number="f32", entries=4096)
        step = made.floor_arcsec * np.sqrt(18.0)
        assert step == pytest.approx(3600.0 * np.degrees(apart), rel=1e-6)
