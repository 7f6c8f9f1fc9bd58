"""CPU seconds of short commands: `--help`, and a small `fit`, beside Python and numpy alone.

    python benches/startup.py [--rounds 15]

Every way is a process of its own with one BLAS thread, in turns; medians of user and system
time and what is left after `import numpy` in the same round.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import tempfile
from pathlib import Path

import numpy as np

#: Readings of the small run, and the orders of its error.
READINGS = 36


def made(path: Path) -> Path:
    """A small run as CSV."""
    rng = np.random.default_rng(1)
    angle = np.arange(READINGS) * 360.0 / READINGS
    x = np.radians(angle)
    error = 0.1 * np.sin(x) + 0.02 * np.cos(4 * x) + 0.001 * rng.standard_normal(READINGS)
    rows = zip(angle, angle - error, strict=True)
    path.write_text(
        "indicated_deg,reference_deg\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in rows)
    )
    return path


def environment(cache: Path) -> dict[str, str]:
    """Ours with one BLAS thread and compiled modules kept, as those of an installed package are."""
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "OPENBLAS_NUM_THREADS": "1", "PYTHONPYCACHEPREFIX": str(cache)}


def seconds(words: list[str], env: dict[str, str]) -> float:
    """CPU seconds of one process, which must succeed."""
    silent = os.open(os.devnull, os.O_WRONLY)
    process = os.posix_spawn(
        sys.executable,
        [sys.executable, *words],
        env,
        file_actions=[(os.POSIX_SPAWN_DUP2, silent, 1)],
    )
    _, status, usage = os.wait4(process, 0)
    os.close(silent)
    if status:
        raise SystemExit(f"{' '.join(words)}: status {status}")
    return usage.ru_utime + usage.ru_stime


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=15)
    rounds = parser.parse_args().rounds
    with tempfile.TemporaryDirectory() as name:
        run = str(made(Path(name) / "run.csv"))
        fit = ["-m", "trueangle", "fit", run, "-o", str(Path(name) / "model.json")]
        ways = {
            "python": ["-c", "pass"],
            "import numpy": ["-c", "import numpy"],
            "--help": ["-m", "trueangle", "--help"],
            "fit --help": ["-m", "trueangle", "fit", "--help"],
            "fit --orders 1-4": [*fit, "--orders", "1-4"],
            "fit": fit,
        }
        env = environment(Path(name) / "compiled")
        taken: dict[str, list[float]] = {way: [] for way in ways}
        for _ in range(rounds + 1):
            for way, words in ways.items():
                taken[way].append(seconds(words, env))
    base = taken["import numpy"][1:]
    for way, all_times in taken.items():
        times = all_times[1:]  # the first round compiles, and reads files from the disk
        over = statistics.median(a - b for a, b in zip(times, base, strict=True))
        print(
            f"{way:18s} {statistics.median(times) * 1e3:7.0f} ms"
            f" ({min(times) * 1e3:.0f} .. {max(times) * 1e3:.0f}), {over * 1e3:+6.0f} over numpy"
        )


if __name__ == "__main__":
    main()
