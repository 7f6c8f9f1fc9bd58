"""What users fit harmonics with today: each takes angles, errors and the highest order."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["design", "peers"]

_Array = NDArray[np.float64]
_Fit = Callable[[_Array, _Array, int], _Array]


def design(theta: _Array, highest: int) -> _Array:
    """Columns ``1, cos, sin, cos 2x, sin 2x ...``."""
    columns = np.empty((theta.size, 2 * highest + 1))
    columns[:, 0] = 1.0
    for k in range(1, highest + 1):
        np.cos(k * theta, out=columns[:, 2 * k - 1])
        np.sin(k * theta, out=columns[:, 2 * k])
    return columns


def _lstsq(theta: _Array, error: _Array, highest: int) -> _Array:
    return np.asarray(np.linalg.lstsq(design(theta, highest), error)[0], dtype=np.float64)


def _normal_equations(theta: _Array, error: _Array, highest: int) -> _Array:
    rows = design(theta, highest)
    return np.asarray(np.linalg.solve(rows.T @ rows, rows.T @ error), dtype=np.float64)


def _gelsy(theta: _Array, error: _Array, highest: int) -> _Array:
    linalg = importlib.import_module("scipy.linalg")
    found = linalg.lstsq(design(theta, highest), error, lapack_driver="gelsy")[0]
    return np.asarray(found)


def _astropy(theta: _Array, error: _Array, highest: int) -> _Array:
    timeseries = importlib.import_module("astropy.timeseries")
    # A period of 2 pi is a frequency of 1 / (2 pi).
    periodogram = timeseries.LombScargle(theta, error, nterms=highest, center_data=False)
    found = np.array(periodogram.model_parameters(0.5 / np.pi))
    found[1::2], found[2::2] = found[2::2].copy(), found[1::2].copy()  # sines come first
    return found


def _statsmodels(theta: _Array, error: _Array, highest: int) -> _Array:
    api = importlib.import_module("statsmodels.api")
    return np.asarray(api.OLS(error, design(theta, highest)).fit(method="qr").params)


def _finufft(theta: _Array, error: _Array, highest: int) -> _Array:
    """Sums by the non-uniform transform, then the Toeplitz system of their harmonics."""
    finufft = importlib.import_module("finufft")
    linalg = importlib.import_module("scipy.linalg")
    ones = np.ones(theta.size, dtype=complex)
    weight = finufft.nufft1d1(theta, ones, 4 * highest + 1, eps=1e-14, isign=1)[2 * highest :]
    right = finufft.nufft1d1(theta, error + 0j, 2 * highest + 1, eps=1e-14, isign=-1)
    spectrum = linalg.solve_toeplitz(np.conj(weight), right)[highest:]
    found = np.empty(2 * highest + 1)
    found[0], found[1::2], found[2::2] = (
        spectrum[0].real,
        2 * spectrum[1:].real,
        -2 * spectrum[1:].imag,
    )
    return found


def peers() -> tuple[dict[str, _Fit], list[str]]:
    """The peers that are installed, and the names of those that are not."""
    known: list[tuple[str, _Fit, tuple[str, ...]]] = [
        ("numpy.linalg.lstsq", _lstsq, ()),
        ("normal equations by BLAS", _normal_equations, ()),
        ("scipy gelsy", _gelsy, ("scipy",)),
        ("astropy LombScargle", _astropy, ("astropy",)),
        ("statsmodels OLS", _statsmodels, ("statsmodels",)),
        ("finufft + Toeplitz", _finufft, ("finufft", "scipy")),
    ]
    found, missing = {}, []
    for name, fit, modules in known:
        if all(importlib.util.find_spec(module) for module in modules):
            found[name] = fit
        else:
            missing.append(name)
    return found, missing
