"""Panels of a picture of readings: clouds of dots, medians, a magnified segment; draws nothing.

A picture is described once and drawn by `trueangle.plots.drawnreadings`, for a figure and for
a page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from ..support.arrays import Array
from .curves import ModelCurve, Points

#: What the colour of readings stands for: their run, or what was done to them.
Role: TypeAlias = Literal["run", "before", "after", "measured", "simulated"]

#: Title of an axis of angles.
ANGLE: Final = "reference angle / deg"

#: Periods of the segment that is shown beside an envelope.
_PERIODS: Final = 4.0
#: Bins of a running median, and the readings that make it worth its line.
_BINS, _ENOUGH = 36, 360


@dataclass(frozen=True)
class Cloud:
    """Readings of one run as dots.

    Attributes
    ----------
    points : Points
        Errors in the unit of the picture.
    run : int
        Number of the run, from 0.
    role : {"run", "before", "after", "measured", "simulated"}
    name : str
        For the legend, which has each name once.
    """

    points: Points
    run: int
    role: Role = "run"
    name: str = ""


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes
    ----------
    x, y : str
        Titles of the axes, with units.
    clouds : tuple of Cloud
    span : (float, float), optional
        What the x axis shows; by default what the readings cover.
    angles : bool
        The x axis has ticks at whole parts of a turn.
    model : ModelCurve, optional
        In the unit of the picture; ``dense`` where only its envelope can be drawn.
    medians : (ndarray, ndarray), optional
        Places and medians of the readings about them.
    zero : bool
        A line marks no error.
    title : str
        Of a segment that is shown larger.
    """

    x: str
    y: str
    clouds: tuple[Cloud, ...]
    span: tuple[float, float] | None = None
    angles: bool = True
    model: ModelCurve | None = None
    dense: bool = False
    medians: tuple[Array, Array] | None = None
    zero: bool = False
    title: str = ""


@dataclass(frozen=True)
class PanelPicture:
    """Panels, the main one first, and a sentence for who does not see them."""

    panels: tuple[Panel, ...]
    told: str


def magnified_segment(whole: Panel, order: float, model: ModelCurve | None = None) -> Panel:
    """A few periods of an order as large as they are, in the middle: both ends may be thin."""
    low, high = segment_span(whole, order)
    clouds = []
    for cloud in whole.clouds:
        points = cloud.points
        inside = (points.x >= low) & (points.x <= high)
        part = Points(points.label, points.x[inside], points.y[inside])
        clouds.append(replace(cloud, points=part))
    return replace(
        whole,
        clouds=tuple(clouds),
        span=(low, high),
        model=model,
        dense=False,
        title=f"A segment of {high - low:.3g}°: {_PERIODS:g} periods of order {order:g}",
    )


def segment_span(whole: Panel, order: float) -> tuple[float, float]:
    """First and last angle of `magnified_segment`."""
    assert whole.span is not None
    low, high = whole.span
    half = 0.5 * min(_PERIODS * 360.0 / order, high - low)
    return 0.5 * (low + high) - half, 0.5 * (low + high) + half


def binned_medians(parts: Sequence[Points]) -> tuple[Array, Array] | None:
    """Medians of readings in bins of x; None of few readings."""
    x = np.concatenate([part.x for part in parts])
    y = np.concatenate([part.y for part in parts])
    low, high = float(x.min()), float(x.max())
    if x.size < _ENOUGH or high <= low:
        return None
    edges = np.linspace(low, high, _BINS + 1)
    index = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, _BINS - 1)
    filled = [b for b in range(_BINS) if np.count_nonzero(index == b) >= _ENOUGH // _BINS // 2]
    return (
        np.array([float(x[index == b].mean()) for b in filled]),
        np.array([float(np.median(y[index == b])) for b in filled]),
    )
