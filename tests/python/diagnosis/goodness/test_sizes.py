"""What each test tells of the structure that fires it: how large, where, and against what noise."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from trueangle.diagnosis.goodness import goodness_of_fit
from trueangle.diagnosis.goodness.events import CONSTANTS, reversal_test, start_test, steps_test
from trueangle.diagnosis.goodness.noise import estimate_noise
from trueangle.diagnosis.goodness.periodogram import order_test, time_test
from trueangle.diagnosis.goodness.place import ModulatedSums, place_tests
from trueangle.diagnosis.goodness.zeros import run_test

from .readings import leftover
from .test_events import readings

#: Of a structure twice the noise in thousands of readings, its rms is told to a few percent; what
#: hides in lines, levels and means of the fit takes a few more.
NEAR = 0.08


def own(left, values):
    """An angle of each run's own."""
    return values[left.run]


#: Deciding tests, what is hidden (of rms 1), and what is told of it in words.
HIDDEN = {
    "place": (
        lambda m, rng: np.sqrt(2.0) * np.sin(12.0 * m.theta + 1.0),
        lambda left: next(e for e in place_tests(left) if e.test == "place"),
        (12.0, 2.0 * np.sqrt(2.0)),
    ),
    "place x direction": (
        lambda m, rng: np.sqrt(2.0) * m.direction * np.cos(7.0 * m.theta),
        lambda left: next(e for e in place_tests(left) if e.test == "place x direction"),
        (7.0, 2.0 * np.sqrt(2.0)),
    ),
    "place x direction x temperature": (
        lambda m, rng: m.direction * np.sign(m.temperature - 27.5),
        lambda left: next(
            e for e in place_tests(left) if e.test == "place x direction x temperature"
        ),
        (2.0,),
    ),
    "time periodogram": (
        lambda m, rng: np.sqrt(2.0) * np.sin(14.451 * m.clock + own(m, 6.0 * rng.random(40))),
        time_test,
        (2.3, 2.0 * np.sqrt(2.0)),
    ),
    "place within runs": (
        lambda m, rng: np.sqrt(2.0) * np.sin(17.4 * m.theta + own(m, 6.28 * rng.random(40))),
        lambda left: order_test(left, 110),
        (17.4, 2.0 * np.sqrt(2.0)),
    ),
    "zeros of the runs": (
        lambda m, rng: own(m, np.resize([1.0, -1.0], 40)),
        lambda left: run_test(left, estimate_noise(left)),
        (2.0 * np.sqrt(24.0 / 23.0),),
    ),
}  # fmt: skip


def numbers(says: str) -> list[float]:
    """Numbers of a sentence in their order."""
    return [float(x) for x in re.findall(r"(?<![\w.])\d+\.?\d*(?:e-?\d+)?", says)]


@pytest.mark.parametrize("test", HIDDEN)
def test_a_structure_is_told_with_its_size_and_place(test: str) -> None:
    structure, asked, told = HIDDEN[test]
    left = leftover("rich", "gauss", 71, structure, 2.0)
    found = asked(left)
    assert found.test == test
    assert found.p < 1e-6
    spread = np.sqrt(24.0 / 23.0) if test == "zeros of the runs" else 1.0
    assert found.rms == pytest.approx(2.0 * spread, rel=NEAR)
    assert numbers(found.says) == pytest.approx(list(told), rel=NEAR)
    if len(told) == 2 and "place x" not in test and test != "place":
        assert found.at == pytest.approx(told[0], rel=0.01)
    assert str(told[0]) == "2.3" or "Hz" not in found.says


def test_what_follows_the_direction_has_the_rms_of_the_readings_that_move() -> None:
    """A joint that rests in three readings of four; its play of 2 is told as that."""
    left = leftover("rich", "gauss", 78)
    direction = np.where(np.arange(len(left)) % 4, 0.0, left.direction)
    left = replace(left, residual=left.residual + 2.0 * direction, direction=direction)
    found = next(e for e in place_tests(left) if e.test == "place x direction")
    assert "at every place" in found.says
    assert numbers(found.says) == pytest.approx([2.0], rel=NEAR)
    assert found.rms == pytest.approx(1.0, rel=NEAR)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_sizes_are_those_of_the_errors_and_places_those_of_the_axis(way: float) -> None:
    """Errors in other units, of the other sign; a clock twice as fast; the joint mirrored."""
    structure = HIDDEN["time periodogram"][0]
    left = leftover("split", "gauss", 72, structure, 1.0)
    other = replace(
        left,
        residual=-1000.0 * left.residual,
        clock=2.0 * left.clock,
        theta=way * left.theta,
        direction=way * left.direction,
        kept={},
    )
    pairs = [goodness_of_fit(each, 64.0, sigma) for each, sigma in ((left, 1.2), (other, 1200.0))]
    told = [{item.test: item for item in fit.evidence} for fit in pairs]
    assert told[0].keys() == told[1].keys()
    for name, item in told[0].items():
        again = told[1][name]
        # Cells of a transform begin at the other end of a mirrored way.
        near = 0.05 if name == "place within runs" and way < 0.0 else 1e-6
        assert again.p == pytest.approx(item.p, rel=near, abs=max(near, 1e-12)), name
        assert again.rms == pytest.approx(1000.0 * item.rms, rel=near), name
        if item.at is not None:
            per = 0.5 if name == "time periodogram" else 1.0
            assert again.at == pytest.approx(per * item.at, rel=1e-9), name
    assert pairs[1].rms == pytest.approx(1000.0 * pairs[0].rms)
    assert pairs[1].share == pytest.approx(pairs[0].share)
    assert pairs[1].noise.sigma == pytest.approx(1000.0 * pairs[0].noise.sigma)


def test_lines_over_readings_are_no_hertz() -> None:
    left = replace(leftover("rich", "gauss", 71, HIDDEN["time periodogram"][0], 2.0), timed=False)
    assert "cycles per reading" in time_test(left).says


def test_steps_are_told_by_their_number_and_half_of_their_height() -> None:
    left = readings("gauss", 9_100)
    run = np.arange(len(left)) - 240 * left.run
    # Two levels: one step a run in nine of the ten, at a place of its own.
    levels = np.where((run > 60 + 12 * left.run) & (left.run < 9), 3.0, -3.0)
    left.residual[:] = 0.3 * left.residual + levels
    found = steps_test(left)
    count, size = numbers(found.says)
    # A block that a step cuts may count as another one.
    assert abs(count - 9) <= 1
    assert size == pytest.approx(6.0, rel=NEAR)
    assert found.rms == pytest.approx(3.0, rel=NEAR)


@pytest.mark.parametrize("constant", CONSTANTS)
@pytest.mark.parametrize("asked", [reversal_test, start_test])
def test_what_relaxes_is_told_by_its_rms_and_time(asked, constant: float) -> None:
    """In shares of the time between reversals (4 s) or of a run (24 s)."""
    left = readings("gauss", 9_200)
    events = np.diff(left.run, prepend=-1) != 0
    if asked is reversal_test:
        events |= np.diff(left.direction, prepend=0.0) != 0.0
    first = np.flatnonzero(events)
    stretch = np.cumsum(events) - 1
    tau = constant * (4.0 if asked is reversal_test else 24.0)
    decay = np.exp(-(left.clock - left.clock[first][stretch]) / tau)
    decay = decay - (np.bincount(stretch, decay) / np.bincount(stretch))[stretch]
    if asked is reversal_test:
        decay *= left.direction
        # What follows the start of a run is no reversal.
        decay[np.isin(stretch, stretch[np.flatnonzero(np.diff(left.run, prepend=-1))])] = 0.0
    # Of the size of the noise: larger, what tells runs apart is not the noise.
    left.residual[:] += decay / np.std(decay)
    found = asked(left)
    # One of three time constants, neighbours of which are half alike.
    (told,) = numbers(found.says)
    span = tau / constant
    assert min(abs(told / (c * span) - 1.0) for c in CONSTANTS) < 0.06
    assert 0.3 < told / tau < 4.5
    assert found.rms == pytest.approx(1.0, rel=0.25)


def test_the_chance_of_modulated_sums_is_that_of_student() -> None:
    rng = np.random.default_rng(3)
    for n in (3, 8, 24):
        sums = rng.normal(0.5, 1.0, n)
        wanted = ttest_1samp(sums, 0.0).pvalue
        assert ModulatedSums(sums, 1.0).chance() == pytest.approx(wanted, rel=1e-9)
        signs = rng.choice([-1.0, 1.0], n)
        wanted = ttest_1samp(signs * sums, 0.0).pvalue
        assert ModulatedSums(sums, -1.0).chance(signs) == pytest.approx(wanted, rel=1e-9)
    assert ModulatedSums(sums, 0.0).chance() == 1.0


def test_a_run_of_rounding_alone_tells_nothing() -> None:
    """Exact zeros and 1e-14 in one of ten runs: the same answer of place."""
    rng = np.random.default_rng(404)
    left = leftover("grid", "gauss", 404)
    quiet = left.run == 3
    found = []
    for dust in (0.0, 1e-14 * rng.normal(size=len(left)), 1e-14 * np.sin(5.0 * left.theta)):
        residual = np.where(quiet, dust, left.residual)
        found.append([e.p for e in place_tests(replace(left, residual=residual, kept={}))])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-4)
    np.testing.assert_allclose(found[2], found[0], rtol=1e-4)
