"""The paper's rules: the noise that runs show, errors of means, gains, in any unit and number."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.fitting.orders.select import select_orders

SEED = 49_300
SIGMA = 2e-5


def groups(rng, runs, unit=360.0, noise=SIGMA, positions=36):
    """Orders 1 and 5 in turns, every run with its own zero."""
    turn = np.arange(positions) / positions
    wave = 1e-4 * np.sin(2.0 * np.pi * turn) + 6e-5 * np.cos(10.0 * np.pi * turn + 1.0)
    found = []
    for number in range(runs):
        read = turn + wave + noise * rng.normal(size=positions) + 0.01 * number
        found.append(ta.CalibrationRun(unit * turn, unit * read, unit, label=str(number)))
    return found


@pytest.mark.parametrize("unit", [360.0, 1.0])
@pytest.mark.parametrize(
    ("runs", "highest", "source"),
    [(4, 17, "repeats"), (10, 17, "repeats"), (4, 8, "residual"), (10, 8, "residual")],
)
def test_the_noise_is_that_of_one_reading_however_many_there_are(runs, highest, source, unit):
    """By the scatter of runs where no reading is left, by what is left elsewhere."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, runs, highest])
    draws = []
    for _ in range(12):
        chosen = select_orders(groups(rng, runs, unit), range(1, highest + 1), method="paper")
        assert chosen.noise.source == source
        draws.append(chosen.noise.variance / (SIGMA * unit) ** 2)
    # A median of chi-squared numbers is lower than their mean: by 2/9 of 2 over the freedom.
    freedom = 2.0 * (runs - 2.0)
    low = (1.0 - 2.0 / (9.0 * freedom)) ** 3 if source == "repeats" else 1.0
    count = highest if source == "repeats" else 36.0 - 1.0 - 2.0 * highest
    spread = 1.6 * np.sqrt(2.0 / ((runs - 2.0) * 2.0 * count * 12.0))
    assert np.mean(draws) == pytest.approx(low, abs=4.5 * spread)


def test_pulls_of_orders_that_the_paper_retains():
    """Means of five runs, the last held out: errors of their components have no other size."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    truth = {1: (0.0, 1e-4), 5: (6e-5 * np.cos(1.0), -6e-5 * np.sin(1.0))}
    pulls = []
    for _ in range(100):
        table = {row.order: row for row in
                 select_orders(groups(rng, 6, 1.0), (1, 5), method="paper").table}  # fmt: skip
        for order, (cosine, sine) in truth.items():
            row = table[order]
            pulls += [(row.cosine - cosine) / row.standard_error,
                      (row.sine - sine) / row.standard_error]  # fmt: skip
    # Student's, of eight degrees of freedom: a variance of 8 / 6.
    assert np.mean(np.square(pulls)) == pytest.approx(8.0 / 6.0, abs=4.5 * np.sqrt(9.0 / 400.0))
    assert abs(np.mean(pulls)) < 4.5 * np.sqrt(8.0 / 6.0 / 400.0)


@pytest.mark.parametrize("unit", [2.0 * np.pi, 8192.0])
def test_all_that_the_paper_tells_is_the_same_in_every_unit(unit):
    tables = []
    for period in (360.0, unit):
        runs = groups(np.random.default_rng(SEED + 2), 6, period)
        found = select_orders(runs, range(1, 18), method="paper")
        tables.append(
            [
                [row.order, row.retained, row.amplitude / period, row.standard_error / period,
                 row.statistic, row.log10_false_alarm, row.holdout_gain, row.phase_spread_deg]
                for row in found.table
            ]
        )  # fmt: skip
        assert set(found.orders) == {1, 5}
        told = float(found.notes[0].split(" -> ")[0].rsplit(" ", 1)[-1])
        error = runs[-1].centred_error
        assert told == pytest.approx(np.ptp(error) / period * 1_296_000.0, abs=0.006)
    np.testing.assert_allclose(tables[1], tables[0], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_paper_takes_three_runs_two_to_compare_and_one_held_out(count: int) -> None:
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    runs = groups(rng, 3, 1.0)[:count]
    if count < 3:
        with pytest.raises(ArgumentError, match=f"three or more, got {count}"):
            select_orders(runs, range(1, 6), method="paper")
    else:
        assert select_orders(runs, range(1, 6), method="paper").runs == 3
