"""Colours where a terminal has them; ``NO_COLOR`` (https://no-color.org) turns them off."""

from __future__ import annotations

import os
import re
from typing import Any, Final

__all__ = ["coloured", "has_colours"]

#: What stands out in a text, and how: bold, red, yellow, green. Words say all that colours do.
_RULES: Final = tuple(
    (re.compile(pattern, re.MULTILINE), code)
    for pattern, code in (
        (r"\berror:|\bNOT UNDERSTOOD\b|\bNO ORDER RETAINED\b|\bDISAGREE\b", "1;31"),
        (r"\bwarning:|^ *! |\bNOT CONFIRMED\b|^Listed and not confirmed:", "33"),
        (r"^Confirmed:|\bretained$|^Nothing beyond the simulation:|^No fault found", "32"),
        (r"^\d+\. .*|^[A-Z][^\n]*:$|did you mean [^\n?]+\?", "1"),
    )
)


def has_colours(stream: Any) -> bool:
    """Whether a stream is a terminal that takes colours, and nobody said that it should not."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def coloured(text: str) -> str:
    r"""``text`` with what stands out in colour; JSON stays as it is.

    Examples
    --------
    >>> coloured("trueangle: error: no such file")
    'trueangle: \x1b[1;31merror:\x1b[0m no such file'
    >>> coloured('{"says": "error:"}')
    '{"says": "error:"}'
    """
    if text[:1] in ("{", "["):
        return text
    for pattern, code in _RULES:
        text = pattern.sub(f"\x1b[{code}m\\g<0>\x1b[0m", text)
    return text
