"""A warning when corrected angles leave the stretch a model was fitted on."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from .errors import OutsideSpanWarning

__all__ = ["SpanGuard"]


class SpanGuard:
    """Warns once when corrected angles leave the stretch a model was fitted on."""

    def __init__(self, span: tuple[float, float] | None, period: float) -> None:
        self.span = span
        self.period = period
        self.armed = self.span is not None

    def __call__(self, corrected: ArrayLike) -> None:
        """Look at corrected angles; says nothing more once it has warned."""
        if self.span is None:
            return
        start, stop = self.span
        outside = np.mod(np.asarray(corrected) - start, self.period) > stop - start
        if outside.any():
            self.armed = False
            warnings.warn(
                f"{np.count_nonzero(outside)} of {outside.size} corrected angles lie outside "
                f"the {start:.6g} to {stop:.6g} the model was fitted on: there it is "
                "extrapolated and may be far off (said once per model)",
                OutsideSpanWarning,
                stacklevel=3,
            )
