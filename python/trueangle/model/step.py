"""What corrects one sample at a time, as a type."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Step"]


class Step(Protocol):
    """One corrected angle for one indicated one; signals that are not needed are ignored."""

    def __call__(
        self,
        indicated: float,
        /,
        velocity: float | None = None,
        temperature: float | None = None,
        torque: float | None = None,
        direction: float | None = None,
        current: float | None = None,
    ) -> float:
        """The true angle of an indicated one."""
