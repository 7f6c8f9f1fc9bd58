"""Corrections into machines and back: tables that firmware reads, each with a proven bound.

A target is one file in this package and one line in `trueangle.export.targets`.
"""

from .export import export_model, import_model
from .exported import Exported
from .targets import TARGETS

__all__ = ["TARGETS", "Exported", "export_model", "import_model"]
