"""A warning when corrected angles leave the stretch a model was fitted on."""

from __future__ import annotations

import warnings
from typing import TypeAlias

from ..errors import OutsideSpanWarning

__all__ = ["SpanGuard", "Stretch"]

#: Start, stop, and whether every turn looks the same.
Stretch: TypeAlias = tuple[float, float, bool]


class SpanGuard:
    """Warns once when corrected angles leave the stretch a model was fitted on.

    The core counts them while it corrects.
    """

    def __init__(self, span: tuple[float, float] | None, repeats: bool = True) -> None:
        #: What the core is to look at; None where there is nothing to say (any more).
        self.stretch: Stretch | None = None if span is None else (*span, repeats)

    def __call__(self, outside: int, total: int) -> None:
        """Tell of ``outside`` of ``total`` angles; says nothing more once it has warned."""
        if not outside or self.stretch is None:
            return
        start, stop, _ = self.stretch
        self.stretch = None
        warnings.warn(
            f"{outside} of {total} corrected angles lie outside the {start:.6g} to {stop:.6g} "
            "the model was fitted on: there it is extrapolated and may be far off (reported "
            "once per model)",
            OutsideSpanWarning,
            stacklevel=3,
        )
