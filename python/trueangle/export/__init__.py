"""Corrections into machines and back: tables that firmware reads, each with a proven bound.

A target is one file in this package and one line in `trueangle.export.targets`.
"""

from .comparison import Comparison, compare
from .export import export_model, import_model
from .exported import Exported
from .targets import TARGETS

__all__ = ["TARGETS", "Comparison", "Exported", "compare", "export_model", "import_model"]
