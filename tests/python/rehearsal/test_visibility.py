"""How much of an effect readings could show: by what it adds to the noise, in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.rehearsal import visibility
from trueangle.rehearsal.visibility import DOWN, FIRST, NEAR, STEPS, UP, _deviance, size_range
from trueangle.simulation import (
    Backlash,
    HeteroscedasticNoise,
    RunDesign,
    Simulation,
    simulate,
)

N = 720


def believed(sigma: float = 2.0, samples: int = N) -> Simulation:
    return Simulation(
        sigma_arcsec=sigma,
        runs=(RunDesign(label="a", turns=2.0, samples=samples, reversals=(0.5,)),),
    )


def regression_of(sim: Simulation) -> Regression:
    signals = join_runs(simulate(sim, seed=1))
    return Regression.of(signals, np.zeros(len(signals)), sim.surroundings)


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_play_shows_as_the_square_of_its_half_width_in_the_noise(sigma: float) -> None:
    """As many readings either way: n h^2 / sigma^2."""
    sim = believed(sigma)
    regression = regression_of(sim)
    way = np.sign(np.asarray(regression.signals.direction))
    about = float(((way - way.mean()) ** 2).sum())
    found = _deviance(Backlash(3.0), regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(about * 9.0 / sigma**2, rel=0.02)


def test_noise_that_varies_shows_as_half_the_variance_of_its_logarithm() -> None:
    """Fisher's information of the logarithm of a variance is a half for every reading."""
    sim = believed()
    regression = regression_of(sim)
    kind = EFFECTS["heteroscedastic_noise"]
    assert kind is HeteroscedasticNoise
    effect = kind.drawn(1.0, regression.signals, sim.surroundings, np.random.default_rng(2))
    factor = effect.noise_factor(regression.signals, sim.surroundings)
    found = _deviance(effect, regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(0.5 * N * np.var(np.log(factor**2)), rel=1e-9)


@pytest.mark.parametrize("sigma", [0.5, 2.0])
def test_what_the_writing_changes_shows_as_its_energy(sigma: float) -> None:
    """Every reading written an arcsec off: n / sigma^2, whatever the noise."""
    sim = believed(sigma)
    regression = regression_of(sim)
    made = SimpleNamespace(
        signal=lambda signals, around, rng: np.zeros(len(signals)),
        written=lambda degrees: degrees + np.resize([1.0, -1.0], degrees.size) / 3600.0,
        noise_factor=lambda signals, around: None,
    )
    found = _deviance(made, regression, np.random.default_rng(1), sim)
    assert found == pytest.approx(N / sigma**2, rel=1e-6)


@pytest.mark.parametrize(("sigma", "samples"), [(0.5, 720), (2.0, 720), (2.0, 180)])
def test_the_first_size_of_play_and_the_range_about_it(sigma: float, samples: int) -> None:
    sim = believed(sigma, samples)
    signals = join_runs(simulate(sim, seed=1))
    sizes = size_range(sim, signals, "backlash", 3)
    assert sizes is not None
    first = np.sqrt(FIRST / samples) * sigma
    assert sizes.first == pytest.approx(first, rel=np.sqrt(NEAR) - 1.0 + 0.02)
    assert sizes.lowest == np.log2(DOWN) * STEPS
    # Up to thirty times the noise of a reading.
    top = np.log2(UP * np.sqrt(samples / FIRST)) * STEPS
    assert sizes.highest == int(np.floor(top))
    assert sizes.grows
    assert sizes.size(STEPS) == pytest.approx(2.0 * sizes.first)
    assert sizes.size(-STEPS) == pytest.approx(0.5 * sizes.first)


def test_blind_is_a_cause_whose_naming_would_be_a_guess(monkeypatch: pytest.MonkeyPatch) -> None:
    """None whose form all share, none that is never doubted; of two reasons the first."""
    spots = [
        Ambiguity(("backlash", "latency"), "one", "measure", common="backlash"),
        Ambiguity(("latency", "missing_order", "scale_error"), "two", "measure"),
    ]
    monkeypatch.setattr(visibility, "blind_spots", lambda regression: spots)
    sim = believed()
    found = visibility.blind_causes(sim, join_runs(simulate(sim, seed=1)))
    assert {cause: spot.because for cause, spot in found.items()} == {
        "latency": "one", "scale_error": "two"
    }  # fmt: skip
