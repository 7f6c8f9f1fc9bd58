"""Record lines over a pseudo-terminal: lines lost, share of a core, memory, the first reading.

``python benches/recording.py [SECONDS] [LINES_PER_SECOND]``; Linux.
"""

from __future__ import annotations

import json
import math
import os
import pty
import subprocess
import sys
import tempfile
import time
import tty
from pathlib import Path


def _status(pid: int) -> tuple[float, int]:
    """Seconds of a processor and bytes in memory of a process."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return seconds, int(fields[21]) * os.sysconf("SC_PAGE_SIZE")


def _lines(first: int, count: int, rate: float) -> bytes:
    found = []
    for i in range(first, first + count):
        angle = 90.0 * i / rate
        error = 0.5 * math.sin(math.radians(angle)) + 0.02 * math.sin(12345.6789 * i)
        found.append(f"{angle % 360.0:.4f},{(angle + error) % 360.0:.4f}\n")
    return "".join(found).encode()


def main(seconds: float = 60.0, rate: float = 10_000.0) -> None:
    """Send, record and print what was measured."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, "runs.csv")
        program = [sys.executable, "-m", "trueangle", "record", os.ttyname(slave), "-o", output]
        names = ["--signal", "reference=column1:deg", "--signal", "indicated=column2:deg"]
        begun = time.monotonic()
        process = subprocess.Popen(
            [*program, *names, "--progress", "json"], stderr=subprocess.PIPE, text=True
        )
        assert process.stderr is not None
        # The first line of progress is printed once the port is open.
        state = json.loads(process.stderr.readline())
        os.set_blocking(process.stderr.fileno(), False)
        sent, start, sizes, shown = 0, time.monotonic(), [], None
        used, _ = _status(process.pid)
        while (now := time.monotonic() - start) < seconds:
            due = int(now * rate) - sent
            os.write(master, _lines(sent, due, rate))
            sent += due
            for line in process.stderr.readlines():
                state = json.loads(line)
                if shown is None and state["readings"]:
                    shown = time.monotonic() - start
            if now > 5.0 * (len(sizes) + 1):
                sizes.append(_status(process.pid)[1])
            time.sleep(0.001)
        share = (_status(process.pid)[0] - used) / (time.monotonic() - start)
        time.sleep(0.5)
        process.terminate()
        process.wait()
        rows = output.read_bytes().count(b"\n") - 1
    print(f"{sent} lines sent, {rows} recorded, {sent - rows} lost")
    print(f"{100.0 * share:.1f} % of a core, {rate:g} lines/s for {seconds:g} s")
    print(f"memory grew by {(max(sizes) - sizes[0]) / 1024:.0f} kB after the first 5 s")
    print(f"first reading {1e3 * (shown or math.nan):.0f} ms after the first line")
    print(f"started in {1e3 * (start - begun):.0f} ms")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
