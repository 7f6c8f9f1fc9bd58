"""Orders with their errors, what a loop hides, ripple, tests of halves, and their words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.errors import ArgumentError, NotInvertibleError
from trueangle.model.model import HarmonicModel
from trueangle.selfcalibration.loop import (
    check_loop,
    followed_orders,
    followed_share,
    widened_by_loop,
)
from trueangle.selfcalibration.model import (
    pattern_model,
    pattern_series,
    pattern_steepness,
    reference_free_model,
)
from trueangle.selfcalibration.orderchoice import louder_beside, spectrum_at
from trueangle.selfcalibration.projected import harmonic_rows, harmonic_sum
from trueangle.selfcalibration.recording import Recording
from trueangle.selfcalibration.result import (
    Blind,
    HeldOutPattern,
    OrderEstimate,
    SelfCalibration,
    blind_words,
    order_estimates,
)
from trueangle.selfcalibration.ripple import averaged_over_ripple, cost_of_ripple
from trueangle.selfcalibration.verification import chance_of_difference, judged_patterns
from trueangle.support.layout import order_ranges

ARCSEC = 1_296_000.0 / (2.0 * math.pi)


def order(k: float, a: float = 3.0, b: float = 4.0, std: float = 0.5) -> OrderEstimate:
    return OrderEstimate(k, a, b, std, 0.8, 1.2)


def test_orders_with_the_errors_of_their_amplitudes() -> None:
    """The error along the amplitude, by what the amplitude does of draws."""
    half = np.array([[2.0, 0.0], [1.0, 0.5]]) * 1e-6
    covariance = np.zeros((4, 4))
    covariance[2:, 2:] = half @ half.T
    covariance[:2, :2] = np.eye(2) * 1e-12
    coefficients = np.array([0.0, 0.0, 3e-4, -4e-4])
    reached = np.array([0.9, 0.8, 0.7, 0.6])
    first, second = order_estimates(
        [1, 2.5], coefficients, covariance, reached, 1e-6, ["zero", "second"]
    )
    rng = np.random.default_rng(1)
    drawn = coefficients[2:] + rng.normal(size=(20_000, 2)) @ half.T
    assert second.std == pytest.approx(np.hypot(*drawn.T).std() * ARCSEC, rel=0.03)
    assert second.std_factor == pytest.approx(math.sqrt(0.5 * np.trace(half @ half.T)) / 1e-6)
    assert (second.order, second.retained, second.of) == (2.5, 0.6, "second")
    assert second.amplitude == pytest.approx(5e-4 * ARCSEC)
    assert second.cosine == pytest.approx(3e-4 * ARCSEC)
    x = np.linspace(0.0, 6.0, 20)
    np.testing.assert_allclose(
        second.amplitude * np.sin(x + math.radians(second.phase_deg)),
        second.cosine * np.cos(x) + second.sine * np.sin(x),
    )
    assert 0.0 <= second.phase_deg < 360.0
    assert (first.std, first.retained) == (pytest.approx(1e-6 * ARCSEC), 0.8)
    alone = order_estimates([1], coefficients[2:], covariance[2:, 2:], np.ones(2), 0.0)[0]
    assert alone.std_factor == math.inf
    told = alone.to_dict()
    assert told == {
        "order": 1,
        "amplitude_arcsec": alone.amplitude,
        "phase_deg": alone.phase_deg,
        "std_arcsec": alone.std,
        "retained": 1.0,
        "std_factor": None,
        "of": "the encoder",
    }
    assert second.to_dict()["order"] == 2.5
    assert second.to_dict()["std_factor"] == second.std_factor


def test_halves_are_judged_by_chi_squared() -> None:
    rng = np.random.default_rng(2)
    half = np.tril(rng.normal(size=(4, 4))) + 2.0 * np.eye(4)
    ps = [chance_of_difference(half @ rng.normal(size=4), half @ half.T) for _ in range(500)]
    # Kolmogorov's distance of 500 uniform numbers: 1.95 / sqrt(500) once in a thousand.
    away = np.abs(np.sort(ps) - (np.arange(500) + 0.5) / 500).max()
    assert away < 1.95 / math.sqrt(500)
    found = judged_patterns(np.array([1e-5, 0.0]), np.array([1e-5, 2e-5]), 0.25, 3e-5, ("a", "b"))
    assert found.p == 0.25
    assert found.rms_before == pytest.approx(math.sqrt(9.0 + 0.5 * 5.0) * 1e-5 * ARCSEC)
    assert found.rms_after == pytest.approx(math.sqrt(9.0 + 0.5 * 4.0) * 1e-5 * ARCSEC)
    assert (found.fitted_on, found.judged_on) == ("a", "b")
    assert HeldOutPattern("a", "b", 1.0, 2.0, 0.0011).to_dict()["agrees"]
    assert not HeldOutPattern("a", "b", 1.0, 2.0, 0.001).to_dict()["agrees"]
    assert chance_of_difference(np.zeros(0), np.zeros((0, 0))) == 1.0


def test_so_great_a_difference_is_as_frequent_as_its_chance_says() -> None:
    """Of covariances whose size 12 draws of noise tell: uniform, and of a known one chi-squared."""
    rng, ps = np.random.default_rng(8), []
    half = np.tril(rng.normal(size=(4, 4))) + 2.0 * np.eye(4)
    for _ in range(500):
        variance = np.mean(np.square(rng.normal(size=12)))
        ps.append(chance_of_difference(half @ rng.normal(size=4), variance * half @ half.T, 12.0))
    assert np.abs(np.sort(ps) - (np.arange(500) + 0.5) / 500).max() < 1.95 / math.sqrt(500)
    assert chance_of_difference(np.array([3.0, 0.0]), np.eye(2)) == pytest.approx(math.exp(-4.5))


def test_a_loop_hides_what_passes_slowly() -> None:
    orders = (1.0, 2.0, 5.0, 8.0)
    assert followed_orders(orders, "open", None, 1.0) == ((), None)
    for loop, bandwidth in (("closed", None), ("unknown", None), ("unknown", 5.0)):
        refused, blind = followed_orders(orders, loop, bandwidth, 1.0)
        assert refused == orders
        assert blind is not None
        assert ("unknown bandwidth" in blind.because) == (loop == "closed")
    refused, blind = followed_orders(orders, "closed", 5.0, 2.0)
    assert refused == (1.0, 2.0)  # order 5 passes at twice the bandwidth
    assert "turn faster than 10 turns/s" in blind.measure
    assert "bandwidth of 5 Hz" in blind.because
    assert followed_orders(orders, "closed", 5.0, 10.0) == ((), None)
    assert followed_share(50.0, "closed", 5.0) == 0.1
    assert followed_share(2.0, "closed", 5.0) == 1.0
    assert followed_share(50.0, "open", None) == followed_share(50.0, "open", 5.0) == 0.0
    check_loop("closed", 5)
    for loop, bandwidth, says in (
        ("shut", None, "loop must be one of"),
        ("closed", 0.0, "loop_bandwidth must be positive hertz"),
        ("closed", math.inf, "loop_bandwidth must be positive hertz"),
        ("closed", "5", "loop_bandwidth must be positive hertz"),
        ("open", 5.0, "given for an open loop"),
    ):
        with pytest.raises(ArgumentError, match=says):
            check_loop(loop, bandwidth)  # type: ignore[arg-type]


def test_what_a_loop_may_have_done_widens_the_error() -> None:
    """Along one direction a disc has half its radius as deviation."""
    given = order(3.0)
    rng = np.random.default_rng(3)
    radius = 0.2 * 5.0 * np.sqrt(rng.uniform(size=200_000))
    along = radius * np.cos(rng.uniform(0.0, 2.0 * np.pi, radius.size))
    found = widened_by_loop(given, 0.2)
    assert found.std == pytest.approx(math.hypot(0.5, along.std()), rel=0.01)
    assert found.std_factor / found.std == pytest.approx(given.std_factor / given.std)
    assert widened_by_loop(given, 0.0) is given
    still = order(3.0, std=0.0)
    assert widened_by_loop(still, 0.2) is still


@pytest.mark.parametrize("speeds", [1.0, 1.3, 5.0])
def test_the_cost_of_ripple_is_that_of_its_columns(speeds: float) -> None:
    rho = np.exp(np.linspace(0.0, 2.0 * math.log(speeds), 3000)) if speeds > 1 else np.ones(3000)
    if speeds == 1.0:
        assert cost_of_ripple(rho) > 1e7
        return
    theta = np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 3000)
    h = np.column_stack([np.cos(theta), np.sin(theta)])
    both = np.hstack([h, rho[:, None] * h])
    ratio = np.linalg.inv(both.T @ both)[0, 0] * (h[:, 0] @ h[:, 0])
    assert cost_of_ripple(rho) == pytest.approx(math.sqrt(ratio), rel=0.03)


@pytest.mark.parametrize(("ripple", "probable"), [(0.0, False), (300.0, True)])
def test_ripple_is_weighed_and_its_errors_hold(ripple: float, probable: bool) -> None:
    rng = np.random.default_rng(5)
    rho = np.linspace(0.6, 1.8, 400)
    theta = rng.uniform(0.0, 2.0 * np.pi, 400)
    h = np.column_stack([f(k * theta) for k in (1, 2) for f in (np.cos, np.sin)])
    x = np.hstack([h, rho[:, None] * h[:, 2:]])
    covariance = np.linalg.inv(x.T @ x)
    truth = np.array([5.0, -3.0, 2.0, 1.0, ripple, 0.5 * ripple]) * 0.1
    half = np.linalg.cholesky(covariance)
    pulls, shares, apart = [], [], []
    for _ in range(200):
        found, after, share = averaged_over_ripple(
            truth + half @ rng.normal(size=6), covariance, [1, 2], [2]
        )
        pulls.append((found - truth)[:4] / np.sqrt(np.diag(after)[:4]))
        shares.append(float(share[0]))
        apart.append(math.sqrt(after[2, 2] / covariance[2, 2]))
        np.testing.assert_allclose(after, after.T)
    assert abs(np.mean(pulls)) < 0.2
    assert (np.mean(shares) > 0.9) if probable else (np.mean(shares) < 0.45)
    if probable:
        # All the cost of telling both apart is paid.
        assert 0.9 < np.std(pulls) < 1.1
        assert np.mean(apart) == pytest.approx(1.0, abs=0.02)
    else:
        assert 0.7 < np.std(pulls) < 1.15
        assert np.mean(apart) < 0.8


def test_the_average_over_ripple_by_draws_of_its_size() -> None:
    """The first two moments of the mixture, one size after the other."""
    covariance = np.array([[2.0, 0.3, 1.2, 0.1], [0.3, 2.2, 0.2, 1.1],
                           [1.2, 0.2, 1.5, 0.0], [0.1, 1.1, 0.0, 1.4]])  # fmt: skip
    unknowns = np.array([3.0, -1.0, 2.0, 1.0])
    scale = math.sqrt(0.5 * (1.5 + 1.4))
    sizes = np.concatenate([[0.0], scale * np.logspace(-1.0, 4.0, 61)])
    block = covariance[2:, 2:]
    weights, means = [], []
    for k, size in enumerate(sizes):
        total = block + size**2 * np.eye(2)
        chi = unknowns[2:] @ np.linalg.solve(total, unknowns[2:])
        prior = 0.5 if k == 0 else 0.5 / 61
        weights.append(prior * math.exp(-0.5 * chi) / math.sqrt(np.linalg.det(total)))
        means.append(covariance[:2, 2:] @ np.linalg.solve(total, unknowns[2:]))
    weights = np.array(weights) / sum(weights)
    means = np.array(means)
    mean_inverse = sum(
        w * 0.5 * np.trace(np.linalg.inv(block + s**2 * np.eye(2)))
        for w, s in zip(weights, sizes, strict=True)
    )
    precision = max(1.0 / mean_inverse - scale**2, 0.0)
    gain = np.linalg.solve(block + precision * np.eye(2), covariance[2:])
    after = covariance - covariance[:, 2:] @ gain
    spread = means - weights @ means
    after[:2, :2] += (weights[:, None] * spread).T @ spread
    found, covariances, share = averaged_over_ripple(unknowns, covariance, [4], [4])
    np.testing.assert_allclose(found, unknowns - gain.T @ unknowns[2:], rtol=1e-9)
    np.testing.assert_allclose(covariances, after, rtol=1e-9)
    assert share[0] == pytest.approx(weights[sizes > scale].sum())
    # Of ripple at an order that is no pattern's there is no spread.
    other = averaged_over_ripple(unknowns, covariance, [5], [4])[1]
    np.testing.assert_allclose(other[:2, :2], (covariance - covariance[:, 2:] @ gain)[:2, :2])


def test_the_spectrum_is_a_sum_over_readings() -> None:
    rng = np.random.default_rng(6)
    theta, e = rng.uniform(-20.0, 20.0, 5000), rng.normal(size=5000)
    orders = np.array([1.0, 3.37, 8.0, 7.63, 3.0])
    direct = [2.0 * abs(np.sum(e * np.exp(-1j * k * theta))) ** 2 / (e @ e) for k in orders]
    np.testing.assert_allclose(spectrum_at(theta, e, orders), direct, rtol=1e-9)
    assert spectrum_at(theta, np.zeros(5000), orders).tolist() == [0.0] * 5
    white = spectrum_at(theta, e, np.arange(1.0, 400.0))
    assert white.mean() == pytest.approx(2.0, rel=0.25)


def test_loud_noise_beside_an_order_is_told() -> None:
    rng = np.random.default_rng(7)
    theta = np.linspace(0.0, 2.0 * np.pi * 40.0, 8000)
    white = rng.normal(size=8000)
    band = sum(
        rng.normal() * np.cos(k * theta) + rng.normal() * np.sin(k * theta)
        for k in np.arange(4.5, 5.5, 0.025)
    )
    loud = white + 0.3 * band
    found = louder_beside(theta, loud, [2.0, 5.0], np.ones(2))
    assert found[0] < 3.0
    assert found[1] > 20.0
    # What is known already is not counted twice.
    assert louder_beside(theta, loud, [2.0, 5.0], found)[1] == found[1]
    # Once in a thousand orders, as the level says: of 300 more than four once in a million.
    every = list(range(1, 301))
    assert (louder_beside(theta, white, every, np.ones(300)) != 1.0).sum() <= 4


def test_patterns_are_their_sines() -> None:
    theta = np.linspace(-4.0, 9.0, 60)
    c = np.array([1e-3, -2e-3, 0.5e-3, 4e-4])
    rows = np.stack([f(k * theta) for k in (1, 3) for f in (np.cos, np.sin)])
    np.testing.assert_allclose(harmonic_rows(theta, [1, 3]), rows, atol=1e-12)
    np.testing.assert_allclose(pattern_series([1, 3], c, theta), c @ rows, atol=1e-12)
    np.testing.assert_allclose(harmonic_sum(theta, [1, 3], c), c @ rows, atol=1e-12)
    np.testing.assert_allclose(pattern_model([1, 3], c).error(theta), c @ rows, atol=1e-12)
    lead, factor = np.linspace(-1.0, 1.0, 60), np.linspace(0.5, 2.0, 60)
    led = np.stack([f(k * theta + lead / k) for k in (1, 3) for f in (np.cos, np.sin)]) * factor
    np.testing.assert_allclose(
        harmonic_rows(theta, [1, 3], factor=factor, lead=lead), led, atol=1e-12
    )
    np.testing.assert_allclose(
        harmonic_sum(theta, [1, 3], c, factor=factor, lead=lead), c @ led, atol=1e-12
    )
    assert not pattern_series([], np.zeros(0), theta).any()
    assert pattern_model([], np.zeros(0)).shafts == ()
    fine = np.linspace(0.0, 2.0 * np.pi, 20_001)
    slope = np.gradient(pattern_series([1, 3], c, fine), fine)
    assert np.abs(slope).max() * 0.999 <= pattern_steepness([1, 3], c) <= np.abs(slope).max() * 1.5


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi, 1.0, 4096.0])
def test_a_model_has_the_orders_of_both_shafts_in_every_unit(period: float) -> None:
    motor = (50.0, [OrderEstimate(50.0, 1.0, 2.0, 0.3, 1.0, 1.0)])
    recordings = [Recording("a"), Recording("b")]
    model = reference_free_model(
        [order(3.0), order(1.0, 6.0, 8.0)], "dual", ["zero: unseen"], ["one note", "another"],
        recordings, readings=77, noise=1e-5, period=period, motor=motor,
    )  # fmt: skip
    assert isinstance(model, HarmonicModel)
    unit = period / 1_296_000.0
    output, fast = model.shafts
    assert (output.orders, fast.orders, fast.cycles_per_turn) == ((1, 3), (1,), 50.0)
    np.testing.assert_allclose(np.array(output.cosine) / unit, [6.0, 3.0])
    np.testing.assert_allclose(np.array(output.sine) / unit, [8.0, 4.0])
    np.testing.assert_allclose([fast.cosine[0] / unit, fast.sine[0] / unit], [1.0, 2.0])
    expected = np.array([0.0, 0.5, 0.5, 0.5, 0.5, 0.3, 0.3]) ** 2
    np.testing.assert_allclose(model.covariance / unit**2, np.diag(expected), atol=1e-12)
    record = model.fit
    assert record is not None
    assert (record.samples, record.runs, record.span) == (77, 2, (0.0, period))
    assert record.residual / period == pytest.approx(1e-5 / (2.0 * math.pi))
    assert record.calibrated_without_reference
    assert record.note == "One note. Another."
    alone = reference_free_model([], "heads", [], [], recordings, readings=1, noise=0.0,
                                 period=period, motor=motor, span=(0.0, 0.5 * period))  # fmt: skip
    assert [s.name for s in alone.shafts] == ["motor"]
    assert alone.fit.span == (0.0, 0.5 * period)


def test_a_pattern_that_no_encoder_has_is_refused_without_an_advice_for_fits() -> None:
    """Order 3 of 1/3 rad has the slope 1; the message neither names an argument of a fit."""
    steep = [order(3.0, 0.5 * ARCSEC, 0.0)]
    with pytest.raises(NotInvertibleError, match=r"encoder: its slope reaches 1\.5") as told:
        reference_free_model(
            steep, "heads", [], [], [Recording("a")], readings=9, noise=0.0, period=360.0
        )
    assert told.value.slope == pytest.approx(1.5)
    assert "argument" not in str(told.value)


def test_a_summary_tells_every_number() -> None:
    assert order_ranges([]) == ""
    assert order_ranges([5, 1, 2]) == "1, 2, 5"
    assert order_ranges([1, 2, 3, 7.3, 8, 9, 10]) == "1 to 3, 7.3, 8 to 10"
    assert blind_words([0.0]) == "zero"
    assert blind_words([1.0, 2.0, 3.0]) == "orders 1 to 3"
    tests = {"a": HeldOutPattern("odd turns", "even turns", 9.0, 2.0, 0.5),
             "b": HeldOutPattern("forward", "backward", 9.0, 2.0, 0.0005)}  # fmt: skip
    result = SelfCalibration(
        "dual", pattern_model([], np.zeros(0)), (order(1.0),), (), (Blind((2.0, 3.5), "x", "y"),),
        tests, ("careful",), 1.5, 900, 12.34,
    )  # fmt: skip
    text = result.summary("arcsec")
    told = " ".join(text.split())
    assert "dual without a reference: 900 readings, 12.3 turns, noise 1.5" in told
    assert "1.20" in text
    assert "0.800" in text
    assert "odd turns predict even turns: 9" in text
    assert "they agree (p = 0.5)" in text
    assert "forward predicts backward: 9" in text
    assert "they DISAGREE (p = 0.0005)" in told
    assert "note: careful" in text
    assert "orders 2, 3.5: x" in text
    assert "  source" not in text
    assert "due to the encoder and another" not in text
    named = SelfCalibration(
        "dual", result.model, (), (OrderEstimate(1.0, 3.0, 4.0, 0.5, 0.8, 1.2, "both"),),
        (), {}, (), 1.5, 900, 12.34,
    ).summary("arcsec")  # fmt: skip
    assert "due to the encoder and another" in named
    assert "both" in named
    assert result.to_dict()["blind"][0]["orders"] == [2, 3.5]
