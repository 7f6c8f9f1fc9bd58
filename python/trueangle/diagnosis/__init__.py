"""Diagnosis: where a simulation and its joint disagree, and by which cause."""

from __future__ import annotations

from .diagnose import diagnose
from .findings import Diagnosis, Finding

__all__ = ["Diagnosis", "Finding", "diagnose"]
