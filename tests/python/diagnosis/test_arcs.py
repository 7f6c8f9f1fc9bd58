"""Over less than a turn low orders and a ramp are nearly one another: errors say so."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.unseenorders import with_unseen_orders
from trueangle.effects.missing_order import MissingOrder
from trueangle.effects.scale_error import ScaleError
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, Simulation

SEED = 59_300
BELIEVED = Simulation(sigma_arcsec=5.0)


def swept(rng: np.random.Generator, turns: float, orders: tuple[int, ...], scale: float):
    """There and back over an arc: lines of 10 to 200 arcsec, a ramp, noise of 5; and the lines."""
    sizes, phases = rng.uniform(10.0, 200.0, len(orders)), rng.uniform(0.0, 6.28, len(orders))
    start = rng.uniform(0.0, 360.0)
    way = np.linspace(0.0, 360.0 * turns, 400)
    runs = []
    for x in (way, way[::-1]):
        place = np.radians(x + start)
        waves = np.sin(np.multiply.outer(orders, place) + phases[:, None])
        error = scale * x + (sizes @ waves + rng.normal(0.0, 5.0, x.size)) / 3600.0
        time = np.arange(x.size) / 20.0
        runs.append(ta.CalibrationRun(x + start, x + start + error, period=360.0, time=time))
    return runs, dict(zip(orders, sizes, strict=True))


@pytest.mark.parametrize("scale", [0.0, 300e-6])
@pytest.mark.parametrize("orders", [(1, 2), (1, 2, 3, 5)], ids=str)
@pytest.mark.parametrize("turns", [0.45, 0.6, 0.8, 1.2])
def test_what_is_confirmed_is_as_uncertain_as_it_is_wrong(turns, orders, scale):
    """It had been of the orders chosen: off by 50 standard errors over half a turn."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, int(100 * turns), len(orders), int(scale > 0.0)])
    pulls, confirmed = [], 0
    for _ in range(6):
        runs, lines = swept(rng, turns, orders, scale)
        result = ta.diagnose(runs, BELIEVED, within=60.0)
        lines_named = any(f.cause == "missing_order" for f in result.findings)
        told = any("smallest set of orders that fits" in note for note in result.notes)
        assert told == (turns < 0.9 and lines_named)
        for finding in result.findings:
            given = finding.parameters
            if not finding.confirmed:
                continue
            confirmed += 1
            if finding.cause == "missing_order":
                truth = lines.get(int(given["order"].value))
                size = given["amplitude_arcsec"]
                pulls.append((size.value - (truth or 0.0)) / size.std)
            elif finding.cause == "scale_error":
                size = given["relative_error"]
                pulls.append((size.value - scale) / size.std)
    print(turns, orders, scale, np.round(pulls, 2), confirmed)
    assert np.abs(pulls).max(initial=0.0) < 6.0
    assert confirmed >= (4 if turns > 0.7 else 2)


def found_in(turns: float, error: dict[float, float], ramp: float = 0.0) -> Regression:
    """What is found of lines of some sizes over some turns, and of a ramp in arcsec a radian."""
    theta = np.linspace(0.5, 0.5 + 2.0 * np.pi * turns, 400)
    signals = join_runs([ta.CalibrationRun(theta, theta)])
    lines = sum(size * np.sin(k * theta + 0.3) for k, size in error.items())
    error_of_all = lines + ramp * theta + np.random.default_rng(SEED).normal(size=theta.size)
    regression = Regression.of(signals, error_of_all, BELIEVED.surroundings, rho=0.0)
    for effect in [ScaleError] * bool(ramp) + [MissingOrder] * len(error):
        found = effect.propose(regression)
        assert found is not None
        regression = regression.with_terms([*regression.terms, found])
    assert {t.shape.get("output_order") for t in regression.terms} - {None} == {*error}
    return regression


@pytest.mark.parametrize(("turns", "more", "ramp"), [(0.5, {}, 0.0), (0.8, {40.0: 50.0}, 900.0)])
def test_other_orders_than_those_found_count_by_their_evidence(turns, more, ramp):
    """Slow: every model of orders 1 to one more than the highest, by the covariance of readings."""
    found, low = found_in(turns, {2.0: 80.0} | more, ramp), 2
    theta = found.signals.theta
    groups = {k: np.column_stack([np.cos(k * theta), np.sin(k * theta)]) for k in (1, 2, 3)}
    groups[0] = theta[:, None] / theta.std()
    other = [t for t in found.terms if t.shape.get("output_order") == 40.0]
    beside = np.hstack([np.ones((theta.size, 1)), *(t.columns for t in other)])
    tau = np.std(sum(t.columns @ c for t, c in found.fitted() if t not in other))
    logs, means, variances = [], [], []
    models = [m for n in range(len(groups) + 1) for m in itertools.combinations(groups, n)]
    for model in models:
        drawn = np.hstack([*(tau * groups[k] for k in model), 1e4 * beside])  # as good as free
        whole = found.variance * np.eye(theta.size) + drawn @ drawn.T
        weighed = np.linalg.solve(whole, np.column_stack([found.residual, groups[low]]))
        logs.append(-0.5 * (np.linalg.slogdet(whole)[1] + found.residual @ weighed[:, 0]))
        size = tau**2 * (low in model)
        means.append(size * groups[low].T @ weighed[:, 0])
        variances.append(size - size**2 * np.diag(groups[low].T @ weighed[:, 1:]))
    weights = np.exp(np.array(logs) - np.logaddexp.reduce(logs))
    (k,) = [k for k, t in enumerate(found.terms) if t.shape.get("output_order") == low]
    own = variances[[set(m) for m in models].index({low, 0} if ramp else {low})]
    off = np.array(means) - found.coefficients[found.place(k)]
    wanted = weights @ off**2 + np.maximum(weights @ (np.array(variances) - own), 0.0)
    given = np.diag(with_unseen_orders(found).form_errors)[found.place(k)]
    np.testing.assert_allclose(given, wanted, rtol=1e-3, atol=1e-3 * found.variance)


def test_nothing_is_in_the_place_of_an_order_over_a_whole_turn_or_of_many_cycles():
    for whole in (found_in(0.9, {2.0: 80.0}), found_in(0.6, {40.0: 50.0})):
        assert with_unseen_orders(whole) is whole


def arc_runs(rng, error, span: float, runs: int = 3, readings: int = 350):
    """There and back over an arc from 30 deg on, in noise of 1 arcsec."""
    found = []
    for _ in range(runs):
        time = np.sort(rng.uniform(0.0, 2.0, readings))
        theta = 30.0 + span * (1.0 - np.abs(1.0 - time))
        measured = theta + (error(theta) + rng.normal(0.0, 1.0, readings)) / 3600.0
        found.append(ta.CalibrationRun(theta, measured, period=360.0, time=5.0 * time))
    return found


@pytest.mark.parametrize("span", [95.0, 140.0])
@pytest.mark.parametrize("refuted", [False, True])
@pytest.mark.parametrize("smooth", [0.0, 5.0])
def test_over_an_arc_a_belief_that_may_be_right_stays_and_the_rest_is_a_curve(
    span, smooth, refuted
):
    """A cubic beside a right belief had made the belief wrong, and the correction with it."""
    rng = np.random.default_rng([71, int(span), int(smooth), refuted])
    believed = Simulation(
        Joint(1.0, "none"), (Harmonic("output", 1, 40.0, 70.0),), sigma_arcsec=1.0
    )
    middle = 30.0 + 0.5 * span

    def error(theta):
        size, phase = (52.0, 85.0) if refuted else (40.0, 70.0)
        order = size * np.sin(np.radians(theta + phase))
        return order + smooth * ((theta - middle) / (0.5 * span)) ** 3

    found = ta.diagnose(arc_runs(rng, error, span), believed)
    if not refuted:
        assert [belief.verdict for belief in found.beliefs] == ["confirmed"]
    theta = np.linspace(30.0, 30.0 + span, 200)
    fresh = ta.CalibrationRun(theta, theta, period=360.0)
    left = error(theta) - found.extended.predict(fresh)
    assert np.std(left) < 0.2
    if smooth and not refuted:
        assert {factor.factor for factor in found.factors} == {"place"}
        assert not any(finding.confirmed for finding in found.findings)
