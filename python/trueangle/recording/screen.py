"""What is shown of a recording while it runs: a screen that is refreshed, or objects in lines."""

from __future__ import annotations

import json
import sys
from collections import deque
from typing import Final, TextIO

from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, error_unit
from ..support.layout import counted, laid_out
from ..support.letterchart import letter_chart
from .recording import LiveRecording

#: Seconds between two drawings, and drawings over which the rate is taken.
_DRAWN: Final = {"text": 0.25, "json": 0.5, "none": 0.5}
#: Letters of the cells of a turn by direction, and orders that are shown.
_MARKS: Final = ("forwards ", "backwards")


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
        self._stream: TextIO = sys.stderr if stream is None else stream
        is_terminal = self._stream.isatty()
        self.style = style if style != "auto" else "text" if is_terminal else "none"
        self._redraws = self.style == "text" and is_terminal
        self._errors_in = errors_in
        self._drawn, self._lines = -1.0, 0
        # Drawings over which the rate is taken.
        self._counts: deque[tuple[float, int]] = deque([(0.0, 0)], 9)

    def show(self, recording: LiveRecording, now: float, ended: str = "") -> None:
        """Draw, where it is time to, at the first reading, or where the recording has ended."""
        is_first = recording.rows > 0 == self._counts[-1][1]
        if not (is_first or ended) and now - self._drawn < _DRAWN[self.style]:
            return
        self._drawn = now
        new = recording.new_faults(now, bool(ended))
        self._counts.append((now, recording.rows))
        then, rows = self._counts[0]
        rate = (recording.rows - rows) / max(now - then, 1e-9)
        lines = []
        if self.style == "json":
            state = {"rate_hz": round(rate, 3), **recording.to_dict(now), "ended": ended or None}
            lines.append(json.dumps(state))
        elif self.style == "text":
            lines += self.lines(recording, now, rate)
        if not self._redraws and self.style != "json":
            lines += [f"trueangle: warning: {name}: {says}" for name, says in new.items()]
        if self._redraws and self._lines:
            # What redraws itself steers the terminal, which printed text must not.
            steering = getattr(self._stream, "steering", self._stream)
            steering.write(f"\x1b[{self._lines}F\x1b[J")
        # Lines that a terminal breaks by itself would be too few to draw over.
        text = laid_out(lines) if self._redraws else "\n".join(lines)
        self._lines = text.count("\n") + 1
        self._stream.write(f"{text}\n" if lines else "")
        self._stream.flush()

    def lines(self, recording: LiveRecording, now: float, rate: float) -> list[str]:
        """The screen."""
        head, *told = self.summary(recording)
        lines = [f"{now:.1f} s  {rate:.1f}/s  {head}"]
        estimate = recording.estimate
        if estimate.cells.any():
            for mark, read, share in zip(_MARKS, estimate.cells, estimate.covered, strict=True):
                cells = "".join("#" if two.all() else "." for two in read.reshape(-1, 2))
                lines.append(f"{mark} [{cells}] {360.0 * share:.0f} deg")
            slow, fast = (360.0 * speed for speed in estimate.speeds)
            speeds = f"{slow:.3g} to {fast:.3g} deg/s" if fast else "none yet"
            lines.append(f"travelled {estimate.travelled:.2f} turns  speed {speeds}")
        places, error = estimate.curve
        if error.any():
            size = arcsec(1.0, estimate.period) * error
            lines += letter_chart(360.0 * places, {"o": size}, "arcsec")
        return [*lines, *told]

    def summary(self, recording: LiveRecording) -> list[str]:
        """What was recorded, and what it shows."""
        file, estimate = recording.file, recording.estimate
        lines = [
            f"{file.rows.path}: {counted(recording.rows, 'reading')} in run {file.label}, "
            f"{file.rejections}"
        ]
        for address, arrival in recording.arrivals.items():
            if arrival.layout is not None:
                names = ", ".join(arrival.layout.names)
                lines.append(f"{address}: {arrival.layout.kind}, columns {names}")
            if arrival.problem is not None:
                lines.append(f"{address}: ended by a fault: {arrival.problem}")
        if recording.unpaired:
            lines.append(f"{counted(recording.unpaired, 'reading')} without a reference")
        if recording.jitter >= 0.0:
            lines.append(f"times are those of arrival, jitter {1e3 * recording.jitter:.2g} ms")
        for order in estimate.orders[:6]:
            size = order.amplitude_arcsec
            shown = error_unit(self._errors_in, size).text(size, order.std_arcsec)
            lines.append(f"order {order.order:3d}  {shown} at {order.phase_deg:.0f} deg")
        if estimate.turns > 1 and not (estimate.orders or recording.note):
            lines.append("no order above the noise")
        lines += [f"fault {name}: {says}" for name, says in recording.faults.items()]
        return [*lines, f"missing: {recording.missing or 'nothing'}"]
