"""Arguments that must be of one type, or lists of such: refused at the door by what they are."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from ..errors import KindError

__all__ = ["all_of_type", "of_type"]

T = TypeVar("T")

#: Characters of a value that a message repeats.
_SHOWN = 60


def of_type(
    what: str, value: object, kind: type[T], wanted: str, instead: Callable[[Any], str] = str
) -> T:
    """``value``, which must be a ``kind``.

    Parameters
    ----------
    what : str
        The argument, for the message.
    value : object
    kind : type
    wanted : str
        What must be given, in words.
    instead : callable, optional
        What is meant where such a value is given, or nothing.

    Raises
    ------
    KindError
        It is something else: names what was got and what is wanted.
    """
    if isinstance(value, kind):
        return value
    meant = "" if instead is str else instead(value)
    told = f"{what} must be {wanted}, got {_told(value)}"
    raise KindError(f"{told}; {meant}" if meant else told)


def all_of_type(
    what: str,
    values: Iterable[Any],
    kind: type[T],
    wanted: str,
    instead: Callable[[Any], str] = str,
) -> tuple[T, ...]:
    """``values`` as a tuple, each of which must be a ``kind``; see `of_type`.

    Examples
    --------
    >>> all_of_type("sizes", [1, 2], int, "a whole number")
    (1, 2)
    """
    if not isinstance(values, Iterable) or isinstance(values, str | kind):
        raise KindError(f"{what} must be a list, each {wanted}, got {_told(values)}")
    found = tuple(values)
    for i, value in enumerate(found):
        of_type(f"{what}[{i}]", value, kind, wanted, instead)
    return found


def _told(value: object) -> str:
    """What a value is, in few words."""
    shown = " ".join(repr(value).split())
    if len(shown) > _SHOWN:
        shown = shown[: _SHOWN - 3] + "..."
    noun = getattr(type(value), "noun", "")
    if noun:
        return f"{noun}, {shown}"
    name = type(value).__name__
    return shown if shown.startswith(name) else f"{name} {shown}"
