"""Sources for the tests of recordings: bytes given by hand, and joints that send lines."""

import time

import numpy as np

from trueangle.recording.arrivals import Arrivals
from trueangle.recording.output import RunsFile
from trueangle.recording.recording import Choices, LiveRecording
from trueangle.recording.sources import SourceOptions


class Given:
    """A source that gives pieces of bytes, one a read, and ends."""

    midway, names = False, ()

    def __init__(self, pieces):
        self.pieces, self.sent = list(pieces), b""

    def read(self):
        return self.pieces.pop(0) if self.pieces else None

    def send(self, data):
        self.sent += data

    def close(self):
        pass


def arrived(data, pattern=None, sizes=(1 << 16,)):
    """Rows and rejected lines of bytes that arrive in pieces of these sizes."""
    pieces, at, i = [], 0, 0
    while at < len(data):
        pieces.append(data[at : at + sizes[i % len(sizes)]])
        at += sizes[i % len(sizes)]
        i += 1
    arrivals = Arrivals(Given(pieces), SourceOptions(pattern=pattern), time.monotonic())
    while not arrivals.is_over:
        time.sleep(0.001)
    values, times = [], []
    for rows in arrivals.batches():
        values += rows.values.tolist()
        times += rows.time.tolist()
    return arrivals, np.array(values), np.array(times)


def recorded(path, lines, signals=None, counts=(None, None), **options):
    """A recording of lines that are there at once."""
    data = "".join(f"{line}\n" for line in lines).encode()
    arrivals = Arrivals(Given([data]), SourceOptions(), time.monotonic())
    while not arrivals.is_over:
        time.sleep(0.001)
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
