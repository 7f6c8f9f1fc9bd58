"""Arrays as annotations name them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Numbers of double precision, of any shape.
Array: TypeAlias = NDArray[np.float64]
