"""Faults of the readings while they are recorded: those of `check`, in the latest of them."""

from __future__ import annotations

import numpy as np

from ..support.angles import wrap
from ..support.arrays import Array

#: Readings that are looked at, and how few tell nothing.
_LATEST, _LEAST = 4000, 50
#: Part of a turn that one angle moves before the other one is stuck.
_MOVED = 1.0 / 36.0


class LatestReadings:
    """The latest readings, in which faults are looked for.

    Parameters
    ----------
    period : float
    """

    def __init__(self, period: float) -> None:
        self._period = period
        self._latest: Array = np.empty((3, 0))

    def add(self, reference: Array, indicated: Array, time: Array) -> None:
        """Take in readings in the order they were taken."""
        more = np.vstack([reference, indicated, time])
        self._latest = np.hstack([self._latest, more])[:, -_LATEST:]

    def look(self) -> dict[str, str]:
        """Faults by their names."""
        # These take longer to import than all that shows the first reading.
        from ..runs.checks.check import data_faults
        from ..runs.checks.record import records_of
        from ..runs.run import CalibrationRun

        reference, indicated, time = self._latest
        if reference.size < _LEAST:
            return {}
        pairs = (("indicated", indicated, reference), ("reference", reference, indicated))
        for name, own, other in pairs:
            rows = slice(int(np.flatnonzero(own != own[-1])[-1]) + 1 if np.ptp(own) else 0, None)
            path = np.cumsum(wrap(np.diff(other[rows]), self._period))
            if path.size and np.ptp(path) > _MOVED * self._period:
                says = f"the {name} angle is the same in the last {path.size + 1} readings"
                return {"stuck": f"{says} while the other one moves; is the sensor connected?"}
        run = CalibrationRun(reference, indicated, period=self._period, time=time, label="now")
        return {f.fault: f"{f.says}; {f.mend}" for f in data_faults(records_of([run]))}
