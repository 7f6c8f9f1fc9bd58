"""Sums of every unit and day, taken run by run: the readings themselves are not kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders
from ..runs.follows import check_usable
from ..runs.run import CalibrationRun
from ..support.times import local_day
from .calibration import Calibration, CalibrationSums, output_orders
from .orders import SAMPLE, candidate_orders, worth_keeping


class _Unnamed(NamedTuple):
    """A run whose unit no column names: its label and its file."""

    label: str
    file: str


class FleetSums:
    """Sums by unit and day.

    Where no column names the units, the files do if there are more of them than labels of runs:
    runs 1 to 3 of each of forty files are forty units, runs SN01 to SN40 of two files are too.

    Parameters
    ----------
    by : {"unit", "run"}
    shafts : list of ShaftOrders or None
        Orders; None chooses them by the first units (`trueangle.fleets.orders`), whose runs are
        kept until then.
    joint : tuple
        Gear ratio or None, fixed member, and further shafts.
    """

    def __init__(
        self,
        by: str,
        shafts: list[ShaftOrders] | None,
        joint: tuple[float | None, str, Mapping[str, float] | None],
    ) -> None:
        self.by, self.shafts, self.joint = by, shafts, joint
        self.period: float | None = None
        self.named = self.by_file = False
        self.sums: dict[tuple[str | _Unnamed, str], CalibrationSums] = {}
        self._waiting: dict[str | _Unnamed, list[CalibrationRun]] = {}

    def add(self, runs: Iterable[CalibrationRun]) -> None:
        """Take in some runs.

        Raises
        ------
        ArgumentError
            Runs in another unit than those before.
        """
        for run in runs:
            if self.period is None:
                self.period = run.period
            if run.period != self.period:
                raise ArgumentError(
                    f"run {run.label or ''} has period {run.period:g} and those before "
                    f"{self.period:g}: convert one of them"
                )
            check_usable([run])
            unit = self._unit(run)
            if self.shafts is not None:
                self._take(unit, run)
                continue
            self._waiting.setdefault(unit, []).append(run)
            if len(self._waiting) > SAMPLE:
                self._choose()

    def _unit(self, run: CalibrationRun) -> str | _Unnamed:
        if self.by == "unit" and run.unit is not None:
            self.named = True
            return run.unit
        file = None if run.source is None else PurePath(run.source.file).stem
        label = run.label or file or str(len(self.sums) + len(self._waiting) + 1)
        return label if self.by == "run" or file is None else _Unnamed(label, file)

    def _names(self, units: Iterable[str | _Unnamed]) -> dict[str | _Unnamed, str]:
        """The units' names: of those that no column names, files or labels, whichever are more."""
        units = list(dict.fromkeys(units))
        unnamed = [unit for unit in units if isinstance(unit, _Unnamed)]
        files, labels = ({unit[i] for unit in unnamed} for i in (1, 0))
        self.by_file = len(files) > len(labels)
        return {
            unit: unit if isinstance(unit, str) else unit.file if self.by_file else unit.label
            for unit in units
        }

    def _take(self, unit: str | _Unnamed, run: CalibrationRun) -> None:
        key = (unit, local_day(run.when))
        self.sums.setdefault(key, CalibrationSums()).add(run, self.orders, self.periodic)

    @property
    def orders(self) -> np.ndarray[Any, np.dtype[np.float64]]:
        """Output orders."""
        return output_orders(self.shafts or [])

    @property
    def periodic(self) -> bool:
        """Whether every order comes back after a turn of the output."""
        return bool((self.orders == np.round(self.orders)).all())

    def _choose(self) -> None:
        """The orders by the units seen so far, whose runs are then summed."""
        names = self._names(self._waiting)
        together: dict[str, list[CalibrationRun]] = {}
        for unit, runs in self._waiting.items():
            together.setdefault(names[unit], []).extend(runs)
        units = list(together.values())[:SAMPLE]
        every = [run for runs in units for run in runs]
        self.shafts = worth_keeping(units, candidate_orders(every, *self.joint))
        for unit, runs in self._waiting.items():
            for run in runs:
                self._take(unit, run)
        self._waiting = {}

    def calibrations(self) -> tuple[list[list[Calibration]], list[str]]:
        """Of every unit in the order of its dates, and the units that tell no coefficients.

        Raises
        ------
        ArgumentError
            No runs.
        """
        if self.shafts is None:
            if not self._waiting:
                raise ArgumentError("runs is empty: a fleet needs readings of its units")
            self._choose()
        found: dict[str, list[Calibration]] = {}
        untold: list[str] = []
        names = self._names(unit for unit, _ in self.sums)
        together: dict[tuple[str, str], CalibrationSums] = {}
        for (unit, day), sums in self.sums.items():
            together.setdefault((names[unit], day), CalibrationSums()).merge(sums)
        for (unit, _), sums in sorted(together.items(), key=lambda entry: entry[0][1]):
            one = Calibration.of(unit, sums, self.period or 1.0)
            if one is None:
                untold.append(unit)
            else:
                found.setdefault(unit, []).append(one)
        order = dict.fromkeys(names.values())
        return [found[unit] for unit in order if unit in found], list(dict.fromkeys(untold))
