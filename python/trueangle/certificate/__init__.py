"""Calibration certificates: value and expanded uncertainty at every nominal position.

The budget (`budget`) and the propagation of uncertainty (`propagation`) follow JCGM 100
(GUM); what a fit says of each position is in `values`; `identity` reads what only the
laboratory knows; `typesetting` makes the PDF.
"""

from __future__ import annotations

from .budget import Budget, Contribution
from .document import Certificate, certify
from .identity import Identity, load_identity
from .propagation import Estimates, propagated

__all__ = [
    "Budget",
    "Certificate",
    "Contribution",
    "Estimates",
    "Identity",
    "certify",
    "load_identity",
    "propagated",
]
