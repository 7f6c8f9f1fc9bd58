"""Sources for the tests of recordings: bytes given by hand, and joints that send lines."""

import itertools
import time

import numpy as np
import pytest

from trueangle.recording.arrivals import Arrivals
from trueangle.recording.output import RunsFile
from trueangle.recording.recording import Choices, LiveRecording
from trueangle.recording.sources import Source, SourceOptions


def given(data, sizes=(1 << 16,), pattern=None):
    """Arrivals of bytes that come in pieces of these sizes, one a read, all of them read."""
    cuts = np.cumsum([0, *itertools.islice(itertools.cycle(sizes), len(data) // min(sizes) + 1)])
    pieces = iter([data[a:b] for a, b in itertools.pairwise(cuts) if a < len(data)])
    source = Source(lambda: next(pieces, None), lambda: None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("trueangle.recording.arrivals.open_source", lambda *_: source)
        arrivals = Arrivals("given", SourceOptions(pattern=pattern), time.monotonic())
    while not arrivals.is_over:
        time.sleep(0.001)
    return arrivals


def arrived(data, pattern=None, sizes=(1 << 16,)):
    """Rows and rejected lines of bytes that arrive in pieces of these sizes."""
    arrivals, values, times, behind = given(data, sizes, pattern), [], [], True
    while behind:
        behind = arrivals.is_behind
        if arrivals.look():
            rows = arrivals.take()
            values += rows.values.tolist()
            times += rows.time.tolist()
    return arrivals, np.array(values), np.array(times)


def recorded(path, lines, signals=None, counts=(None, None), sizes=(1 << 16,), **options):
    """A recording of lines, or bytes in pieces of these sizes, that are there at once."""
    text = lines if isinstance(lines, bytes) else "".join(f"{line}\n" for line in lines).encode()
    arrivals = given(text, sizes)
    file = RunsFile(path, options.pop("label", None), options.pop("append", False))
    choices = Choices(signals or {}, SourceOptions(), counts, **options)
    recording = LiveRecording({"given": arrivals}, file, choices)
    recording.take(0.0)
    while recording.is_behind:
        recording.take(0.0)
    file.close()
    return recording


def joint_lines(turns, per_turn=500, noise=0.01, seed=1, back=False):
    """Lines of a joint with orders 1 and 2, ``reference_deg,indicated_deg``."""
    rng = np.random.default_rng(seed)
    angle = np.arange(int(turns * per_turn)) * 360.0 / per_turn
    if back:
        angle = np.concatenate([angle, angle[::-1]])
    x = np.radians(angle)
    error = 0.5 * np.cos(x) + 0.2 * np.sin(2.0 * x) + rng.normal(0.0, noise, x.size)
    rows = zip((angle % 360.0).tolist(), ((angle + error) % 360.0).tolist(), strict=True)
    return ["reference_deg,indicated_deg", *(f"{a:.5f},{b:.5f}" for a, b in rows)]
