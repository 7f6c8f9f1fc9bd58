"""What is shown of a recording while it runs: a screen that is drawn anew, or objects in lines."""

from __future__ import annotations

import json
import sys
from collections import deque
from typing import Any, Final, TextIO

import numpy as np

from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, error_unit
from ..support.letterchart import letter_chart
from .recording import Recording

#: Seconds between two drawings, and over which the rate is taken.
_DRAWN: Final = {"text": 0.25, "json": 0.5, "none": 0.5}
_RATE: Final = 2.0
#: Letters of the cells of a turn by direction, and orders that are shown.
_MARKS: Final = ("forwards ", "backwards")
_SHOWN: Final = 6


class Screen:
    """The screen on a terminal, or one object a line.

    Parameters
    ----------
    style : {"auto", "text", "json", "none"}
        ``"auto"`` is text on a terminal and nothing elsewhere.
    errors_in : str or float
        Unit of errors in text.
    """

    def __init__(self, style: str, errors_in: ErrorsIn, stream: TextIO | None = None) -> None:
        found = sys.stderr if stream is None else stream
        # What redraws itself steers the terminal, which printed text must not.
        self._stream: TextIO = getattr(found, "steering", found)
        is_terminal = self._stream.isatty()
        self.style = style if style != "auto" else "text" if is_terminal else "none"
        self._redraws = self.style == "text" and is_terminal
        self._errors_in = errors_in
        self._drawn, self._lines = -1.0, 0
        self._counts: deque[tuple[float, int]] = deque([(0.0, 0)])
        self._began = False

    def show(self, recording: Recording, now: float, ended: str | None = None) -> None:
        """Draw, where it is time to, at the first reading, or where the recording has ended."""
        first = recording.rows > 0 and not self._began
        if not (first or ended) and now - self._drawn < _DRAWN[self.style]:
            return
        self._began |= first
        self._drawn = now
        if recording.estimate is not None:
            recording.estimate.update()
        new = recording.new_faults(now, ended is not None)
        self._counts.append((now, recording.rows))
        while len(self._counts) > 2 and now - self._counts[1][0] >= _RATE:
            self._counts.popleft()
        then, rows = self._counts[0]
        rate = (recording.rows - rows) / max(now - then, 1e-9)
        if self.style == "json":
            state = {"rate_hz": round(rate, 3), **recording.to_dict(now), "ended": ended}
            self._stream.write(json.dumps(state) + "\n")
        elif self.style == "text":
            self._draw(self.lines(recording, now, rate))
        if not self._redraws and self.style != "json":
            for name, says in new.items():
                self._stream.write(f"trueangle: warning: {name}: {says}\n")
        self._stream.flush()

    def _draw(self, lines: list[str]) -> None:
        above = f"\x1b[{self._lines}F\x1b[J" if self._redraws and self._lines else ""
        self._stream.write(above + "".join(f"{line}\n" for line in lines))
        self._lines = len(lines)

    def lines(self, recording: Recording, now: float, rate: float) -> list[str]:
        """The screen."""
        rejected = recording.file.rejected.lines
        layouts = [arrival.layout for arrival in recording.arrivals]
        kinds = "; ".join(f"{x.kind}: {', '.join(x.names)}" for x in layouts if x is not None)
        lines = [
            f"{recording.file.rows.path}  run {recording.file.label}  {now:.1f} s  "
            f"{recording.rows} readings  {rate:.1f}/s  {rejected} lines rejected",
            f"lines     {kinds or 'waiting for three that agree'}",
        ]
        travel = recording.travel
        if travel is not None and recording.rows:
            for row, mark in enumerate(_MARKS):
                cells = "".join("#" if count else "." for count in travel.cells[row].tolist())
                lines.append(f"{mark} [{cells}] {360.0 * travel.covered[row]:.0f} deg")
            slow, fast = (360.0 * speed for speed in travel.speeds)
            speeds = f"{slow:.3g} to {fast:.3g} deg/s" if fast else "none yet"
            lines.append(f"travelled {travel.turns:.2f} turns  speed {speeds}")
        lines += self._estimate(recording)
        lines.append(f"missing   {recording.missing or 'nothing: end with Ctrl-C'}")
        lines += [f"FAULT     {name}: {says}" for name, says in recording.faults.items()]
        return [line[:200] for line in lines]

    def _estimate(self, recording: Recording) -> list[str]:
        estimate, lines = recording.estimate, []
        if estimate is None:
            return []
        scale = arcsec(1.0, recording.period)
        places, error = estimate.curve
        if error.size > 1:
            shown = error_unit(self._errors_in, scale * float(np.ptp(error)))
            curve: Any = {"o": scale * error}
            lines = letter_chart(360.0 * places, curve, "arcsec")
            lines.append(f"error     {shown.text(scale * float(np.ptp(error)))} peak-to-peak")
        for order in estimate.orders[:_SHOWN]:
            size, std = scale * order.amplitude, scale * order.std
            lines.append(
                f"order {order.order:3d} {error_unit(self._errors_in, size).text(size, std)} at "
                f"{order.phase_deg:.0f} deg"
            )
        if estimate.turns and not estimate.orders:
            lines.append("orders    none above the noise")
        return lines
