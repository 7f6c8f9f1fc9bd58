"""What searches for lines look through, what they pay for it, and sums written out."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import MissingOrder, NonIntegerOrder, Sidebands, WrongGearRatio
from trueangle.effects.time_periodic import FREQUENCY_DRIFT, OVERSAMPLING, _drifting
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import line_columns, line_sum
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

Array = np.ndarray
SEED = 75_000


def signals_of(sim: Simulation, turns: float, runs: int = 4, samples: int = 700) -> Signals:
    designs = [
        RunDesign(samples=samples, turns=turns, start_deg=41.0 * k, speed_deg_s=7.0 + k)
        for k in range(runs)
    ]
    noisy = Simulation(sim.joint, sim.harmonics, sigma_arcsec=1.0, runs=tuple(designs))
    return join_runs(ta.simulate(noisy, 3))


def regression_of(sim: Simulation, signals: Signals, error: Array) -> Regression:
    print(f"seed {SEED}")
    noise = np.random.default_rng(SEED).standard_normal(len(signals))
    return Regression.of(signals, noise + error, sim.surroundings, rho=0.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("highest", [1.0, 2.0])
def test_a_ratio_is_one_of_those_whose_lines_are_looked_for(highest: float, sign: float) -> None:
    """All whole ratios but the believed one, up to that whose fastest line is the last order."""
    lines = (Harmonic("motor", 1, 20.0, 40.0), Harmonic("motor", highest + 1.0, 15.0, 80.0))
    sim = Simulation(Joint(sign * 20.0), lines)
    signals = signals_of(sim, 1.3)
    hidden = WrongGearRatio(23.0)
    error = hidden.signal(signals, sim.surroundings, np.random.default_rng(0))
    regression = regression_of(sim, signals, error)
    found = WrongGearRatio.propose(regression)
    assert found is not None
    orders = regression.lines.orders
    ratios = [r for r in range(2, 500) if r * (highest + 1.0) <= orders.max() and r != 20]
    assert found.shape == {
        "gear_ratio": sign * 23.0, "orders": [23.0, 23.0 * (highest + 1.0)], "alike": [],
    }  # fmt: skip
    assert found.log_grid == pytest.approx(np.log(len(ratios)))
    # Two lines and the ratio.
    assert found.parameters == 5


@pytest.mark.parametrize("shift", [0.0, 0.004, 0.007])
@pytest.mark.parametrize("middle", [3.0, 11.0, 40.0])
def test_a_frequency_that_drifts_is_looked_for_in_bands_about_it(
    middle: float, shift: float
) -> None:
    """In each run where its power is largest; one of the bands, and a place in it in every run."""
    print(f"seed {SEED}")
    step = 0.01
    frequencies = step * np.arange(200, 6000)
    rng = np.random.default_rng(SEED)
    p = rng.exponential(2.0, (frequencies.size, 5))
    places = np.round((middle * (1.0 + shift * np.linspace(-1.0, 1.0, 5)) - 2.0) / step).astype(int)
    for run, place in enumerate(places):
        p[place, run] = 60.0 + run
    found, deviance, log_grid = _drifting(frequencies, p)
    np.testing.assert_array_equal(found, places)
    assert deviance == pytest.approx(sum(60.0 + run for run in range(5)))
    bands = np.log(frequencies[-1] / frequencies[0]) / FREQUENCY_DRIFT
    # Of all bands that hold these places the one that pays least for its width.
    paid = []
    for k in range(1, int(bands) + 1):
        about = frequencies[0] * (1.0 + FREQUENCY_DRIFT) ** k
        inside = (frequencies >= about * (1.0 - FREQUENCY_DRIFT)) & (
            frequencies < about * (1.0 + FREQUENCY_DRIFT)
        )
        if inside[places].all():
            paid.append(np.log(2.0 * bands) + 5.0 * np.log(inside.sum() / OVERSAMPLING + 1.0))
    assert log_grid == pytest.approx(min(paid), rel=1e-9)
    # Every frequency but those about either end lies in some band.
    alone = np.zeros_like(p)
    for k in range(30, frequencies.size - 120, 400):
        alone[:] = 0.0
        alone[k] = 50.0
        assert _drifting(frequencies, alone)[1] == 250.0


@pytest.mark.parametrize("scale", [1.0, 1e-3, 250.0])
def test_lines_of_new_phases_save_what_their_sums_say(scale: float) -> None:
    """By the sums of each run as they are, in any unit of the error."""
    sim = Simulation(Joint(20.0))
    signals = signals_of(sim, 3.0, samples=120)
    phase = np.random.default_rng(SEED).uniform(0.0, 6.0, 4)[signals.run]
    line = 2.0 * np.sin(7.3 * signals.theta + phase)
    noise = np.random.default_rng(SEED).standard_normal(len(signals))
    regression = Regression.of(signals, scale * (noise + line), sim.surroundings, rho=0.0)
    orders, saved = NonIntegerOrder._search(regression)
    assert orders[int(np.argmax(saved))] == pytest.approx(7.3, abs=0.1)
    left = np.where(regression.outlying, 0.0, regression.left_within_runs)
    for k in range(0, orders.size, 23):
        of_ratio = np.zeros(13)
        for start, stop in regression.bounds:
            wave = np.exp(-1j * orders[k] * signals.theta[start:stop])
            n = stop - start
            power = 2.0 * abs(wave @ left[start:stop]) ** 2 / (n * regression.variance)
            x = n * np.geomspace(1e-3, 1e3, 13)
            of_ratio += power * x / (2.0 + x) - 2.0 * np.log1p(x / 2.0)
        assert saved[k] == pytest.approx(max(float(of_ratio.max()), 0.0), abs=1e-6)


@pytest.mark.parametrize("runs", [1, 2, 5])
def test_a_line_that_keeps_its_phase_is_the_orders_beside_it(runs: int) -> None:
    """Half way between what one phase leaves of R new ones, 1/R, and all of it."""
    sim = Simulation(Joint(20.0))
    signals = signals_of(sim, 0.6, runs=runs, samples=200)
    beside = np.hstack([line_columns(signals.theta, order) for order in (7.0, 8.0)])
    regression = regression_of(sim, signals, beside @ np.array([2.0, 1.0, -1.0, 2.0]))
    gain, _ = regression.gain(beside)
    for share in (0.99, 1.01):
        deviance = gain / (share * (0.5 + 0.5 / runs))
        found = Extension("non_integer_order", {"order": 7.4}, beside, 1, deviance=deviance)
        assert NonIntegerOrder._keeps_phase(regression, found) == (share > 1.0)


@pytest.mark.parametrize(
    ("ratio", "turns", "resolved"),
    [(31.0, 0.12, False), (46.0, 0.09, False), (31.0, 0.6, True), (46.0, 1.2, True)],
)
def test_orders_that_differ_by_less_than_half_a_wave_over_a_run_are_named_together(
    ratio: float, turns: float, resolved: bool
) -> None:
    """The motor's own order is then proposed in place of its neighbour."""
    sim = Simulation(Joint(ratio))
    signals = signals_of(sim, turns, runs=1, samples=300)
    line = line_sum(signals.theta, ((ratio - 1.0, 3.0, 70.0),))
    found = MissingOrder.propose(regression_of(sim, signals, line))
    assert found is not None
    order = ratio - 1.0 if resolved else ratio
    assert found.shape["output_order"] == order
    assert (ratio - 1.0 in found.shape["alike"]) != resolved
    assert (found.shape["alike"] == []) == resolved


GEARED = Simulation(
    Joint(50.0, "circular_spline", "motor"),
    (Harmonic("motor", 2, 30.0, 248.0), Harmonic("wave_generator", 2, 30.0, 115.0)),
)


@pytest.mark.parametrize(
    ("turns", "offset", "seen"),
    [(1.3, 1, True), (1.3, 2, True), (0.85, 1, True), (0.6, 1, False), (0.6, 2, True),
     (0.45, 2, True), (0.3, 2, False), (0.3, 1, False)],
)  # fmt: skip
def test_sidebands_are_looked_for_where_a_run_covers_their_modulation(
    turns: float, offset: int, seen: bool
) -> None:
    """Three quarters of its period; a pair of lines that is there is proposed, at its offset."""
    signals = signals_of(GEARED, turns)
    lines = ((100.0 - offset, 6.0, 20.0), (100.0 + offset, 8.0, 100.0))
    regression = regression_of(GEARED, signals, line_sum(signals.theta, lines))
    found = Sidebands.propose(regression)
    assert (found is not None and found.shape["offset"] == offset) == seen
    if turns == 0.3:
        assert found is None


def term(carrier: float, offset: int, form: str, coefficients: list[float]) -> tuple:
    extension = Extension(
        "sidebands", {"carrier": carrier, "offset": offset, "form": form}, np.zeros((0, 0)), 4
    )
    count = len(coefficients)
    return extension, np.array(coefficients), np.diag(np.arange(1.0, count + 1.0) ** 2)


def test_bends_of_sidebands_are_the_lines_beside_them() -> None:
    """Of a carrier's modulation: three and two offsets away, and itself; no order below nothing."""
    signals = signals_of(GEARED, 1.3, runs=1, samples=50)
    for carrier, k, orders in (
        (100.0, 1, [97.0, 98.0, 100.0, 102.0, 103.0]),
        (100.0, 2, [94.0, 96.0, 100.0, 104.0, 106.0]),
        (2.0, 1, [2.0, 4.0, 5.0]),
        (6.0, 2, [2.0, 6.0, 10.0, 12.0]),
    ):
        extension, coefficients, _ = term(carrier, k, "free", [1.0, 2.0, 3.0, 4.0])
        found = Sidebands.bends(signals, [(extension, coefficients)])
        wanted = np.hstack([line_columns(signals.theta, order) for order in orders])
        np.testing.assert_allclose(found, wanted, atol=1e-9)


def test_what_is_told_of_sidebands_is_each_line_with_its_carrier() -> None:
    """Amplitude, phase and their errors of every line; all carriers where these differ."""
    signals = signals_of(GEARED, 1.3, runs=1, samples=50)
    regression = regression_of(GEARED, signals, np.zeros(len(signals)))
    first = term(100.0, 1, "free", [3.0, 4.0, 0.0, -2.0])
    for second, carriers in (
        (term(100.0, 2, "lower", [5.0, 0.0]), None),
        (term(102.0, 1, "upper", [5.0, 0.0]), [100.0, 100.0, 102.0]),
    ):
        told, effects = Sidebands.report(regression, [first, second])
        last = 98.0 if carriers is None else 103.0
        assert told["carrier"].value == 100.0
        assert told["orders"].value == [99.0, 101.0, last]
        # A cosine of 3 and a sine of 4 are 5 sin(x + 36.9 deg).
        assert told["amplitudes"].value == pytest.approx([5.0, 2.0, 5.0])
        assert told["phases_deg"].value == pytest.approx(
            [np.degrees(np.arctan2(3.0, 4.0)), 180.0, 90.0]
        )
        along = float(np.sqrt(9.0 + 4.0 * 16.0)) / 5.0
        across = float(np.sqrt(16.0 + 4.0 * 9.0)) / 25.0
        assert told["amplitudes"].std == pytest.approx([along, 4.0, 1.0])
        assert told["phases_deg"].std == pytest.approx(np.degrees([across, 3.0 / 2.0, 2.0 / 5.0]))
        assert (told["carriers"].value if "carriers" in told else None) == carriers
        assert [(e.carrier, e.offsets) for e in effects] == [
            (100.0, (-1, 1)), (100.0, (-2,)) if carriers is None else (102.0, (1,)),
        ]  # fmt: skip


@pytest.mark.parametrize("form", ["AM", "PM"])
def test_lines_of_a_modulation_are_what_it_makes_of_its_carrier(form: str) -> None:
    """Their sum is the modulated carrier; errors go with them, as least squares maps them."""
    signals = signals_of(GEARED, 1.3, runs=1, samples=80)
    regression = regression_of(GEARED, signals, np.zeros(len(signals)))
    extension, coefficients, covariance = term(100.0, 1, form, [0.3, -0.2])
    covariance = 1e-3 * covariance
    columns = Sidebands.columns(signals, regression.around, extension.shape)
    told, (effect,) = Sidebands.report(regression, [(extension, coefficients, covariance)])
    made = effect.signal(signals, regression.around, np.random.default_rng(0))
    np.testing.assert_allclose(made, columns @ coefficients, atol=1e-9)
    lines = [line_columns(signals.theta, order) for order in (99.0, 101.0)]
    for j, line in enumerate(lines):
        design = np.hstack([line, lines[1 - j]])
        map_ = np.linalg.lstsq(design, columns, rcond=None)[0][:2]
        (a, b), spread = map_ @ coefficients, map_ @ covariance @ map_.T
        size = np.hypot(a, b)
        along, across = np.array([a, b]) / size, np.array([b, -a]) / size**2
        assert told["amplitudes"].value[j] == pytest.approx(size)
        assert told["amplitudes"].std[j] == pytest.approx(np.sqrt(along @ spread @ along))
        turn = np.degrees(np.sqrt(across @ spread @ across))
        assert told["phases_deg"].std[j] == pytest.approx(turn)


@pytest.mark.parametrize(
    ("carrier", "offset", "shared"),
    [(100.0, 1, []), (100.0, 2, ["order 102 is wave generator order 2"]),
     (102.0, 2, ["order 100 is motor order 2"]), (102.0, 1, [])],
)  # fmt: skip
def test_a_sideband_at_a_line_of_another_shaft_is_in_doubt(
    carrier: float, offset: int, shared: list[str]
) -> None:
    """An order that is whole, and so one of the output, is no line of a shaft for that."""
    signals = signals_of(GEARED, 1.3, runs=1, samples=50)
    regression = regression_of(GEARED, signals, np.zeros(len(signals)))
    extension, _, _ = term(carrier, offset, "free", [1.0] * 4)
    spot = Sidebands.doubt(extension, regression, [])
    assert (spot is None) == (not shared)
    if spot is not None:
        assert spot.because == f"{', '.join(shared)} as well as a sideband of order {carrier:g}"
        assert spot.causes == ("sidebands", "missing_order")


@pytest.mark.parametrize("apart", [1.0, 7.3, 13.0])
@pytest.mark.parametrize("order", [3, 40, 77])
def test_mounts_of_a_polygon_show_orders_above_half_of_its_faces(order, apart):
    """The joint's, where order 40 of 36 faces had been an error of the polygon at 13 deg."""
    rng = np.random.default_rng([SEED, order])
    runs = []
    for mount in np.repeat([0.0, apart], 3):
        theta = 10.0 * np.arange(36) + mount
        error = 30.0 * np.sin(np.radians(order * theta + 17.0)) + rng.normal(0.0, 1.5, 36)
        runs.append(ta.CalibrationRun(theta, theta + error / 3600.0, 360.0, mount=[mount] * 36))
    (found,) = [f for f in ta.diagnose(runs, Simulation()).findings if f.confirmed]
    assert (found.cause, found.parameters["output_order"].value) == ("missing_order", order)
    assert abs(found.parameters["amplitude_arcsec"].value - 30.0) < 1.0
