"""Write runs as the CSV that `trueangle.read_runs` reads, and where a result comes from."""

from __future__ import annotations

import csv
import hashlib
import platform
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import __version__
from ..support.argumentkinds import told_kinds
from ..support.files import RUNS, written_atomically
from ..support.signals import find_signal
from .run import CalibrationRun, as_runs

#: Signals that come first, in the order that these files have always had.
_ORDER = ("time", "velocity", "torque", "temperature", "mount")


@told_kinds
def write_runs(runs: CalibrationRun | Iterable[CalibrationRun], path: str | Path) -> int:
    """Write ``runs`` in degrees, to a temporary file that is renamed; floats round-trip exactly.

    Columns: run, reference_deg, indicated_deg and those of the signals of
    `trueangle.support.signals.SIGNALS` that every run has, such as time_s and current_A; ``unit``
    and ``when`` where a run has one. The indicated angle of a reversed sensor is
    ``-indicated_deg``: minus what the sensor reads.

    Parameters
    ----------
    runs : CalibrationRun or iterable of CalibrationRun
    path : str or path
        A CSV file; another ending is refused.

    Returns
    -------
    int
        Number of readings written.

    Raises
    ------
    ArgumentError, FileError
        No runs; a file that cannot be written, which then is as it was.

    Examples
    --------
    >>> import tempfile, trueangle as ta
    >>> path = tempfile.mkdtemp() + "/runs.csv"
    >>> ta.write_runs(ta.CalibrationRun([0.0, 90.0], [0.1, 90.2], period=360.0), path)
    2
    >>> ta.read_runs(path)[0].indicated
    array([ 0.1, 90.2])
    """
    found = as_runs(runs)
    scale = 360.0 / found[0].period
    minus = "-" if found[0].indicated_sign < 0 else ""
    kept = [("reference_deg", "reference", scale), (f"{minus}indicated_deg", "indicated", scale)]
    for name in (*_ORDER, *found[0].signals):
        if all(run.signal(name) is not None for run in found):
            signal = find_signal(name)
            is_angle = signal.kind in ("angle", "velocity")
            kept.append((signal.column.format("deg"), name, scale if is_angle else 1.0))
    # Labels of all runs where one has them.
    labelled = [role for role in ("unit", "when") if any(getattr(r, role) for r in found)]
    with written_atomically(path, kind=RUNS) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*labelled, "run", *(name for name, _, _ in kept)])
        for j, run in enumerate(found):
            label = run.label or str(j + 1)
            texts = [*(getattr(run, role) or "" for role in labelled), label]
            columns = [(_values(run, name) * factor).tolist() for _, name, factor in kept]
            for values in zip(*columns, strict=True):
                writer.writerow([*texts, *map(repr, values)])
    return sum(len(run) for run in found)


def _values(run: CalibrationRun, name: str) -> NDArray[np.float64]:
    found = getattr(run, name) if name in ("reference", "indicated") else run.signal(name)
    assert found is not None
    return found


def provenance(runs: Sequence[CalibrationRun], simulation: str | None) -> dict[str, Any]:
    """Inputs (name, sha256), versions and the time of writing in UTC."""
    inputs: dict[str, str] = {}
    for run in runs:
        if run.source is not None:
            inputs.setdefault(run.source.file, run.source.sha256)
    if simulation is not None and Path(simulation).is_file():
        # As of runs: the name; where somebody keeps the file is nobody else's business.
        inputs[Path(simulation).name] = hashlib.sha256(Path(simulation).read_bytes()).hexdigest()
    return {
        "inputs": [{"file": file, "sha256": digest} for file, digest in inputs.items()],
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {
            "trueangle": __version__,
            "numpy": np.__version__,
            "python": platform.python_version(),
            "system": f"{platform.system()} {platform.machine()}",
        },
    }
