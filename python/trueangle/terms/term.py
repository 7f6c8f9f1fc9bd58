"""The base of the terms, under the name it had before: see `trueangle.correction.term`."""

from ..correction.term import Term, from_arcsec, line_values

__all__ = ["Term", "from_arcsec", "line_values"]
