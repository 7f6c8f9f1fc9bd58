"""What every candidate cause does: propose an extension, rebuild it, report it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...joint.pattern import Surroundings
from ...joint.signals import Signals
from ...regression.batch import Blocks
from ...regression.estimate import Parameters, quantity
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect

__all__ = ["Array", "Candidate", "Parameters", "golden_maximum", "line_parameters", "quantity"]

Array = NDArray[np.float64]

_GOLDEN = (5.0**0.5 - 1.0) / 2.0


class Candidate:
    """Base of the candidates, one a cause.

    Class attributes
    ----------------
    cause : str
        Its name in the vocabulary.
    family : tuple of str
        Causes that this one contains as a special case: once it is chosen they are not.
    located : bool
        It searches a grid; the search is repeated inside the training part of a hold-out.
    """

    cause: ClassVar[str]
    family: ClassVar[tuple[str, ...]] = ()
    located: ClassVar[bool] = False

    def propose(self, regression: Regression) -> Extension | None:
        """The best extension of this cause in ``regression``, or None where it cannot act."""
        raise NotImplementedError

    def best(
        self,
        regression: Regression,
        shapes: Sequence[dict[str, Any]],
        log_grids: Sequence[float],
        extra: Sequence[int] | None = None,
    ) -> Extension | None:
        """The extension of the shape with the most evidence; all are scored at once.

        ``extra`` counts the parameters of a shape that are no coefficients.
        """
        if not shapes:
            return None
        blocks: Blocks = regression.remembered(
            self.cause,
            repr(shapes),
            lambda: Blocks(
                [self.columns(regression.signals, regression.around, s) for s in shapes]
            ),
        )
        more = np.zeros(len(shapes)) if extra is None else np.asarray(extra)
        price = more * regression.log_n + 2.0 * np.asarray(log_grids)
        for where, width, _, _ in blocks.groups:
            price[where] += width * regression.log_n
        k = int(np.argmax(regression.block_gains(blocks) - price))
        columns = self.columns(regression.signals, regression.around, shapes[k])
        parameters = columns.shape[1] + int(more[k])
        return regression.propose(self.cause, shapes[k], columns, parameters, float(log_grids[k]))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        """Regressors of ``shape`` at other readings, shape (n, p)."""
        raise NotImplementedError

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        """Parameters of the finding and the effects to extend the simulation with.

        ``terms`` are this cause's terms with their coefficients and covariances.
        """
        raise NotImplementedError


def line_parameters(coefficients: Array, covariance: Array) -> tuple[float, float, float, float]:
    """Amplitude, phase (deg) and their standard deviations of ``A cos + B sin``."""
    a, b = float(coefficients[0]), float(coefficients[1])
    amplitude = float(np.hypot(a, b))
    phase = float(np.degrees(np.arctan2(a, b)) % 360.0)
    if amplitude == 0.0:
        return 0.0, phase, float(np.sqrt(covariance[0, 0])), 180.0
    along = np.array([a, b]) / amplitude
    across = np.array([b, -a]) / amplitude
    std = float(np.sqrt(along @ covariance @ along))
    turn = float(np.degrees(np.sqrt(across @ covariance @ across) / amplitude))
    return amplitude, phase, std, min(turn, 180.0)


def golden_maximum(
    function: Callable[[float], float], low: float, high: float, steps: int = 14
) -> tuple[float, float]:
    """Place and value of the maximum of a function with one peak in [low, high]."""
    a, b = low, high
    c, d = b - _GOLDEN * (b - a), a + _GOLDEN * (b - a)
    fc, fd = function(c), function(d)
    for _ in range(steps):
        if fc > fd:
            b, d, fd = d, c, fc
            c = b - _GOLDEN * (b - a)
            fc = function(c)
        else:
            a, c, fc = c, d, fd
            d = a + _GOLDEN * (b - a)
            fd = function(d)
    return (c, fc) if fc > fd else (d, fd)
