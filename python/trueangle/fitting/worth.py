"""Whether the fitted error is larger than its own standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import NoModelError
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import error_unit, sine_of_rms

if TYPE_CHECKING:
    from .result import FitResult


def of_worth(fit: FitResult) -> FitResult:
    """The fit; refuse a correction with every order, and the curve, below their errors.

    Of one order this is an amplitude below its error; of several all may be below theirs, and the
    curve not, where they nearly cancel.

    Raises
    ------
    NoModelError
        The fitted error is below its standard error.
    """
    # The notes of the whole model take longer than the fit of few readings.
    model = fit.model_with_covariance
    if model.covariance is None or (fit.amplitudes >= fit.amplitude_std).any():
        return fit
    size, error = fit.curve_and_error
    if size < error:
        size, error = (ARCSEC_PER_TURN / model.period * x for x in (size, error))
        unit = error_unit("auto", sine_of_rms(error))
        raise NoModelError(
            f"no correction can be given: the error fitted, of {unit.text(size)} amplitude, is "
            f"below its own standard error of {unit.text(error)}; measure more runs, or give the "
            "orders that you know: `orders=[1, 2]`"
        )
    return fit
