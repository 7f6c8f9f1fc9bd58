"""What was measured: the runs, their conditions and their error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..runs.aliasing import distinct_positions
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, unit_name, wrap
from ..support.arrays import Array

_WAYS = {(-1, 1): "both", (1,): "forward", (-1,): "backward"}


def measured_content(runs: Sequence[CalibrationRun]) -> dict[str, Any]:
    """Runs, readings and conditions; errors less the zero of each run, in arcsec."""
    errors = [_error(run) for run in runs]
    return {
        "runs": [
            _run(run, number, e) for number, (run, e) in enumerate(zip(runs, errors, strict=True))
        ],
        "runs_count": len(runs),
        "readings": sum(len(run) for run in runs),
        "distinct_positions": len(distinct_positions(runs)),
        "unit": unit_name(runs[0].period),
        "period": runs[0].period,
        "error": error_size(errors),
    }


def error_size(errors: Sequence[Array]) -> dict[str, float]:
    """Root mean square, peak-to-peak and largest absolute value, arcsec."""
    every = np.concatenate(errors)
    return {
        "rms_arcsec": float(np.sqrt(np.mean(every * every))),
        "peak_to_peak_arcsec": float(np.ptp(every)),
        "max_abs_arcsec": float(np.abs(every).max()),
    }


def _error(run: CalibrationRun) -> Array:
    return (ARCSEC_PER_TURN / run.period) * wrap(
        run.indicated - run.reference - run.zero, run.period
    )


def _run(run: CalibrationRun, number: int, error: Array) -> dict[str, Any]:
    to_degrees = 360.0 / run.period
    angle = run.unwrapped_reference * to_degrees
    moving = run.direction[run.direction != 0.0]
    ways = sorted({int(d) for d in moving})
    speed = None if run.speed is None else np.abs(run.speed) * to_degrees
    return {
        "label": run.label or str(number + 1),
        "readings": len(run),
        "start_deg": float(angle[0]),
        "travel_deg": float(np.ptp(angle)),
        "direction": _WAYS.get(tuple(ways), "at rest"),
        "speed_deg_s": None if speed is None else float(np.median(speed)),
        "temperature_C": _mean(run.temperature),
        "torque_Nm": _mean(run.torque),
        "mount_deg": None if run.mount is None else float(np.median(run.mount) * to_degrees),
        "zero_deg": run.zero * to_degrees,
        **error_size([error]),
    }


def _mean(values: Array | None) -> float | None:
    return None if values is None else float(values.mean())
