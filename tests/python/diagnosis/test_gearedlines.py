"""Lines of geared shafts at a ratio: power, what is left, and how far a ratio is out of step."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.gearedlines import GearedLines
from trueangle.diagnosis.gearratio import _turns_until_back, near_ratio, signals_at_ratio
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

Array = np.ndarray

LINES = (Harmonic("motor", 1, 6.0, 20.0), Harmonic("motor", 2, 17.0, 140.0))
SIM = Simulation(Joint(10.0, "none", "output"), LINES)


def lines_at(theta: Array, ratio: float, sizes: tuple[float, ...], phase: float) -> Array:
    """Parts of the believed lines, a phase later."""
    return np.asarray(
        sum(
            size * line.amplitude_arcsec * np.sin(line.order * (ratio * theta + phase) + line.order)
            for line, size in zip(LINES, sizes, strict=True)
        )
    )


def geared_of(
    thetas: list[Array], errors: list[Array], ratio: float = 10.0, unit: float = 1.0
) -> GearedLines:
    ends = np.cumsum([0, *map(len, thetas)]).tolist()
    lines = tuple(replace(x, amplitude_arcsec=unit * x.amplitude_arcsec) for x in LINES)
    sim = replace(SIM, joint=replace(SIM.joint, gear_ratio=ratio), harmonics=lines)
    y, theta = unit * np.concatenate(errors), np.concatenate(thetas)
    return GearedLines(sim, lines, y, theta, tuple(itertools.pairwise(ends)))


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("sizes", [(0.5, 0.5), (1.0, 0.3), (2.0, 1.0), (0.0, 0.0)])
def test_shares_are_those_of_the_power_of_the_lines(
    sizes: tuple[float, float], unit: float
) -> None:
    """Over whole turns at even places sums are the lines'; a phase of each run's own, any unit."""
    thetas = [2.0 * np.pi * np.arange(n) / n for n in (100, 250)]
    errors = [lines_at(t, 10.0, sizes, p) for t, p in zip(thetas, (0.4, 2.9), strict=True)]
    geared = geared_of(thetas, errors, unit=unit)
    parts = np.minimum(np.square(sizes), 1.0)
    power = np.array([6.0, 17.0]) ** 2
    wanted = float(parts @ power / power.sum())
    np.testing.assert_allclose(geared.shares(10.0), parts, atol=1e-12)
    assert geared.share(10.0) == pytest.approx(wanted, abs=1e-12)
    assert geared.together(10.0) == pytest.approx(wanted, abs=1e-12)
    # At another ratio of whole cycles there is nothing of them.
    assert geared.share(13.0) == pytest.approx(0.0, abs=1e-12)
    told = geared.at(10.0, common=False)
    assert (told.found, told.left) == pytest.approx((wanted, wanted), abs=1e-12)
    other = geared.at(13.0, common=False)
    assert (other.gear_ratio, other.believed) == (13.0, 10.0)
    assert (other.found, other.left) == pytest.approx((0.0, wanted), abs=1e-12)
    assert other.simulation.joint.gear_ratio == 13.0


def test_the_step_resolves_the_travel_of_a_run() -> None:
    """A quarter of the ratio that takes the fastest line one cycle more or less over it."""
    thetas = [np.linspace(0.5, 0.5 + 2.0 * np.pi * n, 50) for n in (1.0, 3.0, 2.0)]
    geared = geared_of(thetas, [np.zeros(50)] * 3)
    assert geared.turns == pytest.approx(2.0)
    assert geared.step == pytest.approx(0.25 / (2.0 * 2.0))
    # Of a travel that is hardly one, that of 18 degrees.
    for travel, turns in ((0.06, 0.06), (0.04, 0.05)):
        short = geared_of([2.0 * np.pi * np.linspace(0.0, travel, 50)], [np.zeros(50)])
        assert short.turns == pytest.approx(turns)


def dense(geared: GearedLines, common: bool, ratio: float, others: int = 0) -> Array:
    """Zeros of the runs and lines, one phase for all of them or for each."""
    runs = np.repeat(np.arange(len(geared.bounds)), [b - a for a, b in geared.bounds])
    own = (runs[:, None] == np.arange(len(geared.bounds))).astype(float)
    waves = [f(k * ratio * geared.theta) for k in (1, 2) for f in (np.cos, np.sin)]
    groups = [np.ones(len(runs))] if common else own.T
    return np.column_stack([own, *(g * w for g in groups for w in waves)])


def two_runs(ratio: float, phase: float, seed: int, sigma: float = 0.5) -> GearedLines:
    return runs_of(ratio, (0.0, phase), seed, sigma)


def runs_of(ratio: float, phases: tuple[float, ...], seed: int, sigma: float = 0.5) -> GearedLines:
    """Free angles, each run with a zero and a phase of its own."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    thetas = [np.sort(rng.uniform(0.0, 9.0, 150 + 70 * k)) for k in range(len(phases))]
    errors = [
        lines_at(t, ratio, (1.0, 1.0), p) + 5.0 * k + sigma * rng.standard_normal(len(t))
        for k, (t, p) in enumerate(zip(thetas, phases, strict=True))
    ]
    return geared_of(thetas, errors)


@pytest.mark.parametrize("common", [False, True])
def test_what_is_left_is_that_of_one_dense_fit(common: bool) -> None:
    geared = two_runs(10.0, 0.3, 61)
    design = dense(geared, common, 10.02)
    rest = geared.y - design @ np.linalg.lstsq(design, geared.y, rcond=None)[0]
    assert geared.left(10.02, common) == pytest.approx(rest @ rest, rel=1e-9)


@pytest.mark.parametrize("common", [False, True])
@pytest.mark.parametrize("wrong", [2e-4, -3e-4])
def test_a_ratio_is_out_of_step_by_its_departure(wrong: float, common: bool) -> None:
    """To first order, and over the standard error of a dense fit with a free ratio."""
    still = two_runs(10.0 + wrong, 0.0, 62, sigma=0.0)
    departure, _ = still._departure(10.0, common)
    assert departure == pytest.approx(wrong, rel=0.02)
    noisy = two_runs(10.0 + wrong, 0.0, 62)
    departure, std = noisy._departure(10.0, common)
    design = dense(noisy, common, 10.0)
    fit = np.linalg.lstsq(design, noisy.y, rcond=None)[0]
    step = 1e-5
    moved = (dense(noisy, common, 10.0 + step) - dense(noisy, common, 10.0 - step)) @ fit
    full = np.column_stack([design, moved / (2.0 * step)])
    rest = noisy.y - design @ fit
    variance = float(rest @ rest) / (len(noisy.y) - design.shape[1])
    wanted = np.sqrt(variance * np.linalg.inv(full.T @ full)[-1, -1])
    assert std == pytest.approx(wanted, rel=1e-5)
    assert abs(departure - wrong) < 4.0 * std
    assert noisy.out_of_step(common) == pytest.approx(departure / std)
    assert noisy.at(10.0, common).std == std


def test_runs_keep_their_phase_up_to_what_noise_makes() -> None:
    """Four standard deviations of a chi-square of as many phases and sizes as are spared."""
    beyond = []
    for phase in np.linspace(0.0, 0.05, 101):
        geared = two_runs(10.0, float(phase), 63)
        one, each = geared.left(10.0, True), geared.left(10.0, False)
        excess = len(geared.y) * (one / each - 1.0)
        deviations = (excess - 4.0) / np.sqrt(2.0 * 4.0)
        beyond.append(deviations)
        assert geared.keeps_phase(10.0) == (deviations < 4.0)
    # From both sides, and between this limit and the next whole one.
    assert min(beyond) < 3.5 < 4.0 < sorted(b for b in beyond if b > 4.0)[0] < 4.6


@pytest.mark.parametrize("turn", [0, 1, 2, 3])
@pytest.mark.parametrize("stay", [False, True])
def test_a_run_starts_in_the_turn_in_which_its_lines_have_their_phase(
    turn: int, stay: bool
) -> None:
    """Of a ratio of 10 1/4 they come back after four turns; of a whole one after each."""
    sim = Simulation(
        Joint(10.0 if stay else 10.25, "none", "output"),
        (Harmonic("motor", 1, 9.0, 40.0), Harmonic("output", 1, 30.0, 10.0)),
        sigma_arcsec=1.0,
        runs=(RunDesign(samples=120), RunDesign(samples=90, start_deg=30.0)),
    )
    signals = join_runs(simulate(sim, 5))
    shift = 2.0 * np.pi * turn * (signals.run == 1)
    noise = np.random.default_rng(64).standard_normal(len(signals))
    error = sim.pattern.value(signals.theta + shift) + noise + 400.0 * signals.run
    moved = signals_at_ratio(sim, signals, error)
    wanted = signals.theta if stay else signals.theta + shift
    np.testing.assert_allclose(moved.theta, wanted, atol=1e-9)
    # What fits another turn no better than noise does leaves them where they are.
    still = signals_at_ratio(sim, signals, sim.pattern.value(signals.theta) * [0.0] + noise)
    np.testing.assert_array_equal(still.theta, signals.theta)


@pytest.mark.parametrize(
    ("ratio", "turns"),
    [(10.0, 1), (10.5, 2), (31.0 / 3.0, 3), (9.75, 4), (10.4, 5), (10.3, 10),
     (10.0 + 1.0 / 7.0, 7), (10.0 - 1.0 / 9.0, 9), (10.001, 64)],
)  # fmt: skip
def test_lines_come_back_after_the_turns_of_their_ratio(ratio: float, turns: int) -> None:
    assert _turns_until_back(ratio) == turns


#: Phases of runs that no ratio near ten has in common.
UNLIKE = (0.0, 2.0, 4.5, 1.0)


@pytest.mark.parametrize("phases", [(0.0,) * 4, UNLIKE])
@pytest.mark.parametrize("deviations", [0.0, 2.0, 40.0, -40.0])
def test_a_near_ratio_is_tried_where_lines_fall_out_of_step(
    deviations: float, phases: tuple[float, ...]
) -> None:
    """By six standard errors; with one phase of all runs where that explains them."""
    common = phases is not UNLIKE
    std = runs_of(10.0, phases, 65)._departure(10.0, common)[1]
    ratio = 10.0 + deviations * std
    geared = runs_of(ratio, phases, 65)
    found = near_ratio(geared)
    assert (found is None) == (abs(deviations) < 6.0)
    if found is not None:
        assert abs(found.gear_ratio - ratio) < 4.0 * found.std
        assert found.std == pytest.approx(std, rel=0.1)
        assert found.std == geared.at(found.gear_ratio, common).std
        assert found.simulation.joint.gear_ratio == found.gear_ratio
