"""Where a report or certificate comes from: input files with their hashes, versions, the time."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from .._core import __version__
from .run import CalibrationRun


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
