"""Charts of a page read back: what is drawn, in the numbers of its axes."""

from __future__ import annotations

import re
from html import unescape
from typing import Any, NamedTuple

import numpy as np

from trueangle.plots.pagechart import SIDE

_PATH = re.compile(
    r'<path(?: data-run="(\d+)")? style="([^"]*)" d="([^"]*)"'
    r"(?:/>|><title>(.*?)</title></path>)"
)


class Stroke(NamedTuple):
    """One path: ``points`` (N, 2) on the axes, or the dots of one look."""

    run: int | None
    title: str
    style: dict[str, str]
    points: np.ndarray[Any, Any]
    #: ``area``, ``line`` or ``dots``.
    kind: str


def strokes(chart: dict[str, Any]) -> list[Stroke]:
    """Everything drawn but the grid, from the back to the front; without fillings of rings."""
    found = []
    for run, style, d, title in _PATH.findall(chart["svg"]):
        looks = dict(part.split(":", 1) for part in style.split(";"))
        if looks.get("stroke") == "var(--back)":
            continue
        places = np.array(_vertices(d), dtype=float).reshape(-1, 2) / SIDE
        points = np.column_stack(
            [_number(chart["x"], places[:, 0]), _number(chart["y"], 1.0 - places[:, 1])]
        )
        kind = "dots" if re.search("h[01]|l2 2", d) else "area" if "fill" in looks else "line"
        found.append(Stroke(int(run) if run else None, unescape(title), looks, points, kind))
    return found


def _number(axis: dict[str, Any], part: Any) -> Any:
    low, high = axis["limits"]
    if axis["scale"] == "log":
        return low * (high / low) ** part
    return low + (high - low) * part


def _vertices(d: str) -> list[tuple[int, int]]:
    """Absolute places of a path; of a dot its middle."""
    at, found = (0, 0), []
    for command, text in re.findall(r"([MLmlhvZ])([^MLmlhvZ]*)", d):
        numbers = [int(n) for n in re.findall(r"-?\d+", text)]
        if command in "ML":
            at = (numbers[0], numbers[1])
        elif command in "mlh":
            at = (at[0] + numbers[0], at[1] + (0 if command == "h" else numbers[1]))
        if command in "MLm":
            found.append(at)
    return found
