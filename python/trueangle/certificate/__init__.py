"""Calibration certificates: value and expanded uncertainty at every nominal position.

The budget (`budget`) and the propagation of uncertainty (`propagation`) follow JCGM 100
(GUM); what a fit states about each position is in `values`; `identity` reads what only the
laboratory knows, `conformity` states conformity after ILAC-G8 and JCGM 106; `language` holds the
texts, `typesetting` makes the PDF.
"""

from __future__ import annotations

from .budget import Budget, Contribution, Estimates, propagated
from .conformity import Specification, conformance_probability, conformity
from .document import Certificate, certify
from .identity import Identity, load_identity

__all__ = [
    "Budget",
    "Certificate",
    "Contribution",
    "Estimates",
    "Identity",
    "Specification",
    "certify",
    "conformance_probability",
    "conformity",
    "load_identity",
    "propagated",
]
