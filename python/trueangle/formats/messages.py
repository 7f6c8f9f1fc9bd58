"""Lines of a text that hold no readings: what a firmware says among its numbers."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

from ..errors import MessageLinesWarning

#: Characters of a message that are shown.
_SHOWN = 60


def warn_of_messages(path: Path, messages: Sequence[tuple[int, str]]) -> None:
    """Say how many lines hold no readings, and the first of them, by its number and words."""
    if messages:
        line, text = min(messages)
        one = len(messages) == 1
        warnings.warn(
            f"{path}: {len(messages)} line{'' if one else 's'} of words "
            f"{'is' if one else 'are'} no reading{'' if one else 's'} and left out, the first at "
            f"line {line}: {text[:_SHOWN]!r}",
            MessageLinesWarning,
            stacklevel=9,
        )
