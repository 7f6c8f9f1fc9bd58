"""A reported parameter: its value and standard deviation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Quantity:
    """One parameter of a finding.

    Attributes
    ----------
    value : float, int, str or list
    std : float, list or None
        Standard deviation, where one can be given.
    """

    value: Any
    std: Any = None

    def to_dict(self) -> dict[str, Any]:
        """``{"value": .., "std": ..}``."""
        return {"value": self.value, "std": self.std}


#: Parameters of a finding by name.
Parameters = dict[str, Quantity]


def quantity(value: Any, std: Any = None) -> Quantity:
    """A `Quantity` of plain Python numbers."""
    return Quantity(_plain(value), _plain(std))


def _plain(x: Any) -> Any:
    if isinstance(x, np.ndarray | list | tuple):
        return [_plain(item) for item in x]
    if isinstance(x, str | int) or x is None:
        return x
    return float(x)
