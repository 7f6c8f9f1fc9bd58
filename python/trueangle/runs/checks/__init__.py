"""Are data fit to be used? Tests before a fit, and what can be determined from such data."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .check import check
from .fault import DataFault

if TYPE_CHECKING:
    from .result import Check as Check

__all__ = ["Check", "DataFault", "check"]


def __getattr__(name: str) -> Any:
    # A fit tests its data without making a `Check` of it.
    if name == "Check":
        from .result import Check

        return Check
    raise AttributeError(f"module 'trueangle.runs.checks' has no attribute {name!r}")
