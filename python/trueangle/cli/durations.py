"""Times on the command line."""

from __future__ import annotations

import argparse
import math
import re

__all__ = ["seconds"]

#: Seconds of a unit.
_UNITS = {"": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "m": 60.0, "h": 3600.0}

_DURATION = re.compile(r"(?P<number>[0-9.]+(?:e[+-]?[0-9]+)?) *(?P<unit>[a-z]*)", re.IGNORECASE)


def seconds(text: str) -> float:
    """A time above zero, in seconds: ``10``, ``10s``, ``500ms``, ``2min``, ``1h``.

    Examples
    --------
    >>> seconds("2min"), seconds("10")
    (120.0, 10.0)
    """
    found = _DURATION.fullmatch(text.strip())
    try:
        value = float(found["number"]) * _UNITS[found["unit"].lower()] if found else math.nan
    except (ValueError, KeyError):
        value = math.nan
    if not (value > 0.0 and math.isfinite(value)):
        raise argparse.ArgumentTypeError(f"a time above zero, as 10s, 2min or 1h, got {text!r}")
    return value
