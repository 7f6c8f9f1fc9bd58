"""The rule by which the angle is chosen, written out: zeros, energies, noise, weights."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.argument import choose_argument
from trueangle.joint.shafts import ShaftOrders

SEED = 46_100
SHAFTS = [ShaftOrders("output", 1.0, (1, 2))]


def runs_of(rng, shift, noise, unit=1.0, weighted=False, count=40):
    """Two runs of a pattern that stays with the reading; the second has its reference moved."""
    runs = []
    for number in range(2):
        said = np.sort(rng.uniform(0.0, 1.0, count))
        wave = 1e-3 * np.sin(2.0 * np.pi * said) + 8e-4 * np.cos(4.0 * np.pi * said + 1.0)
        true = said - wave + noise * rng.normal(size=count) + shift * number
        weights = rng.integers(1, 4, count).astype(float) if weighted else None
        runs.append(ta.CalibrationRun(unit * true, unit * said, unit, weights=weights))
    return runs


def left_and_energy(runs, angle):
    """Weighted squares that zeros and orders 1 and 2 leave, that zeros alone leave, readings."""
    rows, errors, roots, own = [], [], [], 0.0
    for number, run in enumerate(runs):
        x = 2.0 * np.pi * getattr(run, angle) / run.period
        zero = np.zeros((len(run), len(runs)))
        zero[:, number] = 1.0
        rows.append(np.column_stack([zero, *(f(k * x) for k in (1, 2) for f in (np.cos, np.sin))]))
        weight = np.ones(len(run)) if run.weights is None else run.weights
        errors.append(run.centred_error)
        roots.append(np.sqrt(weight))
        about = run.centred_error - np.average(run.centred_error, weights=weight)
        own += float(weight @ about**2)
    root = np.concatenate(roots)
    design, error = np.vstack(rows) * root[:, None], np.concatenate(errors) * root
    rest = error - design @ np.linalg.lstsq(design, error, rcond=None)[0]
    return float(rest @ rest), own, error.size - design.shape[1]


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("unit", [1.0, 360.0, 2.0 * np.pi])
def test_the_angle_is_chosen_by_energies_and_noise(unit, weighted):
    """Own energy 1.05 times and sixty variances more: shifts and noises about the border."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, weighted])
    chosen = {"reference": 0, "indicated": 0}
    for _ in range(60):
        runs = runs_of(rng, rng.uniform(0.01, 0.2), 10.0 ** rng.uniform(-4.0, -2.6), unit, weighted)
        true, energy, _ = left_and_energy(runs, "reference")
        own, _, freedom = left_and_energy(runs, "indicated")
        noise = own / freedom
        gained = energy - own, energy - true
        wanted = gained[0] > 1.05 * gained[1] and gained[0] - gained[1] > 60.0 * noise
        found = choose_argument(runs, "auto", SHAFTS)
        assert found.argument == ("indicated" if wanted else "reference")
        chosen[found.argument] += 1
    assert min(chosen.values()) > 8


@pytest.mark.parametrize("unit", [1.0, 360.0, 2.0 * np.pi, 8192.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_zeros_that_moved_by_less_than_a_fifth_of_a_degree_are_none(sign, unit):
    """From both sides, on a pattern so steep in order that the energies would tell."""
    print("seed", SEED + 1)
    shafts = [ShaftOrders("output", 1.0, (300,))]
    for degrees, moved in ((0.19, False), (0.21, True)):
        runs = []
        for number in range(2):
            said = np.sort(np.random.default_rng(SEED + 1 + number).uniform(0.0, 1.0, 400))
            wave = 1e-5 * np.sin(600.0 * np.pi * said)
            true = said - wave + sign * degrees / 360.0 * number
            runs.append(ta.CalibrationRun(unit * true, unit * said, unit))
        found = choose_argument(runs, "auto", shafts)
        assert found.argument == ("indicated" if moved else "reference")
        if moved:
            assert f"by up to {degrees:.3g} deg" in found.note
