"""Diagnosis: where a simulation and its joint disagree, and why."""

from __future__ import annotations

from .diagnose import diagnose
from .finding import Finding
from .result import Diagnosis

__all__ = ["Diagnosis", "Finding", "diagnose"]
