"""Record lines over a pseudo-terminal: lines lost, share of a core, memory, the first reading.

A first line that may have begun before the port was opened is rejected, and counted as such.

``python benches/recording.py [SECONDS] [LINES_PER_SECOND]``; Linux.
"""

from __future__ import annotations

import contextlib
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


def _first_readings(name: str, master: int, starts: int = 9) -> list[float]:
    """Seconds from the start of the program to its first reading on the screen, sorted."""
    os.set_blocking(master, False)
    found = []
    for _ in range(starts):
        with tempfile.TemporaryDirectory() as folder:
            start, sent = time.monotonic(), 0
            process = _started(name, Path(folder, "runs.csv"))
            assert process.stderr is not None
            os.set_blocking(process.stderr.fileno(), False)
            while not any(json.loads(line)["readings"] for line in process.stderr.readlines()):
                with contextlib.suppress(BlockingIOError):  # nobody reads yet
                    os.write(master, _lines(sent, 1, 500.0))
                sent += 1
                time.sleep(0.002)
            found.append(time.monotonic() - start)
            process.terminate()
            os.set_blocking(process.stderr.fileno(), True)
            process.communicate()
    os.set_blocking(master, True)
    return sorted(found)


def _started(name: str, output: Path) -> subprocess.Popen[str]:
    program = [sys.executable, "-m", "trueangle", "record", name, "-o", str(output)]
    names = ["--signal", "reference=column1:deg", "--signal", "indicated=column2:deg"]
    return subprocess.Popen(
        [*program, *names, "--progress", "json"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


def main(seconds: float = 60.0, rate: float = 10_000.0) -> None:
    """Send, record and print what was measured."""
    master, slave = pty.openpty()
    tty.setraw(slave)
    with tempfile.TemporaryDirectory() as folder:
        output = Path(folder, "runs.csv")
        process = _started(os.ttyname(slave), output)
        assert process.stderr is not None
        # The first line of progress is printed once the port is open.
        process.stderr.readline()
        os.set_blocking(process.stderr.fileno(), False)
        sent, start, sizes = 0, time.monotonic(), list[int]()
        used, _ = _status(process.pid)
        while (now := time.monotonic() - start) < seconds:
            due = int(now * rate) - sent
            os.write(master, _lines(sent, due, rate))
            sent += due
            process.stderr.readlines()
            if now > 5.0 * (len(sizes) + 1):
                sizes.append(_status(process.pid)[1])
            time.sleep(0.001)
        share = (_status(process.pid)[0] - used) / (time.monotonic() - start)
        time.sleep(0.5)
        process.terminate()
        process.wait()
        rows = output.read_bytes().count(b"\n") - 1
        kept = Path(f"{output}.rejected")
        rejected = kept.read_bytes().count(b"\n") if kept.exists() else 0
    print(f"{sent} lines sent, {rows} recorded, {rejected} rejected, {sent - rows - rejected} lost")
    print(f"{100.0 * share:.1f} % of a core, {rate:g} lines/s for {seconds:g} s")
    print(f"memory grew by {(max(sizes) - sizes[0]) / 1024:.0f} kB after the first 5 s")
    first, *_, last = _first_readings(os.ttyname(slave), master)
    print(f"first reading on the screen {first:.2f} to {last:.2f} s after the start")


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
