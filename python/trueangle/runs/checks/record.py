"""Readings of one run as they stand in a file, whatever is wrong with them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..run import CalibrationRun

__all__ = ["Record", "records_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Record:
    """One run before it is trusted.

    Attributes
    ----------
    label : str
    reference, indicated : ndarray, shape (n,)
        Degrees, as they were read.
    rows : ndarray of int
        Row of each reading in its file, from 1.
    time, velocity, temperature, torque, mount : ndarray or None
        s, deg/s, Celsius, Nm, degrees.
    columns : mapping of role to (name, unit)
        The columns of the file that were understood.
    deviations : tuple of str
        Columns of no role that look like deviations from a nominal angle.
    clocks : tuple of str
        Columns of no role that are called like a time, where none was understood.
    """

    label: str
    reference: Array
    indicated: Array
    rows: NDArray[np.int64]
    time: Array | None = None
    velocity: Array | None = None
    temperature: Array | None = None
    torque: Array | None = None
    mount: Array | None = None
    columns: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)
    deviations: tuple[str, ...] = ()
    clocks: tuple[str, ...] = ()

    def __len__(self) -> int:
        return int(self.reference.size)

    @cached_property
    def unwrapped(self) -> tuple[Array, Array]:
        """Reference and indicated without jumps of a turn."""
        return np.unwrap(self.reference, period=360.0), np.unwrap(self.indicated, period=360.0)


def records_of(runs: Iterable[CalibrationRun]) -> list[Record]:
    """Records of runs that were read already, angles in degrees."""
    found = []
    for k, run in enumerate(runs):
        scale = 360.0 / run.period
        found.append(
            Record(
                run.label or str(k + 1),
                run.reference * scale,
                run.indicated * scale,
                np.arange(1, len(run) + 1),
                run.time,
                None if run.velocity is None else run.velocity * scale,
                run.temperature,
                run.torque,
                None if run.mount is None else run.mount * scale,
            )
        )
    return found
