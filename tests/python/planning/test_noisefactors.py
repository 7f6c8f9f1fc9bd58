"""Noise factors against the covariance of a dense fit; tolerances, rounds, times of runs."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle.planning import plan_arc, plan_encoder, plan_mounts, plan_tilts
from trueangle.planning.doptimal import OrthonormalColumns
from trueangle.planning.nextruns import run_seconds, run_steps
from trueangle.planning.noisefactors import (
    TOLERATED_FACTOR,
    facet_noise_factor,
    mount_noise_factors,
    noise_factors,
)
from trueangle.simulation import RunDesign

SEED = 63_000


def covariance(x: np.ndarray, orders: list[float], zeros: np.ndarray) -> np.ndarray:
    """Of cosine and sine of each order beside the zeros, for noise of variance 1."""
    columns = [(zeros == g).astype(float) for g in np.unique(zeros)]
    columns += [f(2.0 * np.pi * k * x) for k in orders for f in (np.cos, np.sin)]
    _, s, vt = np.linalg.svd(np.column_stack(columns), full_matrices=False)
    return (vt.T / s**2 @ vt)[-2 * len(orders) :, -2 * len(orders) :]


@pytest.mark.parametrize("seed", range(4))
def test_a_factor_is_the_worst_phase_against_the_order_alone(seed: int) -> None:
    """Readings over a part of a turn, in runs of unlike size with a zero each."""
    rng = np.random.default_rng([SEED, seed])
    zeros = np.repeat([0, 1, 2], [20, 35, 50])
    x, orders = rng.uniform(0.0, 0.8, 105), [1.0, 2.5, 7.0]
    found = noise_factors(x, orders, zeros)
    known = covariance(x, orders, zeros)
    phases = np.linspace(0.0, np.pi, 2001)
    turned = np.stack([np.cos(phases), np.sin(phases)])
    for i, factor in enumerate(found):
        block = known[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
        worst = np.einsum("ip,ij,jp->p", turned, block, turned).max()
        # Alone each coefficient has a variance of 2 / n.
        assert factor == pytest.approx(math.sqrt(worst / (2.0 / 105.0)), rel=1e-5)


@pytest.mark.parametrize("positions", [9, 12])
def test_mounts_of_a_grid_are_the_dense_fit_of_all_their_readings(positions: int) -> None:
    """Orders beyond half the positions, that at half of them, and zeros of mounts."""
    offsets = [0.0, 7.0, 17.3, 24.1]
    orders = [1, 2, positions + 1, 4] if positions == 9 else [1, 2, 6, positions - 1]
    x = np.concatenate([np.arange(positions) / positions + o / 360.0 for o in offsets])
    dense = noise_factors(x, orders, np.repeat(np.arange(4), positions))
    assert mount_noise_factors(positions, offsets, orders) == pytest.approx(dense, rel=1e-6)


def test_facets_that_are_fitted_cost_what_the_dense_fit_says() -> None:
    """Every facet an unknown, every mount a zero; against one mount with a perfect artefact."""
    n, shifts = 9, [0, 2, 5]
    place = np.tile(np.arange(n), 3)
    mount = np.repeat(np.arange(3), n)
    facets = (place[:, None] + np.repeat(shifts, n)[:, None]) % n == np.arange(n)
    worst = 0.0
    columns = [f(2.0 * np.pi * k * place / n) for k in range(1, 5) for f in (np.cos, np.sin)]
    design = np.column_stack([*columns, facets, mount[:, None] == np.arange(3)]).astype(float)
    known = np.linalg.pinv(design.T @ design)
    for k in range(4):
        worst = max(worst, np.linalg.eigvalsh(known[2 * k : 2 * k + 2, 2 * k : 2 * k + 2])[-1])
    assert float(facet_noise_factor(n, shifts)) == pytest.approx(math.sqrt(worst / (2.0 / n)))


def test_every_offset_may_be_off_by_the_tolerance_and_no_more() -> None:
    plan = plan_mounts(100, 36, 3)
    seen = [m for m, f in plan.noise_factors.items() if math.isfinite(f)]

    def worst(error: float) -> float:
        signs = itertools.product((-1.0, 0.0, 1.0), repeat=2)
        trials = [np.array(plan.mount_offsets_deg) + error * np.array([0.0, *s]) for s in signs]
        return max(float(mount_noise_factors(36, t, seen).max()) for t in trials)

    assert plan.tolerance_deg > 0.0
    assert worst(plan.tolerance_deg) <= TOLERATED_FACTOR + 1e-9
    assert worst(plan.tolerance_deg + 0.0101) > TOLERATED_FACTOR
    assert plan.worst_noise_factor == pytest.approx(worst(0.0))


@pytest.mark.parametrize("make", [plan_mounts, plan_tilts, plan_encoder])
def test_readings_reach_the_error_wanted_in_the_fewest_whole_rounds(make) -> None:
    plan = make(100, noise=5.0, standard_error=0.42)
    one_round = plan.positions * (1 if make is plan_encoder else len(plan.mount_offsets_deg))
    assert plan.readings % one_round == 0
    reached = plan.worst_noise_factor * 5.0 * math.sqrt(2.0 / plan.readings)
    assert reached <= 0.42
    fewer = plan.readings - one_round
    assert fewer == 0 or plan.worst_noise_factor * 5.0 * math.sqrt(2.0 / fewer) > 0.42


@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("runs", [1, 3])
def test_an_arcs_efficiencies_and_factors_are_those_of_its_places(both: bool, runs: int) -> None:
    plan = plan_arc(
        -100.0, 130.0, [1, 2, 3], readings=84, runs=runs, both_directions=both, noise=2.0
    )
    assert plan.readings == runs * sum(plan.counts) >= 84
    turns = np.repeat(plan.places_deg, plan.counts) / 360.0
    even = np.linspace(-100.0, 130.0, turns.size // (2 if both else 1)) / 360.0
    columns = OrthonormalColumns((1.0, 2.0, 3.0), -100.0 / 360.0, 130.0 / 360.0)

    def information(x: np.ndarray) -> float:
        rows = columns.at(x)
        return np.linalg.slogdet(rows.T @ rows / x.size)[1] / 7.0

    for x, told in ((turns, plan.noise_factors), (even, plan.even_noise_factors)):
        assert [*told.values()] == pytest.approx(noise_factors(x, [1, 2, 3]).tolist(), rel=1e-6)
    gained = math.exp(information(turns) - information(even))
    told = plan.d_efficiency / plan.efficiency_of_even_spacing
    assert told == pytest.approx(gained, rel=1e-6)
    assert 0.97 < plan.d_efficiency <= 1.0
    # Twice the standard deviation at the worst place; runs have zeros of their own, whose mean
    # is as well known as one of all readings.
    x = np.linspace(-100.0, 130.0, 2001) / 360.0
    rows = columns.at(x)
    here = columns.at(turns)
    spread = np.einsum("ij,jk,ik->i", rows, np.linalg.inv(here.T @ here), rows).max()
    wanted = 2.0 * 2.0 * math.sqrt(spread / runs)
    assert plan.uncertainty_arcsec == pytest.approx(wanted, rel=2e-3)


@pytest.mark.parametrize(
    ("design", "seconds"),
    [
        (RunDesign(speed_deg_s=30.0, turns=2.0, samples=100), 24.0),
        (RunDesign(speed_deg_s=0.0, turns=2.0, samples=100), 100.0),
        (RunDesign(speed_deg_s=30.0, speed_end_deg_s=30.0, turns=2.0, samples=100), 24.0),
    ],
)
def test_a_run_takes_its_travel_over_its_speed(design: RunDesign, seconds: float) -> None:
    assert run_seconds(design) == pytest.approx(seconds)


@pytest.mark.parametrize("end", [5.0, 25.0, 60.0])
def test_a_coasting_run_takes_the_integral_over_its_speeds(end: float) -> None:
    """Friction in proportion to the speed: it falls in a straight line over the travel."""
    design = RunDesign(speed_deg_s=40.0, speed_end_deg_s=end, turns=3.0, samples=100)
    speeds = np.linspace(40.0, end, 20_001)
    middles = 0.5 * (speeds[1:] + speeds[:-1])
    wanted = (3.0 * 360.0 / 20_000 / middles).sum()
    assert run_seconds(design) == pytest.approx(wanted, rel=1e-6)


def test_the_steps_of_a_run_lead_where_it_goes() -> None:
    design = RunDesign(
        speed_deg_s=20.0, turns=1.5, samples=90, start_deg=30.0, direction=-1,
        reversals=(0.25, 0.75),
    )  # fmt: skip
    first = next(run_steps(design))
    # 540 degrees in all: a quarter down, a half up, a quarter down again.
    assert first.startswith("move 30 to -105 to 165 to 30 deg at 20 deg/s (27 s)")
