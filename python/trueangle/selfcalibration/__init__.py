"""Calibration without a reference: patterns jointly with the unknowns of the log."""

from __future__ import annotations

from typing import Final

#: Those that `trueangle.planning.plan_self` plans.
PLANNED: Final = ("spin-down", "heads", "shifts", "dual")
METHODS: Final = (*PLANNED, "channels")
LOOPS: Final = ("open", "closed", "unknown")
