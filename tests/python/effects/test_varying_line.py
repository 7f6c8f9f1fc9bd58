"""Lines that follow speed or load: which are looked for, what they pay, and what is told."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import VaryingLine
from trueangle.effects.channel_skew import skewed_order
from trueangle.effects.varying_line import _resolved
from trueangle.estimation.lines import plausible_orders
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import line_columns
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Joint, RunDesign, Simulation

Array = np.ndarray
SEED = 80_000
JOINT = Joint(7.0)


def signals_of(turns: float = 1.3, loads: tuple[float, ...] = (-4.0, 3.0, 6.0)) -> Signals:
    """Both directions, three speeds, loads."""
    designs = [
        RunDesign(
            samples=160,
            turns=turns,
            start_deg=41.0 * k,
            direction=1 if k % 2 else -1,
            speed_deg_s=(4.0, 11.0, 30.0)[k % 3],
            torque_Nm=loads[k % len(loads)] if loads else 0.0,
        )
        for k in range(6)
    ]
    sim = Simulation(JOINT, sigma_arcsec=1.0, runs=tuple(designs))
    return join_runs(ta.simulate(sim, 3))


def regression_of(signals: Signals, error: Array | float) -> Regression:
    print(f"seed {SEED}")
    noise = np.random.default_rng(SEED).standard_normal(len(signals))
    surroundings = Simulation(JOINT).surroundings
    return Regression.of(signals, noise + error, surroundings, rho=0.0)


def signal_of(effect: VaryingLine, signals: Signals) -> Array:
    return effect.signal(signals, Simulation(JOINT).surroundings, np.random.default_rng(0))


def asked(signals: Signals) -> list[tuple[float, str]]:
    """Orders and what they follow, but those that a narrower cause has."""
    orders = plausible_orders(JOINT)
    gear = {JOINT.output_order(shaft, k) for shaft, k in JOINT.gear_orders()}
    narrower = {(skewed_order(JOINT), "velocity"), (1.0, "torque")} | {(m, "torque") for m in gear}
    follows = ["speed", "velocity"] + ["torque"] * bool(np.ptp(signals.torque) > 0.0)
    return [(m, x) for x in follows for m in orders if (m, x) not in narrower]


@pytest.mark.parametrize("loads", [(-4.0, 3.0, 6.0), (3.0,)])
@pytest.mark.parametrize("follows", ["speed", "velocity", "torque"])
def test_a_line_that_varies_is_found_among_all_that_no_narrower_cause_has(
    follows: str, loads: tuple[float, ...]
) -> None:
    """It pays for two numbers and for the search; as one of eight beside every narrow cause."""
    signals = signals_of(loads=loads)
    if follows == "torque" and len(loads) == 1:
        return
    hidden = VaryingLine(5.0, follows, 2.0 if follows == "torque" else 0.4, 30.0)
    regression = regression_of(signals, signal_of(hidden, signals))
    found = VaryingLine.propose(regression)
    assert found is not None
    assert found.shape == {"order": 5.0, "follows": follows}
    assert found.parameters == 2
    assert found.log_grid == pytest.approx(np.log(8.0 * len(asked(signals))))
    # It saves what it saves beside the line as it is, which comes first, or less.
    y = regression.residual
    steady = np.hstack([regression.base, line_columns(signals.theta, 5.0)])

    def left(design: Array) -> float:
        rest = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
        return float(rest @ rest)

    beside = len(y) * np.log(left(steady) / left(np.hstack([steady, found.columns])))
    alone = len(y) * np.log(
        left(regression.base) / left(np.hstack([regression.base, found.columns]))
    )
    assert found.deviance == pytest.approx(min(beside, alone), rel=1e-6)
    # There are two at most.
    regression = regression.with_terms([found, found])
    assert VaryingLine.propose(regression) is None


@pytest.mark.parametrize("order", [1.0, 2.0, 5.0, 7.0, 14.0])
@pytest.mark.parametrize("follows", ["speed", "velocity", "torque"])
def test_what_a_narrower_cause_has_is_left_to_it(order: float, follows: str) -> None:
    """A skew of channels follows the signed speed, a spring and a gear's lines the load."""
    signals = signals_of()
    hidden = VaryingLine(order, follows, 2.0 if follows == "torque" else 0.4, 30.0)
    found = VaryingLine.propose(regression_of(signals, signal_of(hidden, signals)))
    assert found is not None
    is_found = (found.shape["order"], found.shape["follows"]) == (order, follows)
    assert is_found == ((order, follows) in asked(signals))


def test_a_line_that_does_not_vary_is_no_varying_one() -> None:
    signals = signals_of()
    steady = line_columns(signals.theta, 5.0) @ np.array([30.0, -20.0])
    found = VaryingLine.propose(regression_of(signals, steady))
    assert found is not None
    assert found.bic_gain < 0.0


@pytest.mark.parametrize("turns", [1.0, 0.95, 0.7, 0.3])
def test_over_a_part_of_a_turn_lines_are_those_that_are_told_apart(turns: float) -> None:
    """A whole period or more, and half of one from what the motor has itself."""
    signals = signals_of(turns)
    regression = regression_of(signals, 0.0)
    travel = float(signals.run_turns().max())
    assert travel == pytest.approx(turns, abs=0.02)
    own = [
        m for m in plausible_orders(JOINT) if (JOINT.name_order(m) or ("output",))[0] != "output"
    ]
    assert {7.0, 14.0} <= {*own}
    wanted = plausible_orders(JOINT)
    if turns < 0.9:
        wanted = [
            m
            for m in wanted
            if m * travel > 1.0 and (m in own or all(abs(m - x) * travel >= 0.5 for x in own))
        ]
    assert _resolved(regression).tolist() == wanted


def test_numbers_of_lines_are_told_with_their_own_errors() -> None:
    """C sin(mθ + φ) for each unit of what it follows."""
    signals = signals_of()
    hidden = VaryingLine(5.0, "torque", 2.0, 30.0), VaryingLine(3.0, "speed", 0.4, -70.0)
    regression = regression_of(signals, sum(signal_of(effect, signals) for effect in hidden))
    start = regression
    for effect in hidden:
        shape = {"order": effect.order, "follows": effect.follows}
        columns = VaryingLine.columns(signals, regression.around, shape)
        term = start.propose(VaryingLine.kind, shape, columns)
        regression = regression.with_terms([*regression.terms, term])
    design = np.hstack([regression.base, *(term.columns for term in regression.terms)])
    covariance = np.linalg.inv(design.T @ design)
    fits = [(term, c, regression.covariance(k)) for k, (term, c) in enumerate(regression.fitted())]
    for terms, names in ((fits, hidden), (fits[1:], hidden[1:])):
        told, effects = VaryingLine.report(regression, terms)
        one = len(names) == 1
        assert told["order"].value == (3.0 if one else [5.0, 3.0])
        assert told["factor"].value == ("speed" if one else ["torque", "speed"])
        for k, effect in enumerate(names):
            at = regression.base.shape[1] + 2 * (hidden.index(effect))
            a, b = terms[k][1]
            spread = covariance[at : at + 2, at : at + 2]
            size = float(np.hypot(a, b))
            std = float(np.sqrt(np.array([a, b]) @ spread @ np.array([a, b]))) / size
            turn = float(np.sqrt(np.array([b, -a]) @ spread @ np.array([b, -a]))) / size**2
            amplitudes, phases = told["coefficients"], told["phases_deg"]
            assert amplitudes.value[k] == pytest.approx(size)
            assert amplitudes.std[k] == pytest.approx(std, rel=0.1)
            assert phases.std[k] == pytest.approx(np.degrees(turn), rel=0.1)
            assert abs(amplitudes.value[k] - effect.amplitude_arcsec) < 4.0 * std
            away = (phases.value[k] - effect.phase_deg + 180.0) % 360.0 - 180.0
            assert abs(away) < 4.0 * np.degrees(turn)
            assert effects[k] == VaryingLine(
                effect.order, effect.follows, amplitudes.value[k], phases.value[k]
            )
