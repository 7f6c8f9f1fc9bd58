"""The best of many shapes of an effect, all scored at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..estimation.blocks import Blocks
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from .effect import Effect


def best_shape(
    effect: type[Effect],
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
    signals, around = regression.signals, regression.around
    remembered = regression.cache.of_motion if effect.of_motion else regression.of_pattern
    blocks: Blocks = remembered(
        effect.kind,
        repr(shapes),
        lambda: Blocks([effect.columns(signals, around, shape) for shape in shapes]),
    )
    more = np.zeros(len(shapes)) if extra is None else np.asarray(extra)
    penalty = more * regression.log_n + 2.0 * np.asarray(log_grids)
    for where, products in blocks.groups:
        penalty[where] += products.width * regression.log_n
    k = int(np.argmax(regression.block_gains(blocks) - penalty))
    columns = effect.columns(signals, around, shapes[k])
    parameters = columns.shape[1] + int(more[k])
    return regression.propose(effect.kind, shapes[k], columns, parameters, float(log_grids[k]))
