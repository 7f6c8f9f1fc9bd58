"""How much of an effect the readings could show at best, and at which size the search starts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.blindspots import blind_spots
from ..effects.drawing import Drawing
from ..estimation.regression import Regression
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.angles import ARCSEC_PER_DEG
from .trial import drawn_effect, trial_rng

#: Steps of the search in a factor of two of size.
STEPS = 4

#: Deviance that an effect of the first size would explain if its form were known exactly: about
#: twice the penalty of a cause with a few parameters.
FIRST = 40.0

#: Sizes go down to this share of the first, and up to `UP` times the noise.
DOWN, UP = 1.0 / 16.0, 30.0

#: Draws of an effect for which the deviance is averaged.
DRAWS = 4

#: Rounds of the search for the first size, and the factor within which it is met.
ROUNDS, NEAR = 40, 1.2


@dataclass(frozen=True)
class SizeRange:
    """Sizes of a cause to be tried: ``first * 2 ** (k / STEPS)`` of a step k.

    Attributes
    ----------
    first : float
        The size that is tried first.
    lowest, highest : int
        Steps, of growing visibility.
    grows : bool
        It shows the more the larger its size.
    """

    first: float
    lowest: int
    highest: int
    grows: bool

    def size(self, step: float) -> float:
        """The size of a step."""
        return float(self.first * 2.0 ** ((step if self.grows else -step) / STEPS))


def blind_causes(sim: Simulation, signals: Signals) -> dict[str, Ambiguity]:
    """Causes that a diagnosis of such readings does not name, and why."""
    noise = np.random.default_rng(0).standard_normal(len(signals)) * sim.sigma_arcsec
    found: dict[str, Ambiguity] = {}
    for spot in blind_spots(Regression.of(signals, noise, sim.surroundings)):
        for cause in spot.causes:
            if EFFECTS[cause].is_doubted and spot.hides(cause):
                found.setdefault(cause, spot)
    return found


def size_range(sim: Simulation, signals: Signals, cause: str, seed: int) -> SizeRange | None:
    """The sizes to try; None where these runs show nothing of the cause at any size."""
    effect = EFFECTS[cause]
    noise = np.random.default_rng(seed).standard_normal(len(signals)) * sim.sigma_arcsec
    regression = Regression.of(signals, noise, sim.surroundings)

    def shown(log_size: float) -> float:
        size = 2.0 ** (log_size if effect.size_grows else -log_size)
        found = []
        for number in range(DRAWS):
            rng = trial_rng(seed, cause, number)
            drawn = drawn_effect(cause, size, Drawing(signals, sim.surroundings, rng))
            found.append(0.0 if drawn is None else _deviance(drawn, regression, rng, sim))
        return float(np.mean(found))

    limit = float(np.log2(effect.size_most))
    start = min(0.0, limit)
    if shown(start) == 0.0:
        return None
    if shown(start) == shown(start - 1.0):
        return SizeRange(1.0, 0, 0, effect.size_grows)  # it has one size only
    log_size = start
    for _ in range(ROUNDS):
        value = shown(log_size)
        if max(value / FIRST, FIRST / max(value, 1e-300)) < NEAR:
            break
        move = 0.5 * float(np.log2(FIRST / max(value, 1e-300)))
        log_size = min(log_size + float(np.clip(move, -8.0, 8.0)), limit)
    highest = 0.5 * np.log2(len(signals) * UP**2 / FIRST)
    highest = min(highest, limit - log_size)
    size = 2.0 ** (log_size if effect.size_grows else -log_size)
    return SizeRange(
        float(size),
        int(np.floor(np.log2(DOWN) * STEPS)),
        int(np.floor(highest * STEPS)),
        effect.size_grows,
    )


def _deviance(
    effect: Effect, regression: Regression, rng: np.random.Generator, sim: Simulation
) -> float:
    """What the effect adds to the zero and the lines, in units of the noise."""
    around = sim.surroundings
    column = effect.signal(regression.signals, around, rng)
    x, excited = regression.projected(column[:, None])
    found = float(x[:, 0] @ x[:, 0]) / sim.sigma_arcsec**2 if excited[0] else 0.0
    # Where nothing is changed in the writing, the difference is exactly zero.
    noise = sim.sigma_arcsec * rng.standard_normal(regression.n)
    reading = regression.signals.degrees + noise / ARCSEC_PER_DEG
    rounded = (effect.written(reading) - reading) * ARCSEC_PER_DEG
    found += float(rounded @ rounded) / sim.sigma_arcsec**2
    factor = effect.noise_factor(regression.signals, around)
    if factor is not None:
        # Half of the variance of the logarithm of the variance, for every reading.
        found += 2.0 * factor.size * float(np.var(np.log(factor)))
    return found
