"""Words that a calibration without a reference takes: its methods, and loops of the speed."""

from __future__ import annotations

from typing import Final

METHODS: Final = ("spin-down", "heads", "shifts", "dual", "channels")
LOOPS: Final = ("open", "closed", "unknown")
