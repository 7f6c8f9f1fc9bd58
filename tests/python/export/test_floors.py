"""What the number format alone leaves, as it is told, against tables that leave nothing else."""

import numpy as np
import pytest

import trueangle as ta

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
