"""Noise of a fit as one dense covariance: what every sum over neighbours must come to."""

from __future__ import annotations

import numpy as np

from trueangle.estimation.whitening import RunEffect, Whitener

#: Three runs, one of them of two readings.
BOUNDS = [(0, 20), (20, 22), (22, 40)]
N = 40


def covariance(whiten: Whitener) -> np.ndarray:
    """Covariance of the readings, in units of one reading's innovation."""
    n = whiten.bounds[-1][1]
    root = np.ones(n) if whiten.weights is None else np.sqrt(whiten.weights)
    out = np.zeros((n, n))
    for start, stop in whiten.bounds:
        k = np.arange(stop - start)
        part = whiten.rho ** np.abs(k[:, None] - k) / (1.0 - whiten.rho**2)
        part = part / np.outer(root[start:stop], root[start:stop])
        for effect in whiten.effects:
            z = effect.columns[start:stop]
            part = part + effect.ratio * z @ z.T
        out[start:stop, start:stop] = part
    return out


#: Correlation, ratios of run effects, and whether there are weights.
CASES = [
    (0.0, (), False),
    (0.6, (), False),
    (0.0, (2.5,), False),
    (0.4, (0.3, 4.0), True),
    (0.0, (), True),
    (0.7, (1.5,), False),
    (0.5, (), True),
]


def case(rho: float, ratios: tuple[float, ...], weighted: bool, seed: int = 1) -> Whitener:
    """A noise; its effects have one and two columns."""
    rng = np.random.default_rng(seed)
    effects = [RunEffect(rng.normal(size=(N, 1 + j)), ratio) for j, ratio in enumerate(ratios)]
    weights = rng.uniform(0.3, 3.0, N) if weighted else None
    return Whitener(BOUNDS, rho, effects, weights)
