"""Noise that follows angle, speed or load: its blocks, what they pay, and each number's place."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import HeteroscedasticNoise
from trueangle.effects.heteroscedastic_noise import noise_blocks
from trueangle.effects.noiselaw import SQUARE_CLIP, noise_law, standardised_residuals
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Joint, RunDesign, Simulation

Array = np.ndarray
SEED = 81_000


def signals_of(loads: tuple[float, ...] = (0.0, 2.0, 4.0)) -> Signals:
    designs = [
        RunDesign(
            samples=250,
            turns=1.7,
            start_deg=41.0 * k,
            direction=1 if k % 2 else -1,
            speed_deg_s=(4.0, 11.0, 30.0)[k % 3],
            torque_Nm=loads[k // 3 % len(loads)],
        )
        for k in range(9)
    ]
    return join_runs(ta.simulate(Simulation(sigma_arcsec=1.0, runs=tuple(designs)), 3))


def regression_of(signals: Signals, joint: Joint, effect: HeteroscedasticNoise) -> Regression:
    print(f"seed {SEED}")
    around = Simulation(joint).surroundings
    factor = effect.noise_factor(signals, around)
    assert factor is not None
    noise = factor * np.random.default_rng(SEED).standard_normal(len(signals))
    return Regression.of(signals, noise, around, rho=0.0)


@pytest.mark.parametrize("joint", [Joint(), Joint(7.0), Joint(50.0, "circular_spline", "motor")])
@pytest.mark.parametrize("loads", [(2.0,), (0.0, 2.0, 4.0)])
def test_blocks_are_low_orders_those_of_shafts_speed_and_load(
    joint: Joint, loads: tuple[float, ...]
) -> None:
    """Each pays for its numbers, of which a square tells half, and for as many as are alike."""
    signals = signals_of(loads)
    regression = regression_of(signals, joint, HeteroscedasticNoise())
    shafts = [c for c in {*joint.shafts.values()} if c != 1.0]
    each = regression.log_n - np.log(2.0)
    expected = {f"order {k}": 2.0 * each + 2.0 * np.log(2.0 * k) for k in (1, 2, 3)}
    alike = 8.0 * sum(c != 1.0 for c in joint.shafts.values())
    expected |= {
        f"order {k * c:g}": 2.0 * each + 2.0 * np.log(alike) for c in shafts for k in (1, 2)
    }
    expected["per_deg_s"] = each + 2.0 * np.log(4.0)
    if len(loads) > 1:
        expected["per_Nm"] = expected["per_deg_s"]
    blocks = noise_blocks(regression)
    assert {name: block.penalty for name, block in blocks.items()} == pytest.approx(expected)
    for name, block in blocks.items():
        if name.startswith("order"):
            x = float(name.split()[1]) * signals.theta
            wanted = np.column_stack([np.cos(x), np.sin(x)])
        else:
            values = signals.velocity if name == "per_deg_s" else signals.torque
            assert values is not None
            wanted = np.abs(values)[:, None]
        np.testing.assert_allclose(block.columns, wanted, atol=1e-9)


CASES = [
    HeteroscedasticNoise(0.8, -0.5),
    HeteroscedasticNoise(per_deg_s=0.05, per_Nm=0.35),
    HeteroscedasticNoise(0.7, 0.3, 2.0, per_Nm=-0.4),
    HeteroscedasticNoise(0.9, 0.4, 14.0, per_deg_s=-0.05),
]


@pytest.mark.parametrize("hidden", CASES)
def test_blocks_are_chosen_one_by_one_by_what_they_explain_of_the_squares(
    hidden: HeteroscedasticNoise,
) -> None:
    """n R² of the clipped squares beside those chosen before, less what a block pays, by lstsq."""
    signals = signals_of()
    regression = regression_of(signals, Joint(7.0), hidden)
    blocks = noise_blocks(regression)
    square = np.minimum(standardised_residuals(regression) ** 2, SQUARE_CLIP)

    def left(names: list[str]) -> float:
        columns = [np.ones((regression.n, 1)), *(blocks[name].columns for name in names)]
        design = np.hstack(columns)
        rest = square - design @ np.linalg.lstsq(design, square, rcond=None)[0]
        return float(rest @ rest)

    chosen: list[str] = []
    total = 0.0
    while True:
        gains = {
            name: regression.n * (1.0 - left([*chosen, name]) / left(chosen)) - block.penalty
            for name, block in blocks.items()
            if name not in chosen
        }
        best = max(gains, key=lambda name: gains[name])
        if gains[best] <= 0.0:
            break
        total += gains[best]
        chosen.append(best)
    found = HeteroscedasticNoise.find_scatter(regression)
    assert found is not None
    assert found.blocks == tuple(chosen)
    assert found.bic_gain == pytest.approx(total, rel=1e-6)
    # Each number of the law at its name, with its error; and what is simulated of it.
    law = noise_law(
        standardised_residuals(regression) ** 2,
        np.hstack([np.ones((regression.n, 1)), *(blocks[name].columns for name in chosen)]),
    )
    stds = np.sqrt(np.diag(law.covariance))
    names = []
    for name in chosen:
        suffix = "" if name == "order 1" else f"_{name.removeprefix('order ')}"
        is_order = name.startswith("order")
        names += [f"cosine{suffix}", f"sine{suffix}"] if is_order else [name]
    assert [*found.parameters] == names
    for k, name in enumerate(names, 1):
        entry = found.parameters[name]
        assert (entry.value, entry.std) == pytest.approx((law.coefficients[k], stds[k]))
        true = getattr(hidden, name.split("_")[0] if "sine" in name else name)
        assert abs(entry.value - true) < 4.5 * entry.std
    factor = np.ones(len(signals))
    for effect in found.effects:
        assert isinstance(effect, HeteroscedasticNoise)
        of_effect = effect.noise_factor(signals, regression.around)
        assert of_effect is not None
        factor = factor * of_effect
    # Weights are inverse variances, whatever the noise is on average.
    weights = factor**-2.0
    np.testing.assert_allclose(found.weights, weights / weights.mean(), rtol=1e-6)
