"""Results as plain values and as JSON text, the same that the command line prints."""

from __future__ import annotations

import json
import math
from typing import Any

__all__ = ["PlainResult", "finite"]


class PlainResult:
    """A result whose ``to_dict`` holds plain values: strings, numbers, lists and mappings."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """The result as plain values; what is not a finite number is None."""
        raise NotImplementedError

    def to_json(self) -> str:
        """`to_dict` as JSON text."""
        return json.dumps(self.to_dict(), indent=2, allow_nan=False)


def finite(value: float) -> float | None:
    """A number that JSON can hold, else None."""
    return float(value) if math.isfinite(value) else None
