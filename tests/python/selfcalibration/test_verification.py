"""Parts of a log against each other: what their difference is worth, and which part is which."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC, coast, encoder
from trueangle.selfcalibration import spindown, verification
from trueangle.selfcalibration.motion import MotionFit, MotionSearch
from trueangle.selfcalibration.splines import Knots, ordered_motion_sums
from trueangle.selfcalibration.steady import SteadyFit

SEED = 69_000
LINES = {1: (300.0, 0.3), 2: (150.0, 1.0)}
NOISE = 20.0


def log_of(seed: int, **lines: Callable[[np.ndarray], np.ndarray]) -> dict[str, np.ndarray]:
    """Two seconds from 10 to 3 turns a second; ``slow``: a line that only slow parts have."""
    t, theta = coast(10.0, 3.0, 2.0)
    t, theta = t[::4], theta[::4]
    speed = 10.0 * (3.0 / 10.0) ** (t / 2.0)
    reading = theta + encoder(theta, LINES)
    reading += NOISE * ARCSEC * np.random.default_rng(seed).normal(size=t.size)
    for name, line in lines.items():
        part = speed < math.sqrt(30.0)
        reading += (part if name == "slow" else ~part) * line(theta)
    return {"time_s": t, "indicated_rad": np.mod(reading, 2.0 * np.pi)}


def selfcal(log: dict[str, np.ndarray], **more) -> ta.SelfCalibration:
    return ta.selfcal(log, **{"orders": [1, 2], "loop": "open", "ripple": "none", **more})


def test_a_difference_is_worth_what_both_patterns_and_their_link_say(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """By the contrast (-1, 1) of the whole covariance, each part as loud as its noise."""
    print("seed", SEED)
    fits: list[SteadyFit] = []
    taken: list[tuple[np.ndarray, np.ndarray]] = []

    def fitted(*given, _fit=verification.fit_steady, **more):
        fits.append(_fit(*given, **more))
        return fits[-1]

    def chance(gap, covariance, _chance=verification.chance_of_difference):
        taken.append((gap, covariance))
        return _chance(gap, covariance)

    monkeypatch.setattr(verification, "fit_steady", fitted)
    monkeypatch.setattr(verification, "chance_of_difference", chance)
    loud = np.array([[4.0, 1.0], [9.0, 16.0]])
    monkeypatch.setattr(verification, "noise_spectrum_at", lambda *_: loud)
    assert set(selfcal(log_of(SEED)).held_out) == {"odd_even_turns", "speeds"}
    contrast = np.hstack([-np.eye(4), np.eye(4)])
    for fit, (gap, covariance) in zip(fits, taken, strict=True):
        np.testing.assert_allclose(gap, contrast @ fit.unknowns[:8], rtol=1e-9)
        scaled = contrast * [2.0, 2.0, 1.0, 1.0, 3.0, 3.0, 4.0, 4.0]
        whole = scaled @ fit.projected.covariance[:8, :8] @ scaled.T
        np.testing.assert_allclose(covariance, whole, rtol=1e-9, atol=1e-9 * whole.max())


@pytest.mark.parametrize(("part", "size"), [("slow", 400.0), ("fast", 0.0)])
def test_the_part_that_is_judged_is_the_slower_one(part: str, size: float) -> None:
    """Its own pattern counts before: 400 arcsec of order 5 where it has them."""
    print("seed", SEED + 1)
    line = {part: lambda theta: 400.0 * ARCSEC * np.sin(5.0 * theta)}
    test = selfcal(log_of(SEED + 1, **line), orders=[1, 2, 5]).held_out["speeds"]
    assert (test.fitted_on, test.judged_on) == ("the faster part", "the slower part")
    squares = 0.5 * (size**2 + sum(c**2 for c, _ in LINES.values()))
    assert test.rms_before == pytest.approx(math.sqrt(NOISE**2 + squares), rel=0.1)
    assert test.p < 1e-9


def test_ripple_is_told_with_its_probability_and_speed() -> None:
    """At order 3 only, moved by a torque."""
    print("seed", SEED + 2)
    t, theta = coast(10.0, 3.0, 3.0, ripple={3: 70.0}, steps=1)
    noise = NOISE * ARCSEC * np.random.default_rng(SEED + 2).normal(size=t.size)
    log = {"time_s": t, "indicated_rad": np.mod(theta + encoder(theta, LINES) + noise, 2 * np.pi)}
    found = selfcal(log, ripple="auto", orders=[1, 2, 3])
    told = {row["order"]: row["probability"] for row in found.beside["ripple"]}
    assert set(told) == {1, 2, 3}
    assert told[3] > 0.99
    assert max(told[1], told[2]) < 0.7
    # A speed that falls at a steady rate: the mean of its logarithm.
    assert found.beside["ripple_at_turns_per_s"] == pytest.approx(math.sqrt(30.0), rel=0.03)


def test_knots_of_the_motion_are_told_for_each_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    fits: list[SteadyFit] = []

    def fitted(*given, _fit=spindown.fit_steady, **more):
        fits.append(_fit(*given, **more))
        return fits[-1]

    monkeypatch.setattr(spindown, "fit_steady", fitted)
    found = selfcal(log_of(SEED + 3))
    (note,) = [n for n in found.notes if n.startswith("motion: ")]
    said = float(note.split(", ")[1].split()[0])
    # Turns pass faster at first: their usual speed is not quite their mean.
    assert said == pytest.approx(sum(fits[-1].motion.knots.intervals) / found.turns, rel=0.15)


MOTION_SEARCH_SEED = 61_310
INTERVALS, SPACING, PER_KNOT = 512, 0.25, 4
LENGTH = INTERVALS * SPACING


def search(read: np.ndarray, knots: Knots, trends: tuple[int, ...]) -> MotionSearch:
    """Of readings at even times over one stretch, without columns beside the motion."""
    time = np.linspace(0.0, knots.spacing * knots.intervals[0], read.size)
    index, place = knots.place(0, time)

    def none(part: slice, out: np.ndarray) -> None:
        pass

    sums = ordered_motion_sums(knots, index, place, read, np.ones(read.size), none, 0, None)
    return MotionSearch(sums, np.zeros(knots.size), (), trends)


def moved(rng: np.random.Generator, memory: float, noise: float) -> MotionSearch:
    """Readings of a motion whose acceleration forgets itself within so many seconds."""
    n = INTERVALS * PER_KNOT
    step = LENGTH / n
    acceleration, kept = np.zeros(n), math.exp(-step / memory)
    for i, push in enumerate(rng.normal(0.0, math.sqrt(1.0 - kept**2), n - 1)):
        acceleration[i + 1] = kept * acceleration[i] + push
    motion = np.cumsum(np.cumsum(acceleration)) * step**2
    read = motion + rng.normal(0.0, noise, n)
    return search(read, Knots((0.0,), (INTERVALS,), SPACING), (0,))


def best_of_all(looked: MotionSearch, memories: tuple[float, ...]) -> MotionFit:
    """Every grid, many stiffnesses, memories no shorter than the distance of knots."""
    fits = []
    level = 0
    while (grid := looked.grid(level)) is not None:
        knots = grid.sums.knots
        per_knot = looked.sums.weighty / sum(knots.intervals)
        fits += [
            looked.fit(level, per_knot * 10.0**power, memory)
            for memory in memories
            if memory >= knots.spacing
            for power in np.arange(-5.0, 7.1, 0.5)
        ]
        level += 1
    return max(fits, key=lambda fit: fit.evidence)


@pytest.mark.parametrize(("share", "noise"), [(1e3, 1e-3), (0.1, 1e-3), (0.05, 1e-2)])
def test_the_memory_of_the_motion_is_found_among_those_that_are_tried(
    share: float, noise: float
) -> None:
    """A whole log, a tenth or a hundredth of it: none has more evidence, on any grid."""
    print("seed", MOTION_SEARCH_SEED)
    looked = moved(np.random.default_rng(MOTION_SEARCH_SEED), share * LENGTH, noise)
    found = looked.best()
    memories = (LENGTH, 0.1 * LENGTH, 0.01 * LENGTH)
    every = best_of_all(looked, memories)
    assert found.memory in memories
    assert found.evidence > every.evidence - 2.0
    assert found.memory == pytest.approx(LENGTH if share > 1.0 else 0.1 * LENGTH)
    assert found.readings == INTERVALS * PER_KNOT
    # Beside its own grid and its neighbours nothing better is to be looked for.
    assert looked.best(near=found).evidence > found.evidence - 1.0


@pytest.mark.parametrize("trends", [0, 1, 2, 4, 5, 10])
def test_the_coarsest_grid_has_two_intervals_to_a_trend_and_four_more(trends: int) -> None:
    """Grids of 48, 24, 12 and 6 intervals: the last of them that is fine enough."""
    looked = search(np.linspace(0.0, 1.0, 200), Knots((0.0,), (48,), 0.5), (trends,))
    found = looked.best(shortest=math.inf)
    fit = [n for n in (48, 24, 12, 6) if n >= 2 * trends + 4]
    assert found.knots.intervals == (fit[-1],)
    assert found.stiffness == pytest.approx(200.0 / fit[-1] * 1e7)
