"""A running joint against its model: windows, charts, alarms."""

from .monitor import Monitor

__all__ = ["Monitor"]
