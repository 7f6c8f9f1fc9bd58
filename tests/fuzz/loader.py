"""What a loader is: how its files are made, and what must hold where one is accepted."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import trueangle as ta
from mutation import mutated_bytes
from pen import Pen, penned
from trueangle.errors import TrueAngleError

#: Readings of the small files that are damaged.
ROWS = 40

#: Characters of a message, at most: names of 256 joints or columns are among them.
_LONGEST = 4000


@dataclass(frozen=True)
class Loader:
    """One kind of file.

    ``make`` writes a damaged file below a folder and returns it; ``use`` loads it and
    raises `AssertionError` where an accepted file holds what it must not.
    """

    name: str
    make: Callable[[Path, random.Random], Path]
    use: Callable[[Path], None]


def columns() -> dict[str, Any]:
    """Columns of a small table of runs."""
    theta = np.linspace(0.0, 350.0, ROWS)
    return {
        "run": ["a"] * (ROWS // 2) + ["b"] * (ROWS - ROWS // 2),
        "time_s": (np.arange(ROWS) * 0.125).tolist(),
        "reference_deg": theta.tolist(),
        "indicated_deg": (theta + 0.25 * np.sin(np.radians(theta))).tolist(),
        "note": [f"n{i % 3}" for i in range(ROWS)],
    }


def use_runs(path: Path) -> None:
    """Read as runs, and hold every angle to be finite."""
    for run in ta.read_runs(path):
        assert np.isfinite(run.reference).all()
        assert np.isfinite(run.indicated).all()


_MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.25])], 0.0, 360.0)


def use_log(path: Path) -> None:
    """Correct as a log: what is written must read back as what was handed to the writer."""
    output = path.with_name(f"corrected{path.suffix}")
    result = ta.correct_logs(path, _MODEL, output)
    error = result.logs[0].error
    if error is not None:
        assert "did not read back" not in str(error), error
        raise error


def use_both(path: Path) -> None:
    """As runs, and corrected: an error of the one must not keep the other from being tried."""
    with contextlib.suppress(TrueAngleError):
        use_runs(path)
    use_log(path)


def well_told(error: TrueAngleError, path: Path) -> str | None:
    """What is wrong with a message, or None: it names the file, in a line that can be printed."""
    told = str(error)
    if path.name not in told and f"corrected{path.suffix}" not in told:
        return "names no file"
    if len(told) > _LONGEST:
        return f"has {len(told)} characters"
    if not told.isprintable():
        return "is more than a line, or holds what cannot be printed"
    return None


def damaged(path: Path, rng: random.Random, always: bool = False) -> Path:
    """The file with its bytes changed, most times."""
    if always or rng.random() < 0.7:
        path.write_bytes(mutated_bytes(path.read_bytes(), rng))
    return path


_MADE: dict[str, Any] = {}


def seeds(name: str, make: Callable[[Path], Any], folder: Path) -> Any:
    """What is damaged, made once."""
    if name not in _MADE:
        _MADE[name] = make(folder)
    return _MADE[name]


def written_loader(
    name: str,
    ending: str,
    write: Callable[[Pen, int], bytes],
    variants: int,
    use: Callable[[Path], None],
) -> Loader:
    """A loader of files written with a pen; one in eight has its bytes changed instead."""

    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"log{ending}"
        if rng.random() < 0.125:
            data = mutated_bytes(write(Pen(), rng.randrange(variants)), rng)
        else:
            data = penned(name, write, variants, rng)
        path.write_bytes(data)
        return path

    return Loader(name, make, use)
