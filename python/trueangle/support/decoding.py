"""Decoding of files: any text gives checked values, or an error with its place."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .files import read_whole, refuse_own

T = TypeVar("T")

#: Highest order of the output, in cycles per output turn: the lines of a disc of a million.
MAX_ORDER = 1_000_000.0
#: Harmonics, at most, of a model or simulation.
MAX_LINES = 65_536
#: Highest order times number of harmonics: checks sample each several times in a cycle.
MAX_LINE_ORDERS = 1e7


def shown_value(value: Any, most: int = 60) -> str:
    """``value`` as messages show it: in one piece, of bounded length, as files have it.

    Examples
    --------
    >>> shown_value(None), shown_value(True), shown_value([1, "a"])
    ('null', 'true', "[1, 'a']")
    """
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # whole numbers of thousands of digits
        return f"a {type(value).__name__} too large to show"
    return text if len(text) <= most else f"{text[: most - 4]} ..."


def finite_float(value: Any) -> float | None:
    """``value`` as a float, or None where it is no finite number; true is not a number."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


def read_text(path: str | PathLike[str], most: int, kind: type[FileError], what: str) -> str:
    """The text of a file of at most ``most`` bytes.

    Raises
    ------
    FileError
        It is not UTF-8, larger, or no file: no ``what`` is.
    """
    data = read_whole(path, most, what)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as cause:
        line = data.count(b"\n", 0, cause.start) + 1
        raise kind(path, f"is not {what}: not UTF-8 text", line=line) from None


def toml_value(path: str | PathLike[str], text: str, what: str) -> dict[str, Any]:
    """The tables of a TOML text.

    Raises
    ------
    FileError
        Names the line where the text ends being TOML.
    """
    import tomllib  # with its parser some milliseconds, and most commands read none

    refuse_own(path, text[:4096].encode(), what)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as cause:
        refuse_other(path, text, what, "[#")
        raise FileError(path, f"not a TOML file: {cause}") from None
    except (ValueError, RecursionError):  # whole numbers of thousands of digits, lists in lists
        raise FileError(path, "holds a number, date or list that cannot be read") from None


def refuse_other(
    path: str | PathLike[str], text: str, what: str, first: str, kind: type[FileError] = FileError
) -> None:
    """Refuse text that is another file of this package, or that begins with none of ``first``."""
    refuse_own(path, text[:4096].encode(), what)
    if (begin := text.lstrip()[:1]) and begin not in first:
        problem = f"is not {what} (it begins with {begin!r})"
        raise kind(path, f"{problem}; for readings: trueangle check {path}")


def json_value(path: Path, text: str, kind: type[FileError], what: str) -> Any:
    """The value of a JSON text whose keys are unique and whose numbers are finite.

    Raises
    ------
    FileError
        Names the line where the text ends being JSON, or the key at fault.
    """

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        found = dict(items)
        if len(found) < len(items):
            seen: set[str] = set()
            for key, _value in items:
                if key in seen:
                    raise kind(path, f"key {shown_value(key)}: appears twice; keep one")
                seen.add(key)
        return found

    def constant(name: str) -> float:
        raise kind(path, f"holds {name}; every number must be finite")

    try:
        return json.loads(text, object_pairs_hook=pairs, parse_constant=constant)
    except json.JSONDecodeError as cause:
        if not text.lstrip().startswith("{"):  # else JSON that is cut off
            refuse_other(path, text, what, "[", kind)
        raise kind(
            path,
            f"is not complete JSON ({cause.msg}): truncated or not {what}; save it again",
            line=cause.lineno,
        ) from None
    except RecursionError:
        raise kind(path, f"is not {what}: nested too deeply") from None
    except FileError:
        raise
    except ValueError:  # whole numbers of thousands of digits
        raise kind(
            path, "holds a number of thousands of digits, which cannot be read; write fewer"
        ) from None


class Entries:
    """Entries of one object, read one by one: a refusal names the object and the key."""

    def __init__(self, table: Mapping[str, Any], key: str) -> None:
        self._table, self._key = table, key

    def __call__(self, read: Callable[[Any, str], T], name: str) -> T:
        """The entry called ``name``, as ``read`` checks it."""
        return read(self._table[name], f"{self._key}.{name}")


class Decoder:
    """Checks plain values of one file; every refusal names the file and the key.

    Parameters
    ----------
    path : Path
    kind : type of FileError
        What is raised.
    """

    def __init__(self, path: Path, kind: type[FileError] = FileError) -> None:
        self.path = path
        self.kind = kind

    def error(self, problem: str, key: str | None = None) -> FileError:
        """The error that reports ``problem`` of ``key``."""
        return self.kind(self.path, f"key '{key}': {problem}" if key else problem)

    def table(
        self, value: Any, known: Mapping[str, bool], key: str | None = None
    ) -> dict[str, Any]:
        """An object with the keys ``known``, each needed where its value there is true."""
        if not isinstance(value, dict):
            raise self.error(f"an object is needed, got {shown_value(value)}", key)
        where = f"{key}." if key else ""
        for name in value:
            if name not in known:
                raise self.error(
                    f"is unknown; the keys are {', '.join(known)}",
                    f"{where}{shown_value(name)[1:-1]}",
                )
        for name, needed in known.items():
            if needed and name not in value:
                raise self.error("is missing", f"{where}{name}")
        return value

    def entries(self, value: Any, names: Iterable[str], key: str) -> Entries:
        """The entries of an object that has all of these keys and no others."""
        return Entries(self.table(value, dict.fromkeys(names, True), key), key)

    def items(self, value: Any, key: str, what: str, most: int = MAX_LINES) -> list[Any]:
        """A list of at most ``most``."""
        if not isinstance(value, list):
            raise self.error(f"a list of {what} is needed, got {shown_value(value)}", key)
        if len(value) > most:
            raise self.error(f"holds {len(value)} {what}; at most {most} are allowed", key)
        return value

    def number(self, value: Any, key: str) -> float:
        """A finite number."""
        number = finite_float(value)
        if number is None:
            is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
            wanted = "a finite number within double range" if is_number else "a number"
            raise self.error(f"{wanted} is needed, got {shown_value(value)}", key)
        return number

    def numbers(self, value: Any, key: str, most: int = MAX_LINES) -> tuple[float, ...]:
        """A list of finite numbers."""
        found = self.items(value, key, "numbers", most)
        return tuple(self.number(entry, f"{key}[{i}]") for i, entry in enumerate(found))

    def whole(self, value: Any, key: str, least: int = 0, most: int = 2**53) -> int:
        """A whole number from ``least`` to ``most``."""
        number = finite_float(value)
        if number is None or number != math.floor(number) or not least <= number <= most:
            raise self.error(
                f"a whole number from {least} to {most} is needed, got {shown_value(value)}", key
            )
        return int(number)

    def text(self, value: Any, key: str) -> str:
        """A text."""
        if not isinstance(value, str):
            raise self.error(f"a text is needed, got {shown_value(value)}", key)
        return value


def parsed_time(text: str | None) -> datetime | None:
    """The date and time that a text holds; None where it is none.

    Examples
    --------
    >>> parsed_time("2026-11-21T08:30Z"), parsed_time("12.5")
    (datetime.datetime(2026, 11, 21, 8, 30, tzinfo=datetime.timezone.utc), None)
    """
    text = (text or "").strip()
    if "-" not in text[1:] and ":" not in text:  # 20261121 is a number
        return None
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None


def local_day(text: str | None) -> str:
    """The day of a date and time, as its own zone counts it; nothing of what is none.

    Examples
    --------
    >>> local_day("2026-11-21 23:30+01:00"), local_day("spring")
    ('2026-11-21', '')
    """
    found = parsed_time(text)
    return "" if found is None else found.date().isoformat()


def elapsed_seconds(texts: Sequence[str | None]) -> tuple[NDArray[np.float64], int | None]:
    """Seconds from the first, NaN for what is empty, and the first place of what is no time.

    Examples
    --------
    >>> elapsed_seconds(["2026-11-21T00:00:00", "2026-11-21T00:00:01.5", None])
    (array([0. , 1.5, nan]), None)
    """
    found = np.full(len(texts), np.nan)
    first: datetime | None = None
    for i, text in enumerate(texts):
        if text is None or not str(text).strip():
            continue
        time = parsed_time(str(text))
        first = first or time
        if time is None or first is None or (time.tzinfo is None) != (first.tzinfo is None):
            return found, i
        found[i] = (time - first).total_seconds()
    return found, None
