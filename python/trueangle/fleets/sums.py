"""Sums of every unit and day, taken run by run: the readings themselves are not kept."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import PurePath
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..formats.times import day_of
from ..joint.shafts import ShaftOrders
from ..runs.follows import check_follows
from ..runs.run import CalibrationRun
from .calibration import Calibration, UnitSums, output_orders
from .orders import SAMPLE, candidates, worth_keeping

__all__ = ["FleetSums"]


class FleetSums:
    """Sums by unit and day.

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
        self.named = False
        self.sums: dict[tuple[str, str], UnitSums] = {}
        self._waiting: dict[str, list[CalibrationRun]] = {}

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
            check_follows(run)
            unit = self._unit(run)
            if self.shafts is not None:
                self._take(unit, run)
                continue
            self._waiting.setdefault(unit, []).append(run)
            if len(self._waiting) > SAMPLE:
                self._choose()

    def _unit(self, run: CalibrationRun) -> str:
        if self.by == "unit" and run.unit is not None:
            self.named = True
            return run.unit
        if run.label is not None:
            return run.label
        if run.source is not None:
            return PurePath(run.source.file).stem
        return str(len(self.sums) + len(self._waiting) + 1)

    def _take(self, unit: str, run: CalibrationRun) -> None:
        key = (unit, day_of(run.when))
        self.sums.setdefault(key, UnitSums()).add(run, self.orders, self.periodic)

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
        units = list(self._waiting.values())[:SAMPLE]
        every = [run for runs in units for run in runs]
        self.shafts = worth_keeping(units, candidates(every, *self.joint))
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
        for (unit, _), sums in sorted(self.sums.items(), key=lambda entry: entry[0][1]):
            one = Calibration.of(unit, sums, self.period or 1.0)
            if one is None:
                untold.append(unit)
            else:
                found.setdefault(unit, []).append(one)
        order = {unit: None for unit, _ in self.sums}
        return [found[unit] for unit in order if unit in found], list(dict.fromkeys(untold))
