"""Rehearsal: which causes a diagnosis of planned runs would name, and from what size on."""

from __future__ import annotations

from .after import plan_after
from .rehearse import rehearse
from .result import Rehearsal, RehearsedCause

__all__ = ["Rehearsal", "RehearsedCause", "plan_after", "rehearse"]
