"""The text of a fleet's file, and writing it."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any, Final

from ..fitting.prior import Prior
from ..support.files import FLEET, written_atomically
from ..support.plainresult import pretty_json

FORMAT: Final = "trueangle-fleet"
VERSION: Final = 1


def save_fleet(prior: Prior, told: dict[str, Any], path: str | PathLike[str]) -> None:
    """Write a fleet: its prior, and what it tells as plain values; see `Fleet.save`."""
    runs = prior.run_variance
    content = {
        "format": FORMAT,
        "version": VERSION,
        "prior": {
            "period": prior.period,
            "shafts": [{**s._asdict(), "orders": list(s.orders)} for s in prior.shafts],
            "mean": prior.mean.tolist(),
            "variance": prior.variance.tolist(),
            "freedom": prior.freedom,
            "noise_variance": prior.noise_variance,
            "noise_freedom": None if math.isinf(prior.noise_freedom) else prior.noise_freedom,
            "units": prior.units,
            **({} if runs is None else {"run_variance": runs.tolist()}),
        },
        **told,
    }
    with written_atomically(path, kind=FLEET) as file:
        file.write(pretty_json(content) + "\n")
