"""Whether the fitted error is larger than its own standard error."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import NoModelError
from ..estimation.reference import design_matrix
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import error_unit, sine_of_rms

if TYPE_CHECKING:
    from .result import FitResult


def of_worth(fit: FitResult) -> FitResult:
    """The fit; refuse a correction with every order, and the curve, below their errors.

    ::

        2 Σ_i g_iᵀ b bᵀ g_i < Σ_i g_iᵀ V g_i

    over the places read, with rows ``g_i`` of the series less their mean, coefficients b and
    their covariance V. Of one order this is an amplitude below its error; of several all may be
    below theirs, and the curve not, where they nearly cancel.

    Raises
    ------
    NoModelError
        The fitted error is below its standard error.
    """
    # The notes of the whole model take longer than the fit of few readings.
    model = fit.model_with_covariance
    if model.covariance is None or (fit.amplitudes >= fit.amplitude_std).any():
        return fit
    places = np.concatenate(fit.problem.angles)
    # Readings at whose places the two are compared.
    places = places[:: 1 + places.size // 512]
    shafts = [(shaft.cycles_per_turn, shaft.orders) for shaft in model.shafts]
    rows = design_matrix(places, shafts, model.period)
    rows = (rows - rows.mean(axis=0))[:, 1:]
    pairs = [(a, b) for s in model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    size = 2.0 * float(np.mean((rows @ np.ravel(pairs)) ** 2))
    error = float(np.mean(np.einsum("ij,jk,ik->i", rows, model.covariance[1:, 1:], rows)))
    if size < error:
        size, error = (ARCSEC_PER_TURN / model.period * math.sqrt(x) for x in (size, error))
        unit = error_unit("auto", sine_of_rms(error))
        raise NoModelError(
            f"no correction can be given: the error fitted, of {unit.text(size)} amplitude, is "
            f"below its own standard error of {unit.text(error)}; measure more runs, or declare "
            "the `orders=`"
        )
    return fit
