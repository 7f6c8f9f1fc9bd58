"""Noise that depends on angle, speed or load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from ..estimation.projection import EXCITED
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .effect import Effect, ScatterFinding
from .outliers import Outliers
from .scatter import CLIPPED_VARIANCE, SQUARE_CLIP, clipped_squares, standardised_residuals
from .search import Array

#: Logarithm of the largest ratio of a reading's variance to the mean one: a thousand times the
#: standard deviation is more than noise of one kind does.
WIDEST = 2.0 * float(np.log(1e3))


@dataclass(frozen=True)
class HeteroscedasticNoise(Effect):
    """Noise that depends on angle, speed or load.

    ::

        ln σ² = a + b cos kθ + c sin kθ + e |v| + f |τ|

    Parameters
    ----------
    cosine, sine : float
        b and c.
    order : float
        k, output order.
    per_deg_s : float
        e.
    per_Nm : float
        f.
    """

    cosine: float = 0.0
    sine: float = 0.0
    order: float = 1.0
    per_deg_s: float = 0.0
    per_Nm: float = 0.0

    kind: ClassVar[str] = "heteroscedastic_noise"
    size_name: ClassVar[str] = "cosine"
    size_most: ClassVar[float] = 6.0
    sentence: ClassVar[str] = (
        "Readings scatter more at some angles, speeds or loads (friction zones, weak field, "
        "edge of the autocollimator's range)."
    )
    factor: ClassVar[str] = "none"
    measure: ClassVar[str] = "at least 1000 readings spread over the angles, speeds and loads"
    transfers: ClassVar[bool] = False
    confused_with: ClassVar[Mapping[type[Effect], str]] = {Outliers: "more readings"}
    weighs: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "scatter has no value to subtract, only a weight"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return np.zeros(len(signals))

    def noise_factor(self, signals: Signals, around: JointPattern) -> Array | None:
        log_variance = self.cosine * np.cos(self.order * signals.theta)
        log_variance += self.sine * np.sin(self.order * signals.theta)
        log_variance += self.per_deg_s * np.abs(signals.turns_per_s * 360.0)
        if signals.torque is not None:
            log_variance += self.per_Nm * np.abs(signals.torque)
        return np.asarray(np.exp(0.5 * log_variance))

    @classmethod
    def drawn(
        cls, size: float, signals: Signals, around: JointPattern, rng: np.random.Generator
    ) -> Self | None:
        angle = float(rng.uniform(0.0, 2.0 * np.pi))
        return cls(size * float(np.cos(angle)), size * float(np.sin(angle)))

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """Noise whose variance follows angle, speed or load (Koenker's score test, blockwise).

        The clipped squares are regressed on each block; n R^2 is the deviance.
        """
        if regression.is_explained:
            return None
        signals, n = regression.signals, regression.n
        whole = standardised_residuals(regression) ** 2
        square = np.minimum(whole, SQUARE_CLIP)
        # A reading tells half as much of the logarithm of a variance as of a mean.
        log_n = regression.log_n - float(np.log(2.0))
        blocks: dict[str, Array] = {}
        penalties: dict[str, float] = {}
        for k in (1, 2, 3):
            x = k * signals.theta
            blocks[f"order {k}"] = np.column_stack([np.cos(x), np.sin(x)])
            penalties[f"order {k}"] = 2.0 * log_n + 2.0 * float(np.log(2.0 * k))
        turns = [c for c in regression.around.joint.shafts.values() if c != 1.0]
        for order in sorted({k * cycles for cycles in turns for k in (1, 2)}):
            x = order * signals.theta
            blocks[f"order {order:g}"] = np.column_stack([np.cos(x), np.sin(x)])
            penalties[f"order {order:g}"] = 2.0 * log_n + 2.0 * float(np.log(8.0 * len(turns)))
        for name, values in (
            ("per_deg_s", None if signals.velocity is None else np.abs(signals.velocity)),
            ("per_Nm", None if signals.torque is None else np.abs(signals.torque)),
        ):
            if values is not None and np.ptp(values) > 0.0:
                blocks[name] = values[:, None]
                penalties[name] = log_n + 2.0 * float(np.log(4.0))
        chosen: list[str] = []
        design = np.ones((n, 1))
        total = 0.0
        rest = square - square.mean()
        while True:
            power = float(rest @ rest)
            best = (0.0, "", design)
            for name, columns in blocks.items():
                if name in chosen:
                    continue
                wider = np.hstack([design, columns])
                q, r = np.linalg.qr(wider)
                own = np.abs(np.diag(r)[design.shape[1] :])
                if (own**2 <= EXCITED * np.einsum("ij,ij->j", columns, columns)).any():
                    continue  # these readings never show it apart
                saved = float(np.sum((q.T @ rest) ** 2))
                gain = n * saved / power - penalties[name]
                if gain > best[0]:
                    best = (gain, name, wider)
            if best[0] <= 0.0:
                break
            total += best[0]
            chosen.append(best[1])
            design = best[2]
            rest = square - design @ np.linalg.lstsq(design, square, rcond=None)[0]
        if not chosen:
            return None
        gamma, covariance = _log_variance(design, whole)
        parameters: Parameters = {}
        cosine = sine = 0.0
        order, start = 1.0, 1
        extra: dict[str, float] = {}
        effects: list[Effect] = []
        for name in chosen:
            std = np.sqrt(np.diag(covariance))
            if name.startswith("order"):
                order = float(name.split()[1])
                cosine, sine = float(gamma[start]), float(gamma[start + 1])
                suffix = "" if order == 1.0 else f"_{order:.0f}"
                parameters[f"cosine{suffix}"] = quantity(cosine, float(std[start]))
                parameters[f"sine{suffix}"] = quantity(sine, float(std[start + 1]))
                effects.append(HeteroscedasticNoise(cosine, sine, order))
                start += 2
            else:
                parameters[name] = quantity(float(gamma[start]), float(std[start]))
                extra[name] = float(gamma[start])
                start += 1
        if extra:
            effects.append(HeteroscedasticNoise(**extra))
        variance = np.exp(design @ gamma)
        weights = 1.0 / variance
        return ScatterFinding(cls.kind, total, parameters, effects, weights / weights.mean())


def _log_variance(design: Array, square: Array) -> tuple[Array, Array]:
    """Coefficients of the log variance by scoring, every square clipped by its own variance."""
    gamma = np.zeros(design.shape[1])
    gamma[0] = mean = np.log(np.minimum(square, SQUARE_CLIP).mean())
    inverse = np.linalg.inv(design.T @ design)
    for _ in range(30):
        step = inverse @ (design.T @ (clipped_squares(square, np.exp(design @ gamma)) - 1.0))
        if np.abs(design @ (gamma + step) - mean).max() > WIDEST:
            break  # readings that do not scatter at all have no largest likelihood
        gamma += step
        if np.abs(step).max() < 1e-10:
            break
    return gamma, np.asarray(CLIPPED_VARIANCE * inverse, dtype=np.float64)
