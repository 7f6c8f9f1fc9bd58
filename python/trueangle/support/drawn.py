"""Pictures of results: `result_picture` hands a result to the room that draws."""

from __future__ import annotations

import sys
from typing import Any

__all__ = ["result_picture"]


def result_picture(result: object, *args: Any, **options: Any) -> Any:
    """The picture of a result, by `trueangle.plots`; needs ``trueangle[plot]``.

    What computes does not import what draws: the package's face finds it when it is called.
    """
    face = sys.modules[__name__.partition(".")[0]]
    return face.plots.drawn(result, *args, **options)
