"""One turn in every unit of angles: constants that need no arrays."""

from __future__ import annotations

import math
from typing import Final

ARCSEC_PER_DEG: Final = 3600.0
ARCSEC_PER_TURN: Final = 360.0 * ARCSEC_PER_DEG

#: Units by the suffix of a column name. Counts have no fixed period.
UNIT_PERIODS: Final = {"deg": 360.0, "rad": 2.0 * math.pi, "turn": 1.0}
