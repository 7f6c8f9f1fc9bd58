"""Calibration plans against tabulated noise factors."""

import json
import math
import re

import numpy as np
import pytest

from trueangle.cli import main
from trueangle.errors import ArgumentError, NoModelError
from trueangle.planning import plan_encoder, plan_mounts, plan_tilts, readings_needed, wanted_orders
from trueangle.planning.noisefactors import facet_noise_factor, mount_noise_factors, noise_factors

# The tables give factors with two or three digits.
TABLE = 0.006
WANTED = wanted_orders(100)


def worst(offsets, orders=WANTED, positions=36):
    return float(mount_noise_factors(positions, offsets, orders).max())


@pytest.mark.parametrize(
    ("offsets", "factor"),
    [((0, 2.14), 1.28), ((0, 2.04), 1.55), ((0, 1.99), 1.79), ((0, 5.73, 7.82), 1.02)],
)
def test_factors_of_mounts(offsets, factor):
    assert worst(offsets) == pytest.approx(factor, abs=TABLE)


def test_the_plan_finds_the_best_two_and_three_mounts():
    two, three = plan_mounts(100, 36, 2), plan_mounts(100, 36, 3)
    assert two.mount_offsets_deg == (0.0, 2.14)
    assert two.worst_noise_factor == pytest.approx(1.28, abs=TABLE)
    assert three.worst_noise_factor <= 1.02 + TABLE
    assert plan_mounts(50, 36, 3).worst_noise_factor <= 1.20 + TABLE
    # Within +-0.1 deg the factor of two mounts stays below 1.65.
    assert max(worst((0, 2.14 + d)) for d in np.linspace(-0.1, 0.1, 41)) <= 1.65
    assert two.tolerance_deg >= 0.1
    edge = two.tolerance_deg
    assert max(worst((0, 2.14 + d)) for d in np.linspace(-edge, edge, 41)) <= 2.0


@pytest.mark.parametrize("parts", [2, 3, 4, 6, 8])
def test_even_parts_of_the_pitch_stay_singular(parts):
    offsets = [10.0 * j / parts for j in range(parts)]
    assert math.isinf(worst(offsets))


@pytest.mark.parametrize("parts", [5, 7])
def test_fifths_and_sevenths_of_the_pitch_work(parts):
    assert worst([10.0 * j / parts for j in range(parts)]) == pytest.approx(1.0)


@pytest.mark.parametrize(("ratio", "mounts"), [(80, 2), (100, 2), (160, 2), (50, 3), (120, 4)])
def test_the_fullest_class_says_how_many_mounts_are_needed(ratio, mounts):
    assert math.isfinite(plan_mounts(ratio, 36, mounts).worst_noise_factor)
    with pytest.raises(NoModelError, match=f"at least {mounts} mounts"):
        plan_mounts(ratio, 36, mounts - 1)


def test_order_360_of_ratio_120_is_invisible():
    plan = plan_mounts(120, 36, 4)
    assert plan.invisible_orders == (360,)
    assert "not determined: 360; others: standard" in plan.summary()
    few = plan_mounts(None, 3, 6)  # more mounts than facets
    assert len(few.facet_shifts) == 6
    assert "above 1 are omitted" in few.notes[0]


def test_classes_agree_with_the_dense_design():
    random = np.random.default_rng(7)
    for divisions in (36, 23, 24):
        offsets = random.uniform(0, 360 / divisions, 4)
        orders = [1, 2, 5, 100, 101, 202, 12, 36 + 18]
        orders = [m for m in orders if m % divisions]
        turns = (np.arange(divisions) / divisions + offsets[:, None] / 360.0).ravel()
        zeros = np.repeat(np.arange(4), divisions)
        # Both solve the same normal equations in double precision.
        np.testing.assert_allclose(
            mount_noise_factors(divisions, offsets, orders),
            noise_factors(turns, orders, zeros),
            rtol=1e-8,
        )


@pytest.mark.parametrize(
    ("shifts", "factor"),
    [((0, 1), 8.11), ((0, 5, 13), 2.06), ((0, 28, 30), 1.04), ((0, 2, 24, 32), 0.64)],
)
def test_facet_shifts(shifts, factor):
    assert float(facet_noise_factor(36, shifts)) == pytest.approx(factor, abs=TABLE)


@pytest.mark.parametrize("shifts", [(0, 18), (0, 9), (0, 12, 24)])
def test_facet_shifts_that_share_a_factor_are_impossible(shifts):
    assert math.isinf(float(facet_noise_factor(36, shifts)))


def test_the_plan_finds_the_best_facet_shifts():
    assert plan_mounts(100, 36, 3).facet_noise_factor == pytest.approx(1.04, abs=TABLE)
    assert plan_mounts(100, 36, 4).facet_noise_factor == pytest.approx(0.64, abs=TABLE)
    assert float(facet_noise_factor(36, np.arange(36))) == pytest.approx(1 / 6)


@pytest.mark.parametrize(
    ("tilt", "tilts", "factor"),
    [
        (300, 2, 6.4),
        (600, 2, 3.2),
        (900, 2, 2.2),
        (1200, 2, 1.70),
        (1800, 2, 3.2),
        (1800, 4, 1.57),
        (3600, 4, 1.03),
    ],
)
def test_off_null_readings(tilt, tilts, factor):
    plan = plan_tilts(100, tilts=tilts, tilt_arcsec=tilt)
    # One digit behind the point where the table has one.
    assert plan.worst_noise_factor == pytest.approx(factor, abs=0.05)


@pytest.mark.parametrize("tilt", [450.0, 1200.0, 3700.0])
def test_what_an_error_of_the_autocollimators_scale_makes_of_a_tilt_is_told(tilt):
    """The share that is said times the largest tilt of the plan itself."""
    plan = plan_tilts(None, orders=[1, 2], tilt_arcsec=tilt)
    (note,) = [note for note in plan.notes if "scale" in note]
    percent, left = re.search(r"an error of (\S+) % is (\S+) arcsec here", note).groups()
    largest = 3600.0 * max(map(abs, plan.mount_offsets_deg))
    # Printed to two digits.
    assert float(left) == pytest.approx(float(percent) / 100.0 * largest, rel=0.06)


def test_a_free_encoder():
    plan = plan_encoder(100)
    assert plan.positions == 820
    assert plan.worst_noise_factor < 1.1
    dense = noise_factors(np.arange(820) / 820, range(1, 410))
    assert dense.max() == pytest.approx(1.0)
    golden = noise_factors((np.arange(144) * 0.5 * (5**0.5 - 1)) % 1.0, WANTED)
    assert 1.05 <= golden.max() <= 1.25


def test_readings_for_a_standard_error():
    assert readings_needed(5.0, 0.5, 1.02) == 209
    plan = plan_mounts(100, 36, 3, noise=5.0, standard_error=0.5)
    # Three mounts of 36, each twice: what the table calls 6 rounds.
    assert plan.readings == 216
    with pytest.raises(ArgumentError, match="both `noise=` and `standard_error=`"):
        plan_mounts(100, noise=5.0)


@pytest.mark.parametrize("wrong", [{"positions": 2}, {"mounts": 0}])
def test_bad_numbers_are_named(wrong):
    with pytest.raises(ArgumentError, match=next(iter(wrong))):
        plan_mounts(100, **wrong)


def test_command_prints_the_contracts_json(capsys):
    assert main(["plan", "--gear-ratio", "100", "--mounts", "2", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["mount_offsets_deg"] == [0.0, 2.14]
    assert plan["worst_noise_factor"] == pytest.approx(1.28, abs=TABLE)
    assert len(plan["facet_shifts"]) == 2
    assert set(plan["noise_factors"]) == {str(m) for m in WANTED}
    assert plan["tolerance_deg"] >= 0.1


def test_command_prints_text_and_refuses_too_few_mounts(capsys):
    assert main(["plan", "--gear-ratio", "100"]) == 0
    assert "worst order            standard error 1.28" in capsys.readouterr().out
    assert main(["plan", "--gear-ratio", "50", "--mounts", "2"]) == 1
    assert "at least 3 mounts" in capsys.readouterr().err
    assert main(["plan", "--gear-ratio", "100", "--reference", "off-null", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["worst_noise_factor"] == pytest.approx(
        1.70, abs=0.01
    )
    assert main(["plan", "--gear-ratio", "100", "--reference", "encoder"]) == 0
    assert "820 jittered positions" in capsys.readouterr().out
    assert main(["plan", "--orders", "1-x"]) == 1
    assert "'1-x'" in capsys.readouterr().err


@pytest.mark.parametrize(("positions", "mounts"), [(36, 2), (35, 2), (24, 3), (13, 4), (5, 7)])
@pytest.mark.parametrize("orders", [None, (1, 2)])
def test_mounts_without_a_gear_tell_what_one_of_them_takes_for_one(positions, mounts, orders):
    plan = plan_mounts(None, positions, mounts, orders=orders)
    # All orders of one class that lie below the limit of all positions, in the dense design.
    alike = [1, *(k * positions + s for k in range(1, mounts) for s in (-1, 1))]
    alike = sorted(m for m in alike if 2 * m < positions * mounts)
    offsets = np.array(plan.mount_offsets_deg)
    turns = (np.arange(positions) / positions + offsets[:, None] / 360.0).ravel()
    zeros = np.repeat(np.arange(mounts), positions)
    assert noise_factors(turns, alike, zeros).max() == pytest.approx(1.0, abs=1e-6)
    if orders is None:
        assert set(alike) <= set(plan.noise_factors)
        assert plan.worst_noise_factor == pytest.approx(1.0)


@pytest.mark.parametrize(("ratio", "hidden"), [(36.0, [36, 72]), (100.0, [])])
def test_orders_that_vanish_in_the_zero_of_each_mount_are_noted(
    ratio: float, hidden: list[int]
) -> None:
    """Multiples of the positions are the same at each of them."""
    notes = [note for note in plan_mounts(ratio, 36, 3).notes if "vanish" in note]
    assert len(notes) == bool(hidden)
    for order in hidden:
        assert re.search(rf"\b{order}\b", notes[0])
