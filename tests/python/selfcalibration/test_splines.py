"""Splines over several stretches against dense matrices, and the sums over readings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.selfcalibration.motion import MotionSearch
from trueangle.selfcalibration.projected import harmonic_unknowns
from trueangle.selfcalibration.splines import (
    DriftPenalty,
    Knots,
    MotionSums,
    banded_product,
    coarser_bands,
    coarser_rows,
    finer_coefficients,
    ordered_motion_sums,
    smooth_trends,
    spline_basis,
    spline_values,
)

KNOTS = Knots((1.0, 30.0), (16, 8), 0.5)


def dense(bands: np.ndarray) -> np.ndarray:
    n = len(bands)
    out = np.zeros((n, n))
    for lag in range(bands.shape[1]):
        for i in range(n - lag):
            out[i, i + lag] = out[i + lag, i] = bands[i, lag]
    return out


def differences(knots: Knots, order: int) -> np.ndarray:
    """``D``, stretch by stretch."""
    blocks = [np.diff(np.eye(n + 3), order, axis=0) for n in knots.intervals]
    out = np.zeros((sum(len(b) for b in blocks), knots.size))
    row = 0
    for block, first in zip(blocks, knots.first, strict=False):
        out[row : row + len(block), first : first + block.shape[1]] = block
        row += len(block)
    return out


def design(knots: Knots, stretch: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Cubic B-splines by their definition: cardinal ones, shifted."""
    out = np.zeros((time.size, knots.size))
    for row, (g, t) in enumerate(zip(stretch, time, strict=True)):
        x = (t - knots.start[g]) / knots.spacing
        for k in range(knots.intervals[g] + 3):
            u = abs(x - (k - 1.0))
            value = (4.0 - 6.0 * u**2 + 3.0 * u**3) / 6.0 if u < 1.0 else max(2.0 - u, 0.0) ** 3 / 6
            out[row, knots.first[g] + k] = value
    return out


def some_times(seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    first, second = np.sort(rng.uniform(1.0, 9.0, 90)), np.sort(rng.uniform(30.0, 34.0, 50))
    return np.repeat([0, 1], [90, 50]), np.concatenate([[1.0], first[1:-1], [9.0], second])


def placed(knots: Knots, stretch: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    parts = [knots.place(g, time[stretch == g]) for g in (0, 1)]
    return tuple(np.concatenate(p) for p in zip(*parts, strict=True))  # type: ignore[return-value]


def test_the_basis_is_that_of_cubic_b_splines() -> None:
    stretch, time = some_times()
    index, place = placed(KNOTS, stretch, time)
    expected = design(KNOTS, stretch, time)
    for row, (i, weights) in enumerate(zip(index, spline_basis(place).T, strict=True)):
        np.testing.assert_allclose(expected[row, i : i + 4], weights, atol=1e-12)
    c = np.random.default_rng(2).normal(size=KNOTS.size)
    np.testing.assert_allclose(
        spline_values(c, index, spline_basis(place)), expected @ c, atol=1e-12
    )
    assert (KNOTS.size, KNOTS.first.tolist()) == (30, [0, 19, 30])
    # Straight lines are their own values at the coefficients' times.
    np.testing.assert_allclose(expected @ KNOTS.greville(), time, atol=1e-12)


def test_a_coarser_spline_is_a_finer_one() -> None:
    stretch, time = some_times()
    coarse = KNOTS.coarser
    assert (coarse.intervals, coarse.spacing, coarse.start) == ((8, 4), 1.0, KNOTS.start)
    parents = KNOTS.parents()
    c = np.random.default_rng(3).normal(size=coarse.size)
    fine, rough = design(KNOTS, stretch, time), design(coarse, stretch, time)
    refined = finer_coefficients(parents, KNOTS.size, c)
    np.testing.assert_allclose(fine @ refined, rough @ c, atol=1e-12)
    values = np.random.default_rng(4).normal(size=(time.size, 2))
    np.testing.assert_allclose(coarser_rows(parents, fine.T @ values), rough.T @ values, atol=1e-10)
    bands = np.stack([np.append(np.diagonal(fine.T @ fine, k), np.zeros(k)) for k in range(4)], 1)
    np.testing.assert_allclose(dense(bands), fine.T @ fine, atol=1e-12)
    np.testing.assert_allclose(
        dense(coarser_bands(parents, bands, coarse)), rough.T @ rough, atol=1e-10
    )
    x = np.random.default_rng(5).normal(size=KNOTS.size)
    np.testing.assert_allclose(banded_product(bands, x), fine.T @ fine @ x, atol=1e-10)


@pytest.mark.parametrize("memory", [0.3, 7.0])
def test_the_prior_is_that_of_its_differences(memory: float) -> None:
    drift = DriftPenalty(KNOTS)
    third, second = differences(KNOTS, 3), differences(KNOTS, 2)
    mu = (0.5 / memory) ** 2
    prior = third.T @ third + mu * second.T @ second
    np.testing.assert_allclose(dense(drift.bands(2.5, memory)), 2.5 * prior, atol=1e-12)
    c = np.random.default_rng(6).normal(size=KNOTS.size)
    assert drift.energy(c, memory) == pytest.approx(c @ prior @ c)
    np.testing.assert_allclose(drift.pull(c, memory), prior @ c, atol=1e-12)
    assert drift.rank == np.linalg.matrix_rank(prior) == 26
    # Of what the prior holds: with the lines of each stretch measured in place and speed.
    lines = np.zeros((KNOTS.size, 4))
    for g, (first, n) in enumerate(zip(KNOTS.first, KNOTS.intervals, strict=False)):
        part = slice(first, first + n + 3)
        t = (np.arange(n + 3) - 0.5 * (n + 2)) * KNOTS.spacing
        lines[part, 2 * g], lines[part, 2 * g + 1] = 1.0, t
    held = np.linalg.slogdet(2.5 * prior + lines @ np.linalg.inv(lines.T @ lines) @ lines.T)[1]
    # The measure of the lines: the volume that one second of place and speed spans.
    volume = np.linalg.slogdet(lines.T @ lines)[1]
    assert drift.log_determinant(2.5, memory) == pytest.approx(held - volume, abs=1e-8)


def test_trends_are_polynomials_that_no_straight_line_is() -> None:
    found = smooth_trends(KNOTS, (2, 1))
    assert found.shape == (30, 3)
    for column, (first, n, degree) in zip(
        found.T, ((0, 16, 2), (0, 16, 3), (19, 8, 2)), strict=True
    ):
        x = 2.0 / n * (np.arange(n + 3) - 0.5 * (n + 2))
        shape = {2: (3 * x**2 - 1) / 2, 3: (5 * x**3 - 3 * x) / 2}[degree]
        np.testing.assert_allclose(column[first : first + n + 3], shape, atol=1e-12)
        assert not np.delete(column, slice(first, first + n + 3)).any()
    assert smooth_trends(KNOTS, (0, 0)).shape == (30, 0)


def summed(valid: np.ndarray | None = None, repeat: int = 1) -> tuple[MotionSums, tuple]:
    stretch, time = some_times()
    stretch, time = np.repeat(stretch, repeat), np.repeat(time, repeat)
    rng = np.random.default_rng(7)
    target, weight = rng.normal(size=time.size), rng.uniform(0.9, 1.1, time.size)
    common = np.stack([np.cos(3.0 * time), np.sin(3.0 * time)])
    index, place = placed(KNOTS, stretch, time)

    def columns(part: slice, out: np.ndarray) -> None:
        out[:] = common[:, part]

    found = ordered_motion_sums(KNOTS, index, place, target, weight, columns, 2, valid)
    return found, (design(KNOTS, stretch, time) * weight[:, None], common.T, target)


@pytest.mark.parametrize("kept", [None, 0.7])
@pytest.mark.parametrize("repeat", [1, 80])
def test_sums_are_those_of_the_rows(kept: float | None, repeat: int) -> None:
    """Also of more rows than are looked at at once."""
    n = 140 * repeat
    valid = None if kept is None else np.random.default_rng(8).random(n) < kept
    found, (s, x, y) = summed(valid, repeat)
    if valid is not None:
        s, x, y = s[valid], x[valid], y[valid]
    np.testing.assert_allclose(dense(found.bands), s.T @ s, atol=1e-8)
    np.testing.assert_allclose(found.cross, s.T @ x, atol=1e-8)
    np.testing.assert_allclose(found.spline_right, s.T @ y, atol=1e-8)
    np.testing.assert_allclose(found.common, x.T @ x, atol=1e-8)
    np.testing.assert_allclose(found.common_right, x.T @ y, atol=1e-8)
    assert found.squares == pytest.approx(y @ y)
    assert found.weighty == len(y)
    assert (found.bare.cross.shape, found.bare.common.shape) == ((30, 0), (0, 0))
    assert found.bare.common_right.shape == (0,)
    assert found.bare.squares == found.squares


@pytest.mark.parametrize("level", [0, 1])
@pytest.mark.parametrize("trends", [(0, 0), (2, 1)])
def test_a_fit_of_motion_is_penalised_least_squares(level: int, trends: tuple) -> None:
    """Motion, columns, covariance and evidence against one dense system."""
    sums, (s, x, y) = summed()
    columns = harmonic_unknowns("the encoder", [3.0])
    motion = np.random.default_rng(9).normal(size=KNOTS.size)
    found = MotionSearch(sums, motion, columns, trends).fit(level, 4.0, 2.0)
    knots = KNOTS if level == 0 else KNOTS.coarser
    down = np.eye(KNOTS.size)
    if level:
        down = np.stack(
            [finer_coefficients(KNOTS.parents(), KNOTS.size, e) for e in np.eye(knots.size)], axis=1
        )
    trend = smooth_trends(knots, trends)
    third, second = differences(knots, 3), differences(knots, 2)
    prior = third.T @ third + (knots.spacing / 2.0) ** 2 * second.T @ second
    rows = np.hstack([s @ down, x, s @ down @ trend])
    penalty = np.zeros((rows.shape[1],) * 2)
    penalty[: knots.size, : knots.size] = 4.0 * prior
    # What is read is the motion so far and what it left; only the motion's part is a spline's.
    read = y + s @ motion
    normal = rows.T @ rows + penalty
    solution = np.linalg.solve(normal, rows.T @ read)
    m = knots.size
    np.testing.assert_allclose(found.unknowns, solution[m : m + 2], atol=1e-8)
    fine = down @ (solution[:m] + trend @ solution[m + 2 :])
    np.testing.assert_allclose(found.coefficients, fine, atol=1e-7)
    left = read - rows @ solution
    energy = 4.0 * solution[:m] @ prior @ solution[:m]
    fixed = 4 + 2 + trend.shape[1]
    freedom = len(y) - fixed
    variance = (left @ left + energy) / freedom
    assert found.projected.variance == pytest.approx(variance, rel=1e-8)
    assert found.projected.freedom == freedom
    inverse = np.linalg.inv(normal)[m : m + 2, m : m + 2]
    np.testing.assert_allclose(
        found.projected.covariance, variance * inverse, rtol=1e-6, atol=1e-12
    )
    assert found.evidence == pytest.approx(
        -0.5
        * (
            freedom * math.log(variance)
            + np.linalg.slogdet(normal)[1]
            - DriftPenalty(knots).log_determinant(4.0, 2.0)
        ),
        abs=1e-6,
    )
    assert found.roughness == pytest.approx(variance / (4.0 * knots.spacing**5))
    assert (found.level, found.stiffness, found.memory, found.knots) == (level, 4.0, 2.0, knots)


def test_grids_end_where_they_would_be_too_coarse() -> None:
    sums, _ = summed()
    search = MotionSearch(sums.bare, np.zeros(KNOTS.size), (), (0, 0))
    assert [search.grid(k) is None for k in range(3)] == [False, False, True]
    assert search.memory == 8.0
    best = search.best()
    for level in (0, 1):
        for power in np.linspace(-5.0, 7.0, 25):
            other = search.fit(level, 10.0**power * sums.weighty / 24.0, 8.0)
            allowed = 1.0 if level != best.level else 0.1
            assert other.evidence < best.evidence + allowed
    # None closer than asked: the stiffest motion of the coarsest grid.
    stiff = search.best(shortest=1.5)
    assert stiff.level == 1
    assert stiff.stiffness == pytest.approx(140.0 / 12.0 * 1e7)
    assert search.best(shortest=0.9).level == 1


def test_motion_takes_a_tenth_of_a_wave_where_it_is_said_to_end() -> None:
    """By fitting that wave; and never below what a log shows, nor beyond what knots follow."""
    knots, t = Knots((0.0,), (160,), 0.5), np.linspace(0.0, 80.0, 1601)
    index, place = knots.place(0, t)

    def search(y: np.ndarray) -> MotionSearch:
        def none(part: slice, out: np.ndarray) -> None:
            pass

        sums = ordered_motion_sums(knots, index, place, y, np.ones(t.size), none, 0, None)
        return MotionSearch(sums, np.zeros(knots.size), (), (0,))

    for stiffness in (3e4, 3e3):
        fastest = search(t).fit(0, stiffness, 1e6).fastest
        wave = np.cos(2.0 * math.pi * fastest * (t - 40.0))
        spline = search(wave).fit(0, stiffness, 1e6).coefficients
        inner = np.abs(t - 40.0) < 2.0 / fastest
        motion = spline_values(spline, index, spline_basis(place))
        taken = motion[inner] @ wave[inner] / (wave[inner] @ wave[inner])
        assert taken == pytest.approx(1.0 / 11.0, rel=0.05)
    assert search(t).fit(0, 1e9, 1e6).fastest == pytest.approx(4.0 / 80.0)
    assert search(t).fit(0, 1e-3, 1e6).fastest == 1.0
