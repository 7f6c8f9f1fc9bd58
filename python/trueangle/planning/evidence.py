"""Expected evidence between rival hypotheses: T-optimality under correlated noise.

Where A is the cause, with error s at the readings, the best imitation by another cause B leaves

::

    T_{A|B} = min_b |W(s - Xβ - Z_B b)|² / (σ² (1 - ρ²))

with the zero and the lines of the simulation in X and W the map that makes noise of correlation rho
independent. That is the deviance by which A is expected to win, with standard deviation
``2√T``; less what its parameters cost more, the difference of BIC. Source: Atkinson and
Fedorov (1975).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.effect import ALWAYS
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.arrays import Array

#: Difference of BIC that names a cause: 6 is what Kass and Raftery call strong.
STRONG = 6.0

#: Draws over which an error that is new in every run is averaged.
DRAWS = 4


@dataclass(frozen=True)
class Hypothesis:
    """A cause that may be the one, as it would be then.

    Attributes
    ----------
    cause : str
    effects : tuple of Effect
    """

    cause: str
    effects: tuple[Effect, ...]

    def errors(self, signals: Signals, around: JointPattern) -> list[Array]:
        """Its error at every reading, arcsec; several draws of one that is random."""
        draws = 1 if all(e.transfers for e in self.effects) else DRAWS
        return [
            np.sum([e.signal(signals, around, np.random.default_rng(k)) for e in self.effects], 0)
            for k in range(draws)
        ]


@dataclass(frozen=True)
class ReadingNoise:
    """Of one reading: standard deviation, arcsec, and correlation from one to the next."""

    sigma: float
    correlation: float = 0.0


@dataclass(frozen=True)
class ExpectedEvidence:
    """Expected evidence of one cause against another, were it the one.

    Attributes
    ----------
    cause, rival : str
        Without a rival: against none.
    deviance : float
        T.
    bic : float
        Expected difference of BIC.
    margin : float
        Of which so much is wanted: of a cause that was not in question none.
    """

    cause: str
    rival: str
    deviance: float
    bic: float
    margin: float = STRONG

    @property
    def chance(self) -> float:
        """That the difference of BIC is as wanted, for noise of a normal distribution."""
        return 0.5 * math.erfc(-self.deviations / math.sqrt(2.0))

    @property
    def deviations(self) -> float:
        """By how many standard deviations the difference of BIC is more than wanted."""
        return (self.bic - self.margin) / (2.0 * math.sqrt(max(self.deviance, 1e-300)))


def evidence_between(
    regression: Regression, rivals: Sequence[Hypothesis], noise: ReadingNoise, searched: bool = True
) -> list[ExpectedEvidence]:
    """Every cause against every other that may be confused with it, and against none.

    Parameters
    ----------
    regression : Regression
        Noise at all readings, earlier ones and those that are planned, and what is fitted with
        everything.
    rivals : sequence of Hypothesis
    noise : ReadingNoise
    searched : bool
        A rival takes the form that imitates best; else the one that it has, of any size.

    Returns
    -------
    list of ExpectedEvidence
        The imitation by a rival is the best that its own search finds.

    Notes
    -----
    A search of every rival for every cause: some milliseconds each for 1000 readings.
    """
    found = []
    signals, around = regression.signals, regression.belief
    errors = {one.cause: one.errors(signals, around) for one in rivals}
    for one in rivals:
        per_rival: dict[str, list[tuple[float, float]]] = {}
        for k, error in enumerate(errors[one.cause]):
            left = deviance_left(regression, error, noise)
            if not searched:
                per_rival.setdefault("", []).append((left, left - regression.log_n - STRONG))
                for other in rivals:
                    if other.cause != one.cause:
                        column = errors[other.cause][k % len(errors[other.cause])][:, None]
                        beside = deviance_left(regression.jointly_with(column), error, noise)
                        per_rival.setdefault(other.cause, []).append((beside, beside))
                continue
            alone, own = _shown(regression, one, k, error)
            price = _price(own)
            per_rival.setdefault("", []).append((left, left - price - STRONG))
            for imitator in _imitators(one.cause, rivals):
                imitation = EFFECTS[imitator].propose(alone)
                left_by = left
                if imitation is not None and imitation.deviance > 0.0:
                    left_by = deviance_left(alone, error, noise, imitation)
                gap = left_by + _price(imitation) - price
                per_rival.setdefault(imitator, []).append((left_by, gap))
        for rival, pairs in per_rival.items():
            deviance, bic = np.mean(pairs, axis=0)
            margin = STRONG if rival in ("", *errors) else 0.0
            found.append(ExpectedEvidence(one.cause, rival, float(deviance), float(bic), margin))
    return found


def is_doubted(regression: Regression, one: Hypothesis, spots: Sequence[Ambiguity]) -> bool:
    """Whether readings with this cause would leave it uncertain, with any evidence.

    ``spots`` are what the design of the readings cannot distinguish.
    """
    error = one.errors(regression.signals, regression.belief)[0]
    shown, found = _shown(regression, one, 0, error)
    if found is None:
        # Causes of the scatter are looked for elsewhere; others could not be found.
        return EFFECTS[one.cause].find_scatter(shown) is None
    doubts = (effect.doubt(found, shown, spots) for effect in EFFECTS.values())
    return any(doubt is not None and doubt.common != one.cause for doubt in doubts)


def _shown(
    regression: Regression, one: Hypothesis, draw: int, error: Array
) -> tuple[Regression, Extension | None]:
    """The same readings with the error of a hypothesis, and what its cause proposes of them.

    What follows from the motion is computed once, all else once for each draw.
    """

    def build() -> tuple[Regression, Extension | None]:
        readings = regression.readings.less(-error)
        cache = regression.cache.for_other_errors()
        alone = Regression.of_readings(readings, regression.whiten.rho, cache, regression)
        return alone, EFFECTS[one.cause].propose(alone)

    return regression.cache.of_fit(("with the error of", one, draw), build)


def _imitators(cause: str, rivals: Sequence[Hypothesis]) -> list[str]:
    """Causes that may be confused with another.

    Those in question, its confounders, and all that act on whole runs; not what it is a special
    case of, as the simpler one is named.
    """
    asked = [one.cause for one in rivals if one.cause != cause]
    own = EFFECTS[cause]
    others = (
        kind
        for kind, effect in EFFECTS.items()
        if (effect.acts_on_runs or effect in own.confused_with or own in effect.confused_with)
        and effect.flexible_below != ALWAYS
        and kind != cause
        and kind not in asked
        and own not in effect.contains
    )
    return [*asked, *others]


def deviance_left(
    regression: Regression, error: Array, noise: ReadingNoise, imitation: Extension | None = None
) -> float:
    """Deviance of an error that a regression, and an imitation, leave unexplained."""
    if imitation is None:
        squares = float(np.sum(regression.projected(error[:, None])[0] ** 2))
    else:
        squares = regression.factor_with(imitation).project(error)[2]
    return squares / (noise.sigma**2 * (1.0 - noise.correlation**2))


def _price(extension: Extension | None) -> float:
    """What its parameters and its search cost."""
    if extension is None:
        return 0.0
    return extension.parameters * extension.log_n + 2.0 * extension.log_grid
