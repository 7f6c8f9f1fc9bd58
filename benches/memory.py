"""Peak memory of every command that takes readings: ``python benches/memory.py [--rows 250000]``.

Each command runs in a process of its own on one run of ROWS readings and on one four times as long
(NPZ, three columns). Printed are both peaks above that of a run of 1000 readings, what an input
adds to imports and the rest, and the bytes that one further reading costs: 0 stands for constant.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import trueangle as ta

#: Readings of the run whose peak is that of the command itself.
LEAST = 1000
#: Commands, with {} for the readings; output files are never kept.
COMMANDS: dict[str, list[str]] = {
    "check": ["check", "{}"],
    "fit": ["fit", "{}", "-o", "made.json"],
    "fit --one-pass": ["fit", "{}", "--one-pass", "-o", "made.json"],
    "correct": ["correct", "{}", "-m", "model.json", "-o", "made.npz"],
    "orders": ["orders", "{}"],
    "plot": ["plot", "{}", "-o", "made.png"],
    "diagnose": ["diagnose", "{}", "--simulation", "joint.toml"],
    "report": ["report", "{}", "-o", "made.html"],
    "selfcal": ["selfcal", "{}", "-o", "made.json", "--method", "spin-down"],
    "fleet": ["fleet", "{}", "other.npz", "-o", "made.json"],
    "watch": ["watch", "{}", "--model", "model.json"],
    "join": ["join", "{}", "{}", "-o", "made.csv"],
}
_CODE = """
import sys
from trueangle.cli import main
status = main(sys.argv[1:])
with open("/proc/self/status") as told:
    peak = next(int(line.split()[1]) for line in told if line.startswith("VmHWM"))
print(f"\\n{status} {peak}", file=sys.stderr)
"""
_SIMULATION = """
[joint]
gear_ratio = 50.0
[[harmonic]]
shaft = "output"
order = 1
amplitude_arcsec = 300.0
phase_deg = 20.0
[noise]
sigma_arcsec = 2.0
"""


def made_run(path: Path, rows: int) -> None:
    """A sweep of ten turns there with an error of order 1 and of the motor's order 2."""
    rng = np.random.default_rng(7)
    theta = np.linspace(0.0, 3600.0, rows)
    error = 0.08 * np.sin(np.radians(theta)) + 0.01 * np.sin(np.radians(100.0 * theta))
    np.savez(
        path,
        time_s=np.arange(rows) * 1e-3,
        reference_deg=theta,
        indicated_deg=theta + error + rng.normal(0.0, 5e-4, rows),
    )


def furnish(folder: Path) -> None:
    """What the commands take beside readings."""
    ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.08])], 0.0, 360.0).save(
        folder / "model.json"
    )
    (folder / "joint.toml").write_text(_SIMULATION)
    made_run(folder / "other.npz", 400)


def peak_of(command: list[str], path: Path, folder: Path) -> tuple[int, int]:
    """Status and peak memory in bytes of a command on the readings of ``path``."""
    line = [word.format(path.name) for word in command]
    done = subprocess.run(
        [sys.executable, "-c", _CODE, *line],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    try:
        status, peak = done.stderr.strip().rsplit("\n", 1)[-1].split()
        return int(status), 1024 * int(peak)
    except ValueError:
        return done.returncode or 1, 0


def main() -> None:
    """Print a line for each command."""
    parser = argparse.ArgumentParser(prog="python benches/memory.py", description=__doc__)
    parser.add_argument("--rows", type=int, default=250_000, help="of the shorter run")
    parser.add_argument("--command", action="append", choices=list(COMMANDS), help="this one only")
    args = parser.parse_args()
    sizes = (LEAST, args.rows, 4 * args.rows)
    print(f"{'command':<16}{'status':>7}{'MB':>9}{'MB of 4x':>10}{'bytes a reading':>17}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        furnish(folder)
        for rows in sizes:
            made_run(folder / f"run{rows}.npz", rows)
        for command in args.command or COMMANDS:
            found = [peak_of(COMMANDS[command], folder / f"run{n}.npz", folder) for n in sizes]
            status = max(status for status, _ in found[1:])
            _, short, long = (peak - found[0][1] for _, peak in found)
            each = (long - short) / (sizes[2] - sizes[1])
            print(
                f"{command:<16}{status:>7}{short / 1e6:>9.1f}{long / 1e6:>10.1f}{each:>17.1f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
