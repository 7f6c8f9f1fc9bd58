"""Dates, days and times as ISO 8601 writes them, with or without zone; seconds that elapsed."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

import numpy as np
from numpy.typing import NDArray


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
