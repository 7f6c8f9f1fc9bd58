"""Effects as a rehearsal draws them: of the size asked for, where the readings can have them."""

from __future__ import annotations

from dataclasses import astuple, replace

import numpy as np
import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.drawing import Drawing
from trueangle.rehearsal.trial import drawn_effect, measured_signals, trial_rng
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

DRAWS = 24
SEED = 17
SIM = Simulation(
    joint=Joint(gear_ratio=30.0),
    harmonics=(Harmonic("output", 1, 40.0, 20.0), Harmonic("motor", 1, 12.0, 70.0)),
    sigma_arcsec=2.0,
    runs=tuple(
        RunDesign(label=name, turns=2.0, samples=240, reversals=(0.5,), speed_deg_s=speed,
                  torque_Nm=torque, gravity_Nm=3.0, temperature_C=temperature)
        for name, speed, torque, temperature in (
            ("a", 10.0, 0.0, 20.0), ("b", 30.0, 4.0, 35.0), ("c", 20.0, -2.0, 28.0),
        )
    ),
)  # fmt: skip
SIGNALS = measured_signals(SIM)
TORQUES = float(np.ptp(SIGNALS.torque))

#: Of what is drawn beside the size: least and greatest.
BETWEEN = {
    ("torque_hysteresis", "span_Nm"): (0.1 * TORQUES, 0.3 * TORQUES),
    ("presliding_hysteresis", "length_deg"): (2.0, 6.0),
    ("local_defect", "width_deg"): (3.0, 8.0),
    ("local_defect", "place_deg"): (0.0, 360.0),
    ("outliers", "fraction"): (0.01, 0.03),
    ("non_integer_order", "order"): (5.3, 39.7),
    ("missed_counts", "run"): (0, 2),
    ("missed_counts", "row"): (0.2 * 240 - 1, 0.8 * 240),
    ("wrong_gear_ratio", "gear_ratio"): (29.0, 31.0),
}

#: Twice the size is no twice the error: noise, a sensor at its other angle, a lag's curve.
CURVED = {
    "argument_error",
    "backlash",
    "filter_lag",
    "heteroscedastic_noise",
    "latency",
    "outliers",
    "stiffening_compliance",
    "wrong_gear_ratio",
}


def drawn(kind, size, number):
    rng = trial_rng(SEED, kind, number)
    return drawn_effect(kind, size, Drawing(SIGNALS, SIM.surroundings, rng)), rng


@pytest.mark.parametrize("kind", list(EFFECTS))
def test_an_effect_is_drawn_within_its_ranges_and_valid(kind):
    print(f"seed {SEED}")
    found = [drawn(kind, 0.5, k)[0] for k in range(DRAWS)]
    assert len({effect is None for effect in found}) == 1
    if found[0] is None:
        return
    assert all(isinstance(effect, EFFECTS[kind]) for effect in found)
    # What cannot be is refused where it is made anew from its parts.
    assert [replace(effect) for effect in found] == found
    for (name, part), (least, most) in BETWEEN.items():
        if name == kind:
            values = [getattr(effect, part) for effect in found]
            assert least <= min(values) <= max(values) <= most
            assert min(values) < max(values)
    if kind == "non_integer_order":
        rests = np.mod([effect.order for effect in found], 1.0)
        assert 0.3 <= rests.min() <= rests.max() <= 0.7


@pytest.mark.parametrize("kind", sorted(set(EFFECTS) - CURVED))
def test_twice_the_size_is_twice_the_error(kind):
    for number in range(3):
        (one, rng), (two, again) = (drawn(kind, size, number) for size in (0.01, 0.02))
        if one is None:
            assert two is None
            return
        errors = [effect.signal(SIGNALS, SIM.surroundings, chance)
                  for effect, chance in ((one, rng), (two, again))]  # fmt: skip
        assert np.isfinite(errors).all()
        assert astuple(one) != astuple(two)
        np.testing.assert_allclose(errors[1], 2.0 * errors[0], rtol=1e-6, atol=1e-9)


def test_a_spring_that_stiffens_is_softer_by_a_quarter_at_the_largest_load():
    for size in (0.02, 0.3):
        effect, rng = drawn("stiffening_compliance", size, 0)
        error = effect.signal(SIGNALS, SIM.surroundings, rng)
        loads = np.abs(SIGNALS.torque)
        k = int(np.argmax(loads))
        assert abs(error[k]) == pytest.approx(0.75 * effect.arcsec_per_Nm * loads[k])
        assert effect.arcsec_per_Nm3 == -size
    # Where no load was recorded there is no error.
    bare = replace(SIGNALS, torque=None)
    free = EFFECTS["stiffening_compliance"].drawn(0.3, Drawing(bare, SIM.surroundings, rng))
    assert not free.signal(bare, SIM.surroundings, rng).any()


def test_what_these_runs_cannot_have_is_not_drawn():
    still = replace(SIM, runs=(RunDesign(label="a", turns=1.0, samples=90),))
    signals = measured_signals(still)
    rng = np.random.default_rng(SEED)
    for kind in ("torque_hysteresis", "joint_coupling"):
        assert drawn_effect(kind, 1.0, Drawing(signals, still.surroundings, rng)) is None
    bare = replace(SIM, harmonics=())
    assert drawn_effect("filter_lag", 1.0, Drawing(SIGNALS, bare.surroundings, rng)) is None
