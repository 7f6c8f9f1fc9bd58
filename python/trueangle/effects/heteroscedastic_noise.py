"""Noise that depends on angle, speed or load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from ..estimation.linear import linear_residual
from ..estimation.projection import EXCITED
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .drawing import Drawing
from .effect import Effect, ScatterFinding
from .noiselaw import SQUARE_CLIP, NoiseLaw, noise_law, standardised_residuals
from .outliers import Outliers
from .search import Array

#: The block of noise that follows the speed.
PER_SPEED = "per_deg_s"


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
    not_at_run_time: ClassVar[str] = "scatter has no value to subtract; average readings"

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
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        angle = of.between(0.0, 2.0 * np.pi)
        return cls(size * float(np.cos(angle)), size * float(np.sin(angle)))

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """Noise whose variance follows angle, speed or load (Koenker's score test, blockwise).

        The clipped squares are regressed on each block; n R^2 is the deviance.
        """
        if regression.is_explained:
            return None
        whole = standardised_residuals(regression) ** 2
        blocks = noise_blocks(regression)
        total, chosen = _chosen(np.minimum(whole, SQUARE_CLIP), blocks)
        return cls.finding_of(noise_law(whole, chosen_columns(blocks, chosen)), chosen, total)

    @classmethod
    def finding_of(
        cls, law: NoiseLaw, chosen: Sequence[str], gain: float = 0.0
    ) -> ScatterFinding | None:
        """The finding of the chosen blocks, the first ones of a law; None where there are none."""
        if not chosen:
            return None
        gamma, std = law.coefficients, np.sqrt(np.diag(law.covariance))
        parameters: Parameters = {}
        start = 1
        extra: dict[str, float] = {}
        effects: list[Effect] = []
        for name in chosen:
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
        return ScatterFinding(
            cls.kind, gain, parameters, effects, law.weights, blocks=tuple(chosen)
        )


@dataclass(frozen=True)
class NoiseBlock:
    """Columns for the logarithm of the variance, and what choosing them costs."""

    columns: Array
    penalty: float


def noise_blocks(regression: Regression) -> dict[str, NoiseBlock]:
    """Every block that may be chosen: low orders, those of the shafts, speed and load."""
    signals = regression.signals
    # A reading has half as much information about the logarithm of a variance as about a mean.
    log_n = regression.log_n - float(np.log(2.0))
    turns = [c for c in regression.around.joint.shafts.values() if c != 1.0]
    fast = sorted({k * cycles for cycles in turns for k in (1, 2)})
    orders = {f"order {k}": (float(k), 2.0 * k) for k in (1, 2, 3)}
    orders |= {f"order {order:g}": (order, 8.0 * len(turns)) for order in fast}
    blocks = {
        name: NoiseBlock(
            np.column_stack([np.cos(order * signals.theta), np.sin(order * signals.theta)]),
            2.0 * log_n + 2.0 * float(np.log(alike)),
        )
        for name, (order, alike) in orders.items()
    }
    for name, values in (
        (PER_SPEED, None if signals.velocity is None else np.abs(signals.velocity)),
        ("per_Nm", None if signals.torque is None else np.abs(signals.torque)),
    ):
        if values is not None and np.ptp(values) > 0.0:
            blocks[name] = NoiseBlock(values[:, None], speed_penalty(regression))
    return blocks


def speed_penalty(regression: Regression) -> float:
    """What noise that follows the speed (or the load) must bring, in any form."""
    # One parameter, about which a reading has half as much information as about a mean, and one
    # of four factors.
    return regression.log_n - float(np.log(2.0)) + 2.0 * float(np.log(4.0))


def chosen_columns(blocks: Mapping[str, NoiseBlock], chosen: Sequence[str]) -> Array:
    """A constant and the columns of the chosen blocks."""
    n = len(next(iter(blocks.values())).columns)
    return np.hstack([np.ones((n, 1)), *(blocks[name].columns for name in chosen)])


def _chosen(square: Array, blocks: Mapping[str, NoiseBlock]) -> tuple[float, list[str]]:
    """Blocks that clipped squares follow, one after the other, and the evidence of all."""
    chosen: list[str] = []
    design = chosen_columns(blocks, chosen)
    total = 0.0
    rest = square - square.mean()
    while True:
        power = float(rest @ rest)
        best = (0.0, "", design)
        for name, block in blocks.items():
            if name in chosen:
                continue
            columns = block.columns
            wider = np.hstack([design, columns])
            q, r = np.linalg.qr(wider)
            own = np.abs(np.diag(r)[design.shape[1] :])
            if (own**2 <= EXCITED * np.einsum("ij,ij->j", columns, columns)).any():
                continue  # these readings never show it apart
            saved = float(np.sum((q.T @ rest) ** 2))
            gain = square.size * saved / power - block.penalty
            if gain > best[0]:
                best = (gain, name, wider)
        if best[0] <= 0.0:
            return total, chosen
        total += best[0]
        chosen.append(best[1])
        design = best[2]
        rest = linear_residual(design, square)
