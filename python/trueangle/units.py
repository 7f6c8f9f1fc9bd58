"""Does the indicated angle follow the reference? Wrong units and signs found out."""

from __future__ import annotations

import math

import numpy as np

from . import _core
from .errors import ArgumentError
from .runs import CalibrationRun

__all__ = ["check_follows"]

#: Readings looked at; a mistake of unit shows in any few.
_SAMPLE = 1000

#: Resultant length (1 = all differences equal, 0 = spread over the turn). Errors of a
#: whole 60 deg standard deviation still give 0.58.
_FOLLOWS = 0.5

#: A remedy is only named when it makes the differences agree this well.
_REMEDIED = 0.95

_REMEDIES = {
    "it runs backwards: change its sign": -1.0,
    "it looks like radians in a column of degrees": 180.0 / math.pi,
    "it looks like degrees in a column of radians": math.pi / 180.0,
    "it looks like turns in a column of degrees": 360.0,
    "it looks like degrees in a column of turns": 1.0 / 360.0,
    "it looks like turns in a column of radians": 2.0 * math.pi,
    "it looks like radians in a column of turns": 0.5 / math.pi,
}


def check_follows(run: CalibrationRun) -> None:
    """Raise when ``indicated - reference`` is spread over the whole turn.

    Raises
    ------
    ArgumentError
        Says what the indicated angle looks like instead: another unit, the other sign.
    """
    stride = max(1, len(run) // _SAMPLE)
    reference = np.ascontiguousarray(run.reference[::stride])
    indicated = np.ascontiguousarray(run.indicated[::stride])
    if reference.size < 4 or _core.resultant(indicated, reference, run.period) >= _FOLLOWS:
        return
    remedy = next(
        (
            text
            for text, factor in _REMEDIES.items()
            if _core.resultant(factor * indicated, reference, run.period) > _REMEDIED
        ),
        "check units, sign, gear ratio and that the rows belong together",
    )
    named = f" of run {run.label}" if run.label else ""
    raise ArgumentError(
        f"the indicated angle{named} does not follow the reference "
        f"(their differences are spread over the whole turn): {remedy}"
    )
