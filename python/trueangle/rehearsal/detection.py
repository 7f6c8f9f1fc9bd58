"""From which size on a cause is named: the probability against size, with what is known about it.

::

    P(named) = (1 - λ) / (1 + exp(-(x - μ)/w))

in steps x of the logarithm of size, with the place mu, the width w and the share lambda that is
never named however large. Every triple of a grid is weighed by the binomial likelihood of all
trials and a flat prior (mu and ln w flat; lambda by `LAPSES`); sizes at 50 and 95 % and their
intervals are quantiles of that weight. Source: Treutwein and
Strasburger (1999), Wichmann and Hill (2001).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from ..support.arrays import Array
from .trial import drawn_effect, trial_rng

#: Shares that are never named, and what each is worth beforehand.
LAPSES = {
    0.0: 0.3,
    0.01: 0.1,
    0.03: 0.1,
    0.06: 0.1,
    0.1: 0.1,
    0.2: 0.1,
    0.35: 0.1,
    0.5: 0.05,
    0.7: 0.05,
}

#: Widths, in steps: from 5 to 95 % in a third of an octave to six octaves. One effect in noise
#: takes about one; draws of very different places or orders take more.
WIDTHS = np.geomspace(0.25, 4.0, 13)

#: Steps beyond the range tried to which the place may lie, and between two places.
BEYOND, BETWEEN = 12, 0.5

#: Quantiles of the interval.
LOW, HIGH = 0.025, 0.975


@dataclass(frozen=True)
class Threshold:
    """The step from which on a share of the trials is named; None where not bracketed.

    Attributes
    ----------
    step : float or None
    low, high : float or None
        95 % interval; None where it is open to that side.
    """

    step: float | None
    low: float | None
    high: float | None


class Chance:
    """Estimate the probability that a cause is named, from trials.

    Parameters
    ----------
    tried : mapping of int to (int, int)
        Named and all trials by step.
    """

    def __init__(self, tried: Mapping[int, tuple[int, int]]) -> None:
        steps = np.array(sorted(tried), dtype=np.float64)
        named = np.array([tried[int(k)][0] for k in steps], dtype=np.float64)
        count = np.array([tried[int(k)][1] for k in steps], dtype=np.float64)
        self._least, self._most = float(steps[0]), float(steps[-1])
        places = np.arange(self._least - BEYOND, self._most + BEYOND + BETWEEN, BETWEEN)
        lapses = np.array([*LAPSES])
        mu, w, lapse = (a.ravel() for a in np.meshgrid(places, WIDTHS, lapses, indexing="ij"))
        p = (1.0 - lapse[:, None]) * _logistic((steps - mu[:, None]) / w[:, None])
        p = np.clip(p, 1e-9, 1.0 - 1e-9)
        log_weight = named @ np.log(p).T + (count - named) @ np.log1p(-p).T
        log_weight += np.log([*LAPSES.values()])[None, :].repeat(mu.size // lapses.size, 0).ravel()
        weight = np.exp(log_weight - log_weight.max())
        self._mu, self._w, self._lapse = mu, w, lapse
        self._weight = weight / weight.sum()

    def quantile(self, share: float, at: float) -> float:
        """Quantile ``at``, below one, of the step where ``share`` is named; infinite if never."""
        reach = 1.0 - self._lapse
        possible = reach > share
        odds = share / np.where(possible, reach - share, 1.0)
        step = np.where(possible, self._mu + self._w * np.log(odds), np.inf)
        order = np.argsort(step)
        heap = np.cumsum(self._weight[order])
        return float(step[order][np.searchsorted(heap, at)])

    def threshold(self, share: float) -> Threshold:
        """The step at which ``share`` is named, as far as the sizes tried bracket it."""
        middle, low, high = (self.quantile(share, at) for at in (0.5, LOW, HIGH))
        return Threshold(self._inside(middle), self._inside(low), self._inside(high))

    def at(self, steps: Array) -> Array:
        """The probability at steps, averaged over what is possible."""
        p = (1.0 - self._lapse) * _logistic((steps[:, None] - self._mu) / self._w)
        return np.asarray(p @ self._weight)

    def curve(self, size: Callable[[float], float]) -> list[tuple[float, float]]:
        """Size and probability over the range tried."""
        steps = np.linspace(self._least - 2.0, self._most + 2.0, 60)
        return [(size(float(k)), float(p)) for k, p in zip(steps, self.at(steps), strict=True)]

    def _inside(self, step: float) -> float | None:
        return step if self._least <= step <= self._most else None


def binomial_interval(named: int, count: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927).

    Examples
    --------
    >>> low, high = binomial_interval(8, 10)
    >>> round(low, 2), round(high, 2)
    (0.49, 0.94)
    """
    z2 = 1.96**2
    p = named / count
    middle = (p + z2 / (2 * count)) / (1 + z2 / count)
    half = (z2 * (p * (1 - p) / count + z2 / (4 * count**2))) ** 0.5 / (1 + z2 / count)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def _logistic(x: Array) -> Array:
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * x)))


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
