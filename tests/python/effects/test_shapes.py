"""What is remembered of an effect's columns is that of the pattern that they follow."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.holdout import HoldOutModel, residual_at_held_out
from trueangle.effects import EFFECTS, Effect, MissingOrder, ThermalDrift
from trueangle.effects.shapes import best_shape
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import JointPattern, Pattern
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Harmonic, Joint, Simulation

from .test_stated_errors import NOISE, SIM

SEED = 71_900

#: A line of the error itself that the simulation lacks; the pattern grows with temperature.
LINE, GROWTH = MissingOrder("output", 7, 20.0, 70.0), 3.0

Start = Callable[[], Regression]


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


@pytest.fixture(scope="module")
def start(signals: Signals) -> Start:
    """Regressions without terms that have nothing in common but their numbers."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    line = LINE.signal(signals, SIM.surroundings, rng)
    pattern = SIM.surroundings.pattern.value(signals.theta) + line
    scale = ThermalDrift.scale(signals, "signed")
    assert scale is not None
    grown = GROWTH * scale * pattern / 30.0
    error = line + grown + NOISE * rng.standard_normal(len(signals))
    return lambda: Regression.of(signals, error, SIM.surroundings, rho=0.0)


def with_line(regression: Regression) -> Regression:
    return regression.with_terms([MissingOrder.at(regression, 7.0)])


@pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)
def test_what_was_asked_before_changes_no_proposal(effect: type[Effect], start: Start) -> None:
    """Of one motion, beside another pattern: as if nothing had been asked."""
    asked = start()
    effect.propose(asked)
    warm, cold = effect.propose(with_line(asked)), effect.propose(with_line(start()))
    assert (warm is None) == (cold is None)
    if warm is not None and cold is not None:
        assert warm.shape == cold.shape
        assert warm.deviance == pytest.approx(cold.deviance, rel=1e-9)
        np.testing.assert_allclose(warm.coefficients, cold.coefficients, rtol=1e-9, atol=1e-12)


def test_the_best_of_many_shapes_is_that_of_the_most_evidence(start: Start) -> None:
    """Asked one by one, with what each pays for its columns, its search and what else it has."""
    regression = with_line(start())
    shapes: list[dict[str, Any]] = [
        {"what": "zero"},
        {"what": "pattern"},
        {"what": "line", "order": 100.0},
    ]
    own = [
        regression.propose(
            ThermalDrift.kind,
            shape,
            ThermalDrift.columns(regression.signals, regression.around, shape),
        )
        for shape in shapes
    ]
    gains, coefficients = [term.bic_gain for term in own], [term.parameters for term in own]
    assert coefficients == [1, 1, 2]
    assert int(np.argmax(gains)) == 1
    for k in range(3):
        # What has so much less evidence for its search, or for what else it has, is not taken.
        for less in (0.98, 1.02):
            ahead = [max(gain - gains[k], 0.0) for gain in gains]
            grids = [0.5 * less * gain for gain in ahead]
            found = best_shape(ThermalDrift, regression, shapes, grids)
            assert found is not None
            assert (found.shape == shapes[k]) == (less > 1.0 or max(ahead) == 0.0)
            place = shapes.index(found.shape)
            assert found.log_grid == grids[place]
            assert found.bic_gain == pytest.approx(gains[place] - 2.0 * grids[place], rel=1e-9)
            extra = [2 + int(np.ceil(1.02 * gain / regression.log_n)) for gain in ahead]
            found = best_shape(ThermalDrift, regression, shapes, [0.0] * 3, extra)
            assert found is not None
            assert found.shape == shapes[k]
            assert found.parameters == coefficients[k] + extra[k]
    assert best_shape(ThermalDrift, regression, [], []) is None


#: Of every effect whose columns a held-out reading has, a shape of it.
SHAPES: dict[str, dict[str, Any]] = {
    "thermal_drift": {"what": "pattern"},
    "latency": {},
    "argument_error": {},
    "filter_lag": {"cutoff_hz": 20.0, "damping": None},
    "sidebands": {"carrier": 100.0, "offset": 1, "form": "AM"},
    "load_dependent_gear_error": {"what": "line", "order": 100.0, "kind": "signed"},
    "reference_error": {"order": 3.0, "mount_sign": 1.0},
    "missing_order": {"output_order": 7.0},
    "stiffening_compliance": {"power": 3, "gravity_deg": None},
    "direction_dependent_pattern": {"order": 2.0},
    "varying_line": {"order": 7.0, "follows": "speed"},
}


@pytest.mark.parametrize("cause", SHAPES)
def test_every_law_has_the_columns_of_its_own_pattern(cause: str, signals: Signals) -> None:
    """Of a term that laws around unlike patterns share; of motion alone they are the same."""
    effect, shape = EFFECTS[cause], SHAPES[cause]
    arounds: list[JointPattern] = [
        Simulation(Joint(50.0, "circular_spline", "motor"), (Harmonic("motor", 2, size, 248.0),))
        .surroundings for size in (10.0, 4000.0)
    ]  # fmt: skip
    term = Extension(cause, shape, np.zeros((0, 0)), 1)
    columns = [effect.columns(signals, around, shape) for around in arounds]
    assert effect.of_motion == np.array_equal(columns[0], columns[1])
    size = np.full(columns[0].shape[1], 2.5)
    base = np.ones((len(signals), 1))
    shared: dict[Extension, np.ndarray] = {}
    for around, own in zip(arounds, columns, strict=True):
        law = HoldOutModel(np.array([4.0]), [(term, size)], around)
        left = residual_at_held_out(law, signals, base, 3.0 * base[:, 0], False, shared)
        expected = (-1.0 - own @ size) if effect.transfers else np.full(len(signals), -1.0)
        np.testing.assert_allclose(left, expected, atol=1e-9)


def test_a_pattern_is_its_orders_and_both_halves_of_its_lines(start: Start) -> None:
    """What is remembered of a pattern is not taken for another's, whatever differs."""
    regression = start()
    counts = itertools.count()

    def remembered(pattern: Pattern) -> int:
        other = regression.with_terms([])
        object.__setattr__(other, "around", JointPattern(regression.around.joint, pattern))
        return other.of_pattern("name", 1, lambda: next(counts))

    pattern = regression.around.pattern
    parts = (pattern.orders, pattern.cosine, pattern.sine)
    for k in range(3):
        count = remembered(pattern)
        assert remembered(Pattern(*(part.copy() for part in parts))) == count
        changed = [part + 1.0 * (j == k) for j, part in enumerate(parts)]
        assert remembered(Pattern(*changed)) == count + 1
