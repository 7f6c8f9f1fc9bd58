"""Colours that colour-blind readers can tell apart (Okabe and Ito), and what they mean."""

from __future__ import annotations

from typing import Final

__all__ = ["AFTER", "BEFORE", "MARKERS", "MODEL", "MUTED", "RUNS", "WARNING", "run_colour"]

#: Models and what stays after correction.
MODEL: Final = "#000000"
AFTER: Final = "#0072B2"
#: What was there before.
BEFORE: Final = "#E69F00"
#: What is not retained, grids, noise.
MUTED: Final = "#8C8C8C"
#: Thresholds and aliases.
WARNING: Final = "#D55E00"
#: Runs, in turn.
RUNS: Final = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00")
#: With the colours they make runs distinct beyond the first six.
MARKERS: Final = ("o", "s", "^", "D", "v", "P")


def run_colour(number: int) -> str:
    """Colour of run ``number`` (from 0)."""
    return RUNS[number % len(RUNS)]
