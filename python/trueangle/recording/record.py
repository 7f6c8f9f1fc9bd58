"""Record sources until it is enough: the loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final, NamedTuple

from ..errors import ArgumentError, FileError
from ..support.layout import counted
from .arrivals import Arrivals
from .columns import Counts
from .lines import layout_of_pattern
from .output import RunsFile
from .recording import LiveRecording
from .screen import Screen
from .sources import SourceOptions, open_source

#: Seconds between two looks at what has arrived.
_TICK: Final = 0.05


class Choices(NamedTuple):
    """What is recorded, how, and until when.

    Attributes
    ----------
    signals : mapping of role to column
        Those of one of two sources under ``"a"`` and ``"b"``.
    counts : Counts
    options : SourceOptions
    pattern, label, send : str, optional
    append : bool
    rate, seconds : float, optional
    until : {"orders", "coverage"}, optional
    """

    signals: Mapping[str, Any]
    counts: Counts = Counts()
    options: SourceOptions = SourceOptions()
    pattern: str | None = None
    label: str | None = None
    send: str | None = None
    append: bool = False
    rate: float | None = None
    seconds: float | None = None
    until: str | None = None


class Recorded(NamedTuple):
    """A recording that has ended.

    Attributes
    ----------
    recording : LiveRecording
    ended : str
        ``"asked"``, ``"source"`` (before it was asked to end, or by a fault) or ``"stopped"``.
    """

    recording: LiveRecording
    ended: str


def record(
    addresses: Sequence[str],
    output: str | Path,
    choices: Choices,
    screen: Screen,
    stopped: Callable[[], bool] = lambda: False,
) -> Recorded:
    """Record one source, or two that are joined, into a file of runs.

    Parameters
    ----------
    addresses : sequence of str
        See `trueangle.recording.sources.open_source`.
    output : path
        CSV that holds whole rows at every moment; lines that are none are in ``OUTPUT.rejected``.
    choices : Choices
    screen : Screen
    stopped : callable
        Asked at every look whether the recording is to end.

    Returns
    -------
    Recorded

    Raises
    ------
    FileError, ArgumentError
        The output is there, a source cannot be opened, no row has come, or a column is missing.
    OSError
        A device or disk that fails at the start.
    """
    if len(addresses) > 2:
        raise ArgumentError(f"one source is recorded, or two are joined; got {len(addresses)}")
    layout = None if choices.pattern is None else layout_of_pattern(choices.pattern)
    file = RunsFile(Path(output), choices.label, choices.append)
    with ExitStack() as stack:
        stack.callback(file.close)
        arrivals, start = [], time.monotonic()
        for address in addresses:
            source = open_source(address, choices.options)
            arrivals.append(Arrivals(source, layout, start))
            stack.callback(arrivals[-1].close)
            if choices.send is not None:
                source.send(choices.send.encode())
        recording = LiveRecording(
            addresses,
            arrivals,
            file,
            choices.signals,
            choices.counts,
            choices.rate,
            choices.until,
        )
        ended = _followed(recording, choices, screen, stopped, start)
        for arrival in arrivals:
            arrival.close()
        while recording.is_behind:
            recording.take(time.monotonic() - start)
        recording.take(math.inf)  # what still waits for a reference has none
        screen.show(recording, time.monotonic() - start, ended)
    if not recording.rows and ended != "stopped":
        rejected = file.rejected
        kept = f" ({rejected.path})" if rejected.lines else ""
        raise FileError(
            addresses[0],
            f"no line that is a row has come, {counted(rejected.lines, 'line')} rejected{kept}; "
            "is it the right baud rate? Give `pattern=` where lines have another layout",
        )
    return Recorded(recording, ended)


def _followed(
    recording: LiveRecording,
    choices: Choices,
    screen: Screen,
    stopped: Callable[[], bool],
    start: float,
) -> str:
    """Take what arrives until the end; why it has ended."""
    while True:
        now = time.monotonic() - start
        recording.take(now)
        screen.show(recording, now)
        estimate, travel = recording.estimate, recording.travel
        if choices.seconds is not None and now >= choices.seconds:
            return "asked"
        if choices.until == "orders" and estimate is not None and estimate.is_settled:
            return "asked"
        if choices.until == "coverage" and travel is not None and travel.is_covered:
            return "asked"
        if recording.ended:
            broken = any(arrival.problem is not None for arrival in recording.arrivals)
            limited = choices.until is not None or choices.seconds is not None
            return "source" if broken or limited else "asked"
        if stopped():
            return "stopped"
        if not recording.is_behind:
            time.sleep(max(_TICK - (time.monotonic() - start - now), 0.001))
