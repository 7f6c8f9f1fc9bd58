"""The text of a fleet's file, and writing it."""

from __future__ import annotations

import math
from os import PathLike
from typing import TYPE_CHECKING, Final

from ..support.files import FLEET, written_atomically
from ..support.plainresult import pretty_json

if TYPE_CHECKING:
    from .result import Fleet

FORMAT: Final = "trueangle-fleet"
VERSION: Final = 1


def save_fleet(fleet: Fleet, path: str | PathLike[str]) -> None:
    """Write ``fleet``; see `Fleet.save`."""
    prior = fleet.prior
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
        },
        **fleet.to_dict(),
    }
    with written_atomically(path, kind=FLEET) as file:
        file.write(pretty_json(content) + "\n")
