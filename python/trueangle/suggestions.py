"""Suggestions of what a mistyped word meant."""

from __future__ import annotations

from collections.abc import Iterable

__all__ = ["did_you_mean"]


def did_you_mean(got: str, known: Iterable[str]) -> str:
    """``; did you mean X?``, or nothing where no known word is near.

    Examples
    --------
    >>> did_you_mean("moter", ["output", "motor", "wave_generator"])
    '; did you mean motor?'
    >>> did_you_mean("elbow", ["output", "motor"])
    ''
    """
    import difflib  # needed only where something is wrong

    words = {word.lower(): word for word in reversed(list(known))}
    near = difflib.get_close_matches(got.lower(), words, n=1, cutoff=0.7)
    return f"; did you mean {words[near[0]]}?" if near else ""
