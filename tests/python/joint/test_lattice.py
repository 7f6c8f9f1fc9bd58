"""Lattices: the sensor's own, and those that a design puts there."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.lattice import (
    UniformGrid,
    finer_step,
    lattice_step,
    step_behind,
    table_move,
    uniform_grid,
)
from trueangle.joint.signals import join_runs
from trueangle.simulation import Simulation

LINES = ((1, 60.0, 40.0), (2, 25.0, 100.0))
SEED = 55_900


def table(n: int, runs: int, rng: np.random.Generator, back: bool = False) -> list:
    """Readings at indicated angles of equal steps, with order 1 and 2 and 2 arcsec of noise."""
    found = []
    for _ in range(runs):
        grid = np.arange(n) * 360.0 / n
        grid = np.concatenate([grid, grid[::-1]]) if back else grid
        error = sum(a * np.sin(np.radians(k * grid + p)) for k, a, p in LINES)
        noise = rng.normal(0.0, 2.0, grid.size)
        found.append(ta.CalibrationRun(grid - (error + noise) / 3600.0, grid, period=360.0))
    return found


def test_a_table_is_told_from_a_sensor_that_rounds():
    even = np.arange(73) / 72.0
    assert table_move([even, even[::-1] + 0.25], 1.0 / 72.0) == pytest.approx(1.0 / 72.0)
    assert table_move([even * 3.0], 1.0 / 72.0) == pytest.approx(3.0 / 72.0)
    # A slow sensor lingers at its counts, a fast one skips unevenly.
    slow = np.floor(np.linspace(0.0, 40.0, 200)) / 72.0
    fast = np.floor(np.linspace(0.0, 40.0, 15)) / 72.0
    assert lattice_step(slow) == pytest.approx(1.0 / 72.0)
    assert table_move([slow], 1.0 / 72.0) == 0.0
    assert table_move([fast], 1.0 / 72.0) == 0.0
    assert table_move([even], 0.0) == 0.0


@pytest.mark.parametrize(("n", "positions"), [(36, 36), (80, 80), (400, 400)])
def test_a_lattice_of_the_design_is_no_count(n, positions):
    signals = join_runs(table(n, 2, np.random.default_rng(n)))
    assert signals.count == 0.0
    assert signals.grid is not None
    assert signals.grid.positions == positions


@pytest.mark.parametrize("n", [24, 80, 100, 200, 400])
@pytest.mark.parametrize(("runs", "back"), [(1, False), (3, True)])
def test_tables_of_equal_steps_have_low_orders_and_no_counts(n, runs, back):
    result = ta.diagnose(table(n, runs, np.random.default_rng([n, runs])), Simulation())
    found = {f.parameters["order"].value: f for f in result.findings if f.cause == "missing_order"}
    assert [f.cause for f in result.findings] == ["missing_order"] * 2
    for order, amplitude, _ in LINES:
        size = found[order].parameters["amplitude_arcsec"]
        assert abs(size.value - amplitude) < 4.0 * size.std
    assert result.noise == pytest.approx(2.0, rel=0.4)


@pytest.mark.parametrize("step", [1.0, 1.0 / 4096.0, 1e-6])
@pytest.mark.parametrize("counts", [(1, 2, 4), (2, 3, 5), (3, 4, 8), (2, 4, 7), (6, 9, 15)])
def test_the_step_is_the_largest_that_all_differences_share(step, counts):
    values = step * np.concatenate([[0], np.cumsum(counts * 3)])
    expected = step * np.gcd.reduce(counts)
    for sign in (1.0, -1.0):
        assert lattice_step(sign * values) == pytest.approx(expected, rel=1e-12)
    # Differences below the rounding of sums do not count.
    doubled = np.concatenate([values, values + 0.5e-9 * max(1.0, values.max())])
    assert lattice_step(doubled) == pytest.approx(expected, rel=1e-3)
    for away, told in ((0.04, True), (0.06, False)):
        moved = values.copy()
        moved[4] += away * expected
        assert (lattice_step(moved) > 0.0) == told


def test_three_differences_make_a_lattice():
    assert lattice_step(np.array([0.0, 1.0, 3.0, 4.0])) == 1.0
    assert lattice_step(np.array([0.0, 1.0, 3.0])) == 0.0
    assert lattice_step(np.zeros(0)) == 0.0
    # A quarter would fit: a finest difference of four counts is not looked for.
    assert lattice_step(np.array([0.0, 4.0, 9.0, 15.0])) == 0.0


def test_how_many_readings_of_a_table_may_linger():
    for lingering, told in ((4, True), (5, False)):
        run = np.repeat(np.arange(77.0 + (4 - lingering)), 1)
        run = np.sort(np.concatenate([run, run[5 : 5 + lingering]]))
        assert run.size == 81
        assert (table_move([run / 100.0], 0.01) > 0.0) == told
    assert table_move([np.arange(4) / 10.0], 0.1) == pytest.approx(0.1)
    assert table_move([np.arange(3) / 10.0], 0.1) == 0.0
    assert table_move([np.array([0.0, 0.2, 0.4, 0.5, 0.6])], 0.1) == 0.0
    # The step over the seam is as long as the others.
    assert table_move([np.array([0.7, 0.8, 0.9, 0.0, 0.1])], 0.1) == pytest.approx(0.1)
    assert table_move([np.arange(9) / 10.0], -0.1) == 0.0


@pytest.mark.parametrize(("steps", "positions"), [(0.0, 20), (0.5, 40), (0.3, None)])
def test_a_table_in_any_order_keeps_its_positions(steps, positions):
    rng = np.random.default_rng(20)

    def visited(start: float):
        grid = (rng.permutation(20) + start) * 18.0
        return join_runs([ta.CalibrationRun(grid + rng.normal(0.0, 0.01, 20), grid, period=360.0)])

    signals = visited(0.0)
    assert signals.count == 0.0
    # Of some positions alone no one could tell.
    assert signals.take(np.arange(17)).grid == UniformGrid(20)
    both = signals.followed_by(visited(steps))
    assert both.grid == (None if positions is None else UniformGrid(positions))


@pytest.mark.parametrize("counts", [1024, 4096, 65536])
@pytest.mark.parametrize("n", [24, 36, 72, 100])
@pytest.mark.parametrize("back", [False, True])
def test_counts_of_a_sensor_show_at_places_of_equal_steps(counts, n, back):
    """The step is read off the moves, and where these leave it open none is told."""
    places = np.arange(n) * 360.0 / n
    places = np.concatenate([places, places[::-1]]) if back else places
    error = 0.13 * np.sin(np.radians(2.0 * places + 7.0))
    indicated = np.round((places + error) * counts / 360.0) * 360.0 / counts
    told = join_runs([ta.CalibrationRun(places, indicated, period=360.0)]).count
    moves = np.unique(np.abs(np.diff(np.round(indicated * counts / 360.0))))
    if np.gcd.reduce(np.diff(moves).astype(int)) == 1:
        assert told == pytest.approx(1296000.0 / counts, rel=1e-6)
    else:
        assert told == 0.0 or told == pytest.approx(1296000.0 / counts, rel=1e-6)


def test_no_finer_step_is_told_of_what_has_none():
    rng = np.random.default_rng(11)
    for _ in range(200):
        n = int(rng.integers(8, 100))
        for spread in (1e-3, 1e-6):
            assert finer_step(np.arange(n) / n + rng.normal(0.0, spread / n, n), 1.0 / n) == 0.0
    # Some places of a table in any order are no counts, however far apart.
    assert finer_step(np.array([3, 9, 4, 20, 1, 0, 27]) / 36.0, 1.0 / 36.0) == 0.0
    assert finer_step(np.array([0.25])) == finer_step(np.zeros(0)) == 0.0


@pytest.mark.parametrize("bits", [9, 12, 14])
@pytest.mark.parametrize("turn", [360.0, 2.0 * np.pi, 1.0])
def test_counts_show_behind_decimals_and_make_no_orders(bits, turn):
    """Of 12 bits in six decimals of a degree 15 orders had been kept: its last digit 4096 times."""
    # From a twentieth of a count to what holds nothing but counts.
    for decimals in range(int(np.ceil(np.log10(20.0 * 2**bits / turn))), 11):
        for places in (np.arange(720) / 720.0, np.random.default_rng(bits).uniform(size=500)):
            error = 3.0 * np.sin(2.0 * np.pi * places + 1.0) + np.cos(4.0 * np.pi * places)
            turns = np.floor(places * 2**bits + error) / 2**bits
            read = (np.round(turn * angle, decimals) for angle in (places, turns))
            run = ta.CalibrationRun(*read, period=turn)
            assert join_runs([run]).count == pytest.approx(1296000.0 / 2**bits, rel=1e-4)
            assert sorted(ta.select_orders([run]).orders) == [1, 2], decimals


def test_nothing_shows_behind_digits_of_what_has_no_counts():
    rng = np.random.default_rng(13)
    for k in range(60):
        n = int(rng.choice([24, 36, 100, 400]))
        places = np.sort(rng.uniform(0.0, 1.0, n)) if k % 2 else np.arange(n) / n
        degrees = np.round(360.0 * places + rng.normal(0.0, 0.02, n), 2)
        assert step_behind(degrees / 360.0, places, 0.01 / 360.0) == 0.0
    # No digit, one that does not divide a turn, one too fine to look behind.
    for digit in (0.0, 0.0123, 1e-7):
        assert step_behind(places, places, digit) == 0.0


@pytest.mark.parametrize("readings", [3000, 12_000])
def test_counts_that_are_all_read_are_counts(readings):
    """A sweep past each count of a sensor moves by one count or by none."""
    rng = np.random.default_rng(readings)
    places = (np.arange(readings) + rng.uniform(size=readings)) * 360.0 / readings
    indicated = np.round((places + 0.1 * np.sin(np.radians(places))) * 1024 / 360.0) * 360.0 / 1024
    told = join_runs([ta.CalibrationRun(places, indicated, period=360.0)]).count
    assert told == pytest.approx(1296000.0 / 1024)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("places", "even"), [(36, "indicated"), (72, "reference"), (96, "indicated")]
)
def test_a_table_with_a_position_omitted_has_its_low_orders_and_their_aliases(places, even, seed):
    """Order 98 had been confirmed for 2, and the correction made the error larger."""
    rng = np.random.default_rng([SEED, places, seed])
    grid = np.arange(places) * 360.0 / places
    lines = ((1, 420.0, 20.0), (3, 610.0, 200.0))
    error = sum(a * np.sin(np.radians(k * grid + p)) for k, a, p in lines) / 3600.0
    error = error + rng.normal(0.0, 60.0, places) / 3600.0
    kept = np.arange(places) != rng.integers(2, places - 2)
    pair = (grid, grid + error) if even == "reference" else (grid - error, grid)
    run = ta.CalibrationRun(*(angles[kept] for angles in pair), period=360.0)
    found = ta.diagnose([run], Simulation(sigma_arcsec=30.0))
    named = {
        f.parameters["output_order"].value: f.parameters for f in found.findings if f.confirmed
    }
    assert set(named) == {1.0, 3.0}
    assert named[3.0]["aliases"].value[:1] == [places - 3.0]


@pytest.mark.parametrize(("count", "apart"), [(10, 7.31), (12, 0.93), (11, 5.17)])
def test_few_places_many_turns_apart_have_the_orders_that_so_many_places_show(count, apart):
    """Order 2 had been confirmed for 1, and `check` took 120 turns for none."""
    rng = np.random.default_rng([SEED, count])
    targets = np.arange(count) * apart * 360.0
    runs = []
    for k in range(8):
        way = targets if k % 2 == 0 else targets[::-1]
        error = 0.35 * np.sin(np.radians(way + 200.0)) + 0.25 * np.sin(np.radians(3.0 * way + 40.0))
        runs.append(
            ta.CalibrationRun(way, way + error + rng.normal(0.0, 0.04, count), period=360.0)
        )
    found = ta.diagnose(runs, Simulation(sigma_arcsec=150.0))
    named = {f.parameters["output_order"].value for f in found.findings if f.confirmed}
    assert named == {1.0, 3.0}
    assert runs[0].unwrapped_reference[-1] == pytest.approx(targets[-1])
    assert "hardly moved" not in ta.check(runs).summary()


@pytest.mark.parametrize("n", [3, 7, 36])
def test_orders_that_look_alike_on_a_grid(n):
    """Slow: two orders are alike where their cosines are so at every position."""
    grid = UniformGrid(n)
    angle = 2.0 * np.pi * np.arange(n) / n

    def alike(a, b):
        return np.allclose(np.cos(a * angle), np.cos(b * angle), atol=1e-9)

    for order in range(1, 3 * n):
        assert grid.folded(order) == next(m for m in range(n) if alike(m, order))
        wanted = [m for m in range(9 * n) if alike(m, order) and m != order]
        for count in (0, 1, 4):
            assert grid.aliases(order, count) == wanted[:count]


@pytest.mark.parametrize("shift", [0.0, 0.3, -2.0])
@pytest.mark.parametrize(("n", "found"), [(2, None), (3, 3), (36, 36), (10_000, 10_000),
                                          (10_001, None)])  # fmt: skip
def test_a_uniform_grid_is_told_wherever_it_begins(n, found, shift):
    rng = np.random.default_rng(n)
    theta = rng.permutation(np.concatenate([np.arange(n), np.arange(n) + 2 * n]))
    grid = uniform_grid((theta / n + shift) * 2.0 * np.pi)
    assert (grid and grid.positions) == found


def test_how_far_readings_may_stand_from_a_grid():
    turns = np.arange(36.0) / 36.0
    for away, told in ((0.019, True), (0.021, False), (-0.019, True), (-0.021, False)):
        # Two, so that the others' mean stays where it was.
        moved = turns.copy()
        moved[[5, 20]] += np.array([away, -away]) / 36.0
        assert (uniform_grid(2.0 * np.pi * moved) is not None) == told
    # Two readings of one position are one; farther apart two.
    for apart, positions in ((1e-5, 36), (3e-5, None)):
        again = np.append(turns, turns[7] + apart)
        grid = uniform_grid(2.0 * np.pi * again)
        assert (grid and grid.positions) == positions
    # At the places that are left the same orders look alike.
    assert uniform_grid(2.0 * np.pi * np.delete(turns, 3)) == UniformGrid(36)


@pytest.mark.parametrize("positions", [12, 36, 360])
@pytest.mark.parametrize("share", [0.4, 0.9])
def test_an_arc_of_equal_steps_is_the_grid_of_its_turn(positions, share):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    count = max(round(share * positions), 6)
    start = rng.uniform(0.0, 2.0 * np.pi)
    theta = start + np.arange(count) * 2.0 * np.pi / positions
    assert uniform_grid(theta) == UniformGrid(positions)
    # A third of the places left out, the ends kept, and readings there and back.
    kept = np.sort(rng.permutation(np.arange(1, count - 1))[count // 3 :])
    kept = np.concatenate([[0], kept, [count - 1]])
    if kept.size >= 6 and np.diff(kept).min() == 1:
        assert uniform_grid(np.concatenate([theta[kept], theta[kept][::-1]])) == UniformGrid(
            positions
        )
    # Orders that look alike there do so at each place.
    grid = uniform_grid(theta)
    for alias in grid.aliases(5.0, 3):
        line, other = (np.exp(1j * m * (theta - start)) for m in (5.0, alias))
        np.testing.assert_allclose(
            np.minimum(abs(line - other), abs(line - other.conj())), 0.0, atol=1e-9
        )


@pytest.mark.parametrize("digits", [1, 2, 3])
def test_free_angles_are_no_grid_however_they_are_printed(digits):
    rng = np.random.default_rng(SEED)
    theta = np.radians(np.round(rng.uniform(40.0, 230.0, 200), digits))
    assert uniform_grid(theta) is None
