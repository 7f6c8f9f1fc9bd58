"""Calibration certificates: value and expanded uncertainty at every nominal position.

The budget (`budget`) and the propagation of uncertainty (`propagation`) follow JCGM 100
(GUM); what a fit states about each position is in `values`; `identity` reads what only the
laboratory knows, `conformity` states conformity after ILAC-G8 and JCGM 106; `language` holds the
texts, `typesetting` makes the PDF.
"""

from __future__ import annotations

from .budget import Budget as Budget
from .budget import Contribution as Contribution
from .budget import Estimates as Estimates
from .budget import propagated as propagated
from .conformity import Specification as Specification
from .conformity import conformance_probability as conformance_probability
from .conformity import conformity as conformity
from .document import Certificate as Certificate
from .document import certify as certify
from .identity import Identity as Identity
from .identity import load_identity as load_identity
