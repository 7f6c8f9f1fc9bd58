"""Suggestions of what a mistyped word meant; choices checked and names listed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice

from ..errors import ArgumentError, KindError


def listed_names(names: Sequence[str], most: int = 12) -> str:
    """The first names, and how many more there are.

    Examples
    --------
    >>> listed_names(["a", "b", "c"], most=2)
    'a, b and 1 more'
    """
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


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

    # A wide log has thousands of names: a search through more of them rarely finds one.
    # Known words that are compared, at most.
    words = {word.lower(): word for word in reversed(list(islice(known, 2000)))}
    near = difflib.get_close_matches(got.lower(), words, n=3, cutoff=0.6)
    # Words are begun right more often than ended right: who types arduino means no mechaduino.
    begun = [w for size in (2, 1) for w in near if w[:size] == got.lower()[:size]]
    return f"; did you mean {words[begun[0]]}?" if begun else ""


def check_choice(name: str, got: object, known: Iterable[str]) -> str:
    """``got``, where it is one of the words that an argument may be.

    Raises
    ------
    ArgumentError
        It is none of them; the message lists them, and suggests the nearest.

    Examples
    --------
    >>> check_choice("loop", "opne", ("open", "closed"))
    Traceback (most recent call last):
    ...
    trueangle.errors.ArgumentError: loop must be one of open, closed, got 'opne'; did you mean open?
    """
    words = known if isinstance(known, tuple) else tuple(known)
    if isinstance(got, str) and got in words:
        return got
    kind = ArgumentError if isinstance(got, str) else KindError
    near = did_you_mean(got, words) if isinstance(got, str) else ""
    raise kind(f"{name} must be one of {', '.join(words)}, got {got!r:.60}{near}")
