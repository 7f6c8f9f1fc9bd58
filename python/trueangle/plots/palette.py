"""Colours, markers and ink that survive colour blindness, grey print and dark pages.

Six hues of Okabe and Ito, the two light ones darkened or exchanged, so that each has a contrast
of 3 to 1 on white and on black. What must be distinguished in grey has a separate marker.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: What stays after correction.
AFTER: Final = "#0072B2"
#: What was there before: lighter than `AFTER` in grey.
BEFORE: Final = "#D07C00"
#: What is not retained, noise.
MUTED: Final = "#8C8C8C"
#: Thresholds and aliases.
WARNING: Final = "#D55E00"
#: Runs, in turn.
RUNS: Final = ("#0072B2", "#C77800", "#009E73", "#CC79A7", "#7A68C8", "#D55E00")
#: With the colours they make runs distinct beyond the first six.
MARKERS: Final = ("o", "s", "^", "D", "v", "P")

#: Names of the colours in the style of a page, which has lighter ones on dark paper.
ON_PAGE: Final = {
    "#000000": "model",
    **{colour.upper(): f"run-{number}" for number, colour in enumerate(RUNS)},
    AFTER: "after",
    BEFORE: "before",
    MUTED: "muted",
    WARNING: "warning",
}


def run_colour(number: int) -> str:
    """Colour of run ``number`` (from 0)."""
    return RUNS[number % len(RUNS)]


def run_marker(number: int) -> str:
    """Marker of run ``number``: with the colours another pair for each of the first 36."""
    return MARKERS[(number + number // len(RUNS)) % len(MARKERS)]


def ink(ax: Axes) -> str:
    """Black, or white on dark axes: models, limits and grids."""
    from matplotlib.colors import to_rgb

    # Mean of red, green and blue below which paper is dark.
    return "#FFFFFF" if sum(to_rgb(ax.get_facecolor())) < 1.5 else "#000000"
