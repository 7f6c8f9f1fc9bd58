"""Are data fit to be used? Tests before anything is fitted, and what such data can tell."""

from __future__ import annotations

from .check import check
from .fault import DataFault
from .result import Check

__all__ = ["Check", "DataFault", "check"]
