"""A factor times a shape in angle: what effects of temperature and load share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from .effect import Effect
from .search import Array, Fitted, line_parameters
from .shapes import best_shape


class FactorEffect(Effect):
    """Base: tries every block ``scale * shape(theta)`` and proposes the best.

    Further blocks follow as further terms of the same cause.
    """

    @classmethod
    def scale(cls, signals: Signals, kind: str) -> Array | None:
        """What the blocks grow with; None where it was not recorded."""
        raise NotImplementedError

    @classmethod
    def shapes(cls, regression: Regression) -> list[dict[str, Any]]:
        """Blocks to try."""
        raise NotImplementedError

    @classmethod
    def alternatives(
        cls, regression: Regression, shape: dict[str, Any], shapes: list[dict[str, Any]]
    ) -> int:
        """Shapes as likely as this one; half of the prior probability goes to the likeliest."""
        return 1 if shape["what"] == "zero" else len(shapes)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        shapes = cls.shapes(regression)
        log_grids = [np.log(2.0 * cls.alternatives(regression, shape, shapes)) for shape in shapes]
        return best_shape(cls, regression, shapes, log_grids)

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        scale = cls.scale(signals, shape.get("kind", "signed"))
        assert scale is not None
        if shape["what"] == "zero":
            return scale[:, None]
        if shape["what"] == "pattern":
            return np.asarray((scale * around.pattern.value(signals.theta))[:, None])
        return scale[:, None] * line_columns(signals.theta, shape["order"])

    @classmethod
    def line_rows(cls, terms: Sequence[Fitted]) -> list[tuple[float, float, float, float, float]]:
        """(order, amplitude, phase, std of the amplitude, of the phase) of the line terms."""
        found = []
        for extension, coefficients, covariance in terms:
            if extension.shape["what"] == "line":
                found.append(
                    (float(extension.shape["order"]), *line_parameters(coefficients, covariance))
                )
        return found

    @classmethod
    def single(cls, terms: Sequence[Fitted], what: str) -> Any:
        """Coefficient and standard deviation of the term ``what``, or None."""
        for extension, coefficients, covariance in terms:
            if extension.shape["what"] == what:
                return float(coefficients[0]), float(np.sqrt(covariance[0, 0]))
        return None
