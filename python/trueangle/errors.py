"""What can go wrong: every error is a `ValueError` that states where and what to do."""

from __future__ import annotations

import sys
from typing import Any

__all__ = [
    "ArgumentError",
    "EmptyCellsWarning",
    "FileError",
    "KindError",
    "LargeModelWarning",
    "MessageLinesWarning",
    "MissingExtraError",
    "MissingSignalError",
    "ModelFileError",
    "NoCurveError",
    "NoModelError",
    "NoOrderError",
    "NotCorrectedWarning",
    "NotInvertibleError",
    "OtherSheetsWarning",
    "OutsideSpanWarning",
    "RankError",
    "TrueAngleError",
    "UnitWarning",
    "UnlikeRunsWarning",
    "UnreadColumnWarning",
    "level_of_caller",
]


#: Characters of a message, at most: a file may name thousands of columns.
_LONGEST = 2000


def shortened(text: str) -> str:
    """A message of bounded length: its beginning and its end, where the remedy is.

    Examples
    --------
    >>> len(shortened(30_000 * "x")) < 2100
    True
    """
    if len(text) <= _LONGEST:
        return text
    kept = _LONGEST // 2
    return f"{text[:kept]} ... ({len(text) - 2 * kept} characters) ... {text[-kept:]}"


def printable(text: str) -> str:
    r"""A message in one line of characters that a terminal shows: files hold others, and name them.

    Examples
    --------
    >>> printable("column 'a" + chr(27) + "[2J'")
    "column 'a\\x1b[2J'"
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class TrueAngleError(ValueError):
    """Base of every error that trueangle raises on bad input."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*(shortened(a) if isinstance(a, str) else a for a in arguments))


class ArgumentError(TrueAngleError):
    """An argument is out of range, not finite, of the wrong length or kind."""


class KindError(ArgumentError, TypeError):
    """An argument is of a kind that is not a number, or not the one that is wanted."""


class RankError(TrueAngleError):
    """The readings cannot separate the requested unknowns.

    Attributes
    ----------
    orders : list of (int, int)
        ``(shaft, order)`` of the harmonics at fault.
    """

    def __init__(self, message: str, orders: list[tuple[int, int]] | None = None) -> None:
        super().__init__(message)
        self.orders = list(orders or ())


class NotInvertibleError(TrueAngleError):
    """The error's slope reaches 1: an indicated angle represents several true angles.

    Attributes
    ----------
    slope : float
        The greatest ``|d error / d angle|`` the model may reach.
    """

    def __init__(self, message: str, slope: float = float("nan")) -> None:
        super().__init__(message)
        self.slope = slope


class NoModelError(TrueAngleError):
    """No model is supported by the data; the message states why."""


class NoOrderError(NoModelError):
    """The data support no order at all."""


class NoCurveError(NoModelError):
    """Channels of a sensor that draw no curve; the message states why and what to do."""


class MissingSignalError(TrueAngleError):
    """The model needs a signal (velocity, temperature, ...) that was not given."""


class FileError(TrueAngleError):
    """A file that cannot be used.

    The message reads ``file, line n, column 'c': what was got; what to do``.

    Attributes
    ----------
    path : str
    problem : str
        What was got and what to do, without the place.
    line : int or None
        Counted from 1, the header being line 1.
    column : str or None
    """

    def __init__(
        self,
        path: object,
        problem: str,
        *,
        line: int | None = None,
        column: str | None = None,
    ) -> None:
        self.path = str(path)
        self.line = line
        self.column = column
        place = [self.path]
        if line is not None:
            place.append(f"line {line}")
        if column is not None:
            place.append(f"column '{column}'")
        super().__init__(printable(f"{', '.join(place)}: {problem}"))
        self.problem = printable(problem)

    def __reduce__(self) -> tuple[Any, ...]:  # workers of a cluster send errors home
        return _file_error, (type(self), self.path, self.problem, self.line, self.column)


def _file_error(
    kind: type[FileError], path: str, problem: str, line: int | None, column: str | None
) -> FileError:
    return kind(path, problem, line=line, column=column)


class ModelFileError(FileError):
    """A model file that is damaged, of a later version, or holds impossible values."""


class MissingExtraError(TrueAngleError, ImportError):
    """An optional dependency is not installed; the message states how to install it."""


class EmptyCellsWarning(UserWarning):
    """Rows of a file were omitted since a cell of theirs is empty."""


class MessageLinesWarning(UserWarning):
    """Lines of a text file that hold no readings were omitted."""


class OtherSheetsWarning(UserWarning):
    """Sheets of an Excel file were omitted: the first that holds cells is read."""


class OutsideSpanWarning(UserWarning):
    """Angles outside the span the model was fitted on were corrected."""


class UnitWarning(UserWarning):
    """Angles look like another unit than the one they are confused with, or a channel is dead."""


class NotCorrectedWarning(UserWarning):
    """Angles are passed on as they are, since the readings support no order."""


class UnlikeRunsWarning(UserWarning):
    """Runs that do not show one pattern were fitted together; the message names them."""


class UnreadColumnWarning(UserWarning):
    """A column with the name of a role was ignored: it holds what that role cannot be."""


class LargeModelWarning(UserWarning):
    """A model was saved without its covariance, which no file that is read back can hold."""


def level_of_caller() -> int:
    """``stacklevel`` of `warnings.warn` for the first line outside this package."""
    package = __name__.partition(".")[0]
    level, frame = 1, sys._getframe(1)
    while frame.f_back is not None and frame.f_globals["__name__"].partition(".")[0] == package:
        level, frame = level + 1, frame.f_back
    return level
