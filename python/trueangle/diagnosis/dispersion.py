"""Scatter: wild readings and noise that depends on angle, speed or load."""

from __future__ import annotations

from dataclasses import dataclass
from math import lgamma

import numpy as np
from numpy.typing import NDArray

from ..regression.estimate import Parameters, quantity
from ..regression.regression import Regression
from ..simulation.effects import Effect
from ..simulation.effects.dispersion import HeteroscedasticNoise, Outliers

__all__ = ["NEW_SCATTER", "ScatterFinding", "find_outliers", "find_uneven_noise"]

Array = NDArray[np.float64]

#: Evidence that uneven noise must bring beyond its price. Half of what other causes must:
#: nothing in the mean of the readings imitates it.
NEW_SCATTER = 3.0

#: Squared residuals are taken at most this many variances large.
SQUARE_CLIP = 9.0

#: Degrees of freedom of heavy-tailed noise, sizes of wild readings to start from.
TAILS = (2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0, 40.0)
SIZES = (3.0, 10.0, 100.0)

#: A wild reading's neighbours are smaller by this factor; of the stretches of wild
#: readings at least this share must be such single ones.
BESIDE = 0.5
ISOLATED = 0.5

#: Wild readings smaller than this many standard deviations hide in the noise: of sizes
#: spread evenly up to ``size`` that is a share of ``HIDDEN / size``, which the form of the
#: wide normal supplies and no reading shows. It counts as the fraction's uncertainty.
HIDDEN = 3.0

#: Steps of expectation-maximisation.
EM_STEPS = 60

SCALES = np.linspace(0.85, 1.1, 11)

#: Evidence by which wild readings must beat mere heavy tails.
BEYOND_TAILS = 2.0


@dataclass(frozen=True)
class ScatterFinding:
    """A cause of the scatter with its evidence.

    Attributes
    ----------
    cause : str
    bic_gain : float
    parameters : dict
    effects : list of Effect
    weights : ndarray, shape (n,)
        Inverse variances, of mean 1 (uneven noise), or 0 for wild readings.
    size : float
        Of the scatter, in standard deviations of one reading.
    """

    cause: str
    bic_gain: float
    parameters: Parameters
    effects: list[Effect]
    weights: Array
    size: float = 1.0


def _standardised(regression: Regression) -> Array:
    e = regression.whiten(regression.residual - regression.design @ regression.coefficients)
    spread = 1.4826 * float(np.median(np.abs(e)))
    return np.asarray(e / max(spread, 1e-300))


def find_uneven_noise(regression: Regression) -> ScatterFinding | None:
    """Noise whose variance follows angle, speed or load (Koenker's score test, blockwise).

    The clipped squares are regressed on each block; n R^2 is the deviance.
    """
    if regression.is_explained:
        return None
    signals, n = regression.signals, regression.n
    square = np.minimum(_standardised(regression) ** 2, SQUARE_CLIP)
    # A reading tells half as much of the logarithm of a variance as of a mean.
    log_n = regression.log_n - float(np.log(2.0))
    blocks: dict[str, Array] = {}
    prices: dict[str, float] = {}
    for k in (1, 2, 3):
        x = k * signals.theta
        blocks[f"order {k}"] = np.column_stack([np.cos(x), np.sin(x)])
        prices[f"order {k}"] = 2.0 * log_n + 2.0 * float(np.log(2.0 * k))
    for name, values in (
        ("per_deg_s", None if signals.velocity is None else np.abs(signals.velocity)),
        ("per_Nm", None if signals.torque is None else np.abs(signals.torque)),
    ):
        if values is not None and np.ptp(values) > 0.0:
            blocks[name] = values[:, None]
            prices[name] = log_n + 2.0 * float(np.log(4.0))
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
            q, _ = np.linalg.qr(wider)
            saved = float(np.sum((q.T @ rest) ** 2))
            gain = n * saved / power - prices[name]
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
    gamma, covariance = _log_variance(design, square)
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
    return ScatterFinding(
        "heteroscedastic_noise", total, parameters, effects, weights / weights.mean()
    )


def _log_variance(design: Array, square: Array) -> tuple[Array, Array]:
    """Coefficients of the log variance by iterated weighted least squares."""
    gamma = np.zeros(design.shape[1])
    gamma[0] = np.log(square.mean())
    inverse = np.linalg.inv(design.T @ design)
    for _ in range(30):
        step = inverse @ (design.T @ (square * np.exp(-(design @ gamma)) - 1.0))
        gamma += step
        if np.abs(step).max() < 1e-10:
            break
    return gamma, np.asarray(2.0 * inverse, dtype=np.float64)


def find_outliers(regression: Regression) -> ScatterFinding | None:
    """Wild readings: a narrow and a wide normal must beat one normal and heavy tails."""
    if regression.is_explained:
        return None
    e = _standardised(regression)
    n = regression.n
    normal = max(_normal(e, s) for s in np.append(SCALES, np.linspace(1.15, 3.0, 24)))
    tails = max(_student(e, nu, s) for nu in TAILS for s in SCALES)
    value, share, size, scale = max(_two_normals(e, start) for start in SIZES)
    value -= 0.5 * n * np.log(2.0 * np.pi)
    gain = 2.0 * (value - normal) - 2.0 * regression.log_n
    beyond = 2.0 * (value - tails) - regression.log_n
    if gain <= 0.0 or beyond <= BEYOND_TAILS:
        return None
    x = e / scale
    wide = share / size * np.exp(-0.5 * (x / size) ** 2)
    chance = wide / (wide + (1.0 - share) * np.exp(-0.5 * x**2))
    rows = np.flatnonzero(chance > 0.5)
    alone = rows[_isolated(regression, rows)]
    stretches = 1 + np.count_nonzero(np.diff(rows) > 1)
    if alone.size < ISOLATED * stretches:
        return None
    rows = alone
    spread = size * scale * np.sqrt(regression.variance)
    std = float(np.sqrt(share * (1.0 - share) / n))
    parameters: Parameters = {
        "fraction": quantity(
            float(share), max(std, float(share) * float(np.clip(HIDDEN / size, 0.2, 1.0)))
        ),
        "size_arcsec": quantity(float(spread), None),
        "rows": quantity(
            [
                [
                    regression.signals.labels[int(regression.signals.run[k])],
                    int(regression.signals.row[k]),
                ]
                for k in rows
            ]
        ),
    }
    weights = np.ones(n)
    weights[rows] = 1e-6
    return ScatterFinding(
        "outliers", float(gain), parameters, [Outliers(float(share), float(spread))], weights, size
    )


def _isolated(regression: Regression, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which of ``rows`` are far larger than the readings next to them in their run.

    A glitch is over with the next reading; what lasts (a transition at a reversal, a
    manoeuvre) is an error of the mean.
    """
    size = np.abs(regression.left - regression.whiten.run_part(regression.left))
    padded = np.concatenate([[0.0], size, [0.0]])
    first = np.array([start for start, _ in regression.bounds])
    before, after = padded[:-2].copy(), padded[2:].copy()
    before[first] = after[first[1:] - 1] = 0.0
    return np.asarray(np.maximum(before, after)[rows] < BESIDE * size[rows])


def _normal(e: Array, scale: float) -> float:
    n = e.size
    return -0.5 * float(e @ e) / scale**2 - n * float(np.log(scale) + 0.5 * np.log(2.0 * np.pi))


def _student(e: Array, nu: float, scale: float) -> float:
    constant = lgamma(0.5 * (nu + 1.0)) - lgamma(0.5 * nu) - 0.5 * float(np.log(np.pi * nu))
    body = -0.5 * (nu + 1.0) * float(np.sum(np.log1p((e / scale) ** 2 / nu)))
    return body + e.size * (constant - float(np.log(scale)))


def _two_normals(e: Array, start: float) -> tuple[float, float, float, float]:
    """Log-likelihood, share and relative size of the wide part, scale of the narrow one.

    Expectation-maximisation from a share of 1 % and a size of ``start``.
    """
    share, size, scale = 0.01, start, 1.0
    square = e**2
    for _ in range(EM_STEPS):
        narrow = (1.0 - share) * np.exp(-0.5 * square / scale**2)
        wide = share / size * np.exp(-0.5 * square / (scale * size) ** 2)
        chance = wide / np.maximum(narrow + wide, 1e-300)
        share = float(np.clip(chance.mean(), 1.0 / e.size, 0.2))
        kept = 1.0 - chance
        scale = float(np.sqrt((kept @ square) / kept.sum()))
        size = max(float(np.sqrt((chance @ square) / max(chance.sum(), 1e-300))) / scale, 2.0)
    log_narrow = np.log1p(-share) - 0.5 * square / scale**2
    log_wide = np.log(share / size) - 0.5 * square / (scale * size) ** 2
    value = float(np.logaddexp(log_narrow, log_wide).sum()) - e.size * float(np.log(scale))
    return value, share, size, scale
