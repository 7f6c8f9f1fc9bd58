"""Lines of a worm over a short arc that was passed once, beside drift and correlated noise."""

import warnings

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import NoModelError, OutsideSpanWarning
from trueangle.fitting.orders.candidates import choose_candidates

#: Runs of which the correction must not make the next one, or its own rest, worse.
SEEDS = range(62_100, 62_124)

#: Of 24 runs so many may be refused or miss the line, and come out worse by noise.
MISSED, WORSE = 3, 1


def drift(form, u, rng):
    walk = np.cumsum(rng.normal(size=u.size)) / np.sqrt(u.size)
    return {"arc": u**1.7, "settles": np.tanh(2.5 * u), "slow wave": np.cos(2.7 * u), "walk": walk}[
        form
    ]


def guided(rng, cycles, line, arc, count, form, size):
    """One pass of a mount: a worm's line, a drift in time, noise that lasts."""
    theta = np.linspace(0.0, arc, count)
    noise = rng.normal(size=count)
    memory = rng.choice([0.0, 0.8])
    for i in range(1, count):
        noise[i] = memory * noise[i - 1] + np.sqrt(1.0 - memory**2) * noise[i]
    amplitude, phase = line
    error = amplitude * np.sin(np.radians(cycles * theta) + phase)
    error += size * drift(form, theta / arc, rng) + 1.5 * noise
    return ta.CalibrationRun(theta, theta + error / 3600.0, period=360.0)


def part(run, rows):
    return ta.CalibrationRun(run.reference[rows], run.indicated[rows], period=360.0)


@pytest.mark.parametrize("cycles", [360.0, 180.0])
def test_a_worm_is_found_and_drift_is_not_kept(cycles):
    missed, worse, pulls = 0, 0, []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        line = (rng.uniform(5.0, 18.0), rng.uniform(0.0, 6.28))
        form = rng.choice(["arc", "settles", "slow wave", "walk"])
        design = (cycles, line, rng.uniform(18.0, 26.0), int(rng.choice([900, 2000])))
        run = guided(rng, *design, form, rng.uniform(20.0, 140.0))
        following = guided(rng, *design, form, rng.uniform(-140.0, 140.0))
        rows = np.arange(len(run)) < 0.7 * len(run)
        try:
            found = ta.fit(part(run, rows), shafts={"worm": cycles})
        except NoModelError:
            missed += 1
            continue
        model, kept = found.model, list(found.orders)
        missed += cycles not in kept
        if cycles in kept:
            at = kept.index(cycles)
            pulls.append(
                (found.amplitudes[at] * 3600.0 - line[0]) / found.amplitude_std[at] / 3600.0
            )
        assert min(kept) >= 15.0, seed
        for held in (part(run, ~rows), following):
            with warnings.catch_warnings():  # it lies beyond the span, and that is the question
                warnings.simplefilter("ignore", OutsideSpanWarning)
                left = np.std(model.correct(held.indicated) - held.reference)
            # To the rounding of what one line explains of a drift ten times its size.
            worse += left > 1.001 * np.std(held.indicated - held.reference)
    print(f"missed {missed}, worse {worse} of {len(SEEDS)}")
    assert missed <= MISSED
    assert worse <= WORSE
    assert np.sqrt(np.mean(np.square(pulls))) < 1.4, pulls


def test_orders_that_the_travel_does_not_hold_are_told():
    rng = np.random.default_rng(62_200)
    run = guided(rng, 360.0, (12.0, 1.0), 22.0, 1500, "settles", 90.0)
    chosen = ta.select_orders(run, shafts={"worm": 360.0})
    low = [row for row in chosen.table if row.order < 16.0]
    assert low
    assert {row.verdict for row in low} == {"too long"}
    assert 360.0 in chosen.orders
    assert all("drift in time" in row.reason for row in low)


def test_a_joint_with_stops_keeps_its_low_orders():
    rng = np.random.default_rng(62_300)
    theta = np.linspace(-30.0, 160.0, 500)
    error = 0.2 * np.sin(np.radians(theta) + 0.4) + rng.normal(0.0, 0.002, 500)
    run = ta.CalibrationRun(theta, theta + error, period=360.0)
    model = ta.fit(run).model
    left = np.std(run.indicated - model.error(theta) - theta)
    assert left < 1.1 * 0.002
    # The arc passed there and back tells a low order from drift in time.
    back = np.concatenate([theta[:120], theta[119::-1]])
    error = 0.1 * np.sin(np.radians(back)) + rng.normal(0.0, 0.002, back.size)
    both = ta.CalibrationRun(back, back + error, period=360.0)
    assert min(ta.fit(both).model.shafts[0].orders) < 8


def test_orders_asked_for_are_looked_at():
    from trueangle.runs.aliasing import distinct_positions

    theta = np.linspace(0.0, 20.0, 400)
    positions = distinct_positions(ta.CalibrationRun(theta, theta, period=360.0))
    asked = choose_candidates(positions, [1, 2], None, "none", (), held_from=36.0)
    assert asked.local == frozenset()
