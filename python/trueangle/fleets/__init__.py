"""Many units of one design: what they share, how they differ, and what changes over months."""

from .file import load_fleet
from .fleet import fleet
from .result import Fleet

__all__ = ["Fleet", "fleet", "load_fleet"]
