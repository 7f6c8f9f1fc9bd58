"""Noise that is not white: correlation and drift in time, errors that are common to a run."""

from __future__ import annotations

import numpy as np

from .._core import LagCorrelation, RunEffect, Whitener
from ..support.arrays import Array

__all__ = ["DRIFT_TERMS", "LagCorrelation", "RunEffect", "Whitener", "drift_basis"]

#: Half periods per run that count as drift and not as correlation of the noise.
DRIFT_TERMS = 8


def drift_basis(clock: Array, terms: int = DRIFT_TERMS) -> Array:
    """Cosines of 1 to ``terms`` half periods over the record, shape (n, terms)."""
    span = clock[-1] - clock[0]
    u = (clock - clock[0]) / span if span > 0.0 else np.zeros_like(clock)
    return np.asarray(np.cos(np.pi * np.outer(u, np.arange(1, terms + 1))))
