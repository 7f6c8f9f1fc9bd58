"""Write runs as the CSV that `trueangle.read_runs` reads."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path

from ..files import written_atomically
from ..runs import CalibrationRun, as_runs

__all__ = ["write_runs"]


def write_runs(runs: CalibrationRun | Iterable[CalibrationRun], path: str | Path) -> int:
    """Write ``runs`` in degrees, beside and then renamed; floats round-trip exactly.

    Columns: run, reference_deg, indicated_deg and, where every run has them, time_s,
    velocity_deg_s, torque_Nm, temperature_C, mount_deg.

    Returns
    -------
    int
        Number of readings written.
    """
    found = as_runs(runs)
    scale = 360.0 / found[0].period
    sources = (
        ("reference_deg", "reference", scale),
        ("indicated_deg", "indicated", scale),
        ("time_s", "time", 1.0),
        ("velocity_deg_s", "velocity", scale),
        ("torque_Nm", "torque", 1.0),
        ("temperature_C", "temperature", 1.0),
        ("mount_deg", "mount", scale),
    )
    kept = [
        source for source in sources if all(getattr(run, source[1]) is not None for run in found)
    ]
    with written_atomically(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["run", *(name for name, _, _ in kept)])
        for j, run in enumerate(found):
            label = run.label or str(j + 1)
            columns = [(getattr(run, name) * factor).tolist() for _, name, factor in kept]
            for values in zip(*columns, strict=True):
                writer.writerow([label, *map(repr, values)])
    return sum(len(run) for run in found)
