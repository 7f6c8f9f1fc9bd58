"""Sums of every unit and day, taken run by run, and the orders that all units together support."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import PurePath
from typing import Any, Final, NamedTuple

import numpy as np

from ..errors import ArgumentError, NoOrderError
from ..estimation.evidence import estimate_by_evidence
from ..fitting.orders.candidates import prior_probabilities
from ..fitting.orders.zerogroups import some_readings, zero_groups
from ..joint.joint import Joint
from ..joint.shafts import ShaftOrders, resolve_orders
from ..runs.follows import check_usable
from ..runs.run import CalibrationRun
from ..support.decoding import local_day
from .calibration import Calibration, CalibrationSums, normal_matrix, output_orders

#: Number of units, the first ones, by which orders are chosen.
_SAMPLE: Final = 32


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
        Orders; None chooses them by the first units (`candidate_orders`), whose runs are
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
            if len(self._waiting) > _SAMPLE:
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
        """Choose the orders by the units read so far, whose runs are then summed."""
        names = self._names(self._waiting)
        together: dict[str, list[CalibrationRun]] = {}
        for unit, runs in self._waiting.items():
            together.setdefault(names[unit], []).extend(runs)
        units = list(together.values())[:_SAMPLE]
        every = [run for runs in units for run in runs]
        self.shafts = worth_keeping(units, candidate_orders(every, *self.joint))
        for unit, runs in self._waiting.items():
            for run in runs:
                self._take(unit, run)
        self._waiting = {}

    def calibrations(self) -> tuple[list[list[Calibration]], list[str]]:
        """Of every unit in the order of its dates, and the units without coefficients.

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


def candidate_orders(
    runs: Sequence[CalibrationRun], gear_ratio: float | None, fixed_member: str, shafts: object
) -> list[ShaftOrders]:
    """Orders of the output as the readings allow, and the lines that the gear is known to leave."""
    fewest = min(_distinct(run) for run in runs)
    # Orders of the output that are looked at, at most, and readings for each.
    highest = max(1, min(110, fewest // 6))
    wanted: dict[str, list[float]] = {"output": list(range(1, highest + 1))}
    if gear_ratio is not None:
        for shaft, order in Joint(gear_ratio, fixed_member).gear_orders():
            wanted.setdefault(shaft, []).append(order)
    named = dict(shafts) if isinstance(shafts, dict) else {}
    for name in named:
        wanted[name] = [1, 2, 3, 4]
    found = resolve_orders(wanted, gear_ratio, fixed_member, named)
    seen = {float(k) for s in found if s.name == "output" for k in s.orders}
    kept = []
    for one in found:
        turns = one.cycles_per_turn
        own = [k for k in one.orders if one.name == "output" or k * turns not in seen]
        seen |= {k * turns for k in own}
        if own:
            kept.append(one._replace(orders=tuple(own)))
    return kept


def _distinct(run: CalibrationRun) -> int:
    """Places within a turn, to a ten-thousandth."""
    return int(np.unique(np.round(np.mod(run.reference, run.period) / run.period, 4)).size)


def worth_keeping(
    units: Sequence[Sequence[CalibrationRun]], shafts: Sequence[ShaftOrders]
) -> list[ShaftOrders]:
    """The candidates that units more probably share, or differ by, than not.

    The evidence of all units together decides (`trueangle.estimation.evidence`): what differs
    from unit to unit is what differs from run to run there. Orders 1 and 2 stay in any case.

    Raises
    ------
    NoOrderError
        The readings of no unit separate the lowest orders.
    """
    shafts = _told_apart(units, shafts)
    orders = output_orders(shafts)
    if all(sum(map(len, runs)) <= len(runs) + 2 * orders.size for runs in units):
        raise NoOrderError("no unit has readings that separate orders 1 and 2: read more places")
    runs = [run for own in units for run in own]
    groups, _ = zero_groups(runs, whole=bool((orders == np.round(orders)).all()))
    looked = sorted(set(orders.tolist()))
    cycles = [shaft.cycles_per_turn for shaft in shafts]
    readings = [group.given() for group in some_readings(groups)]
    estimate = estimate_by_evidence(readings, looked, prior_probabilities(looked, cycles))
    present = set(estimate.present)
    found = []
    for shaft in shafts:
        # Orders that stay, significant or not: eccentricity and tilt, where damage shows.
        kept = {*present, 1, 2} if shaft.name == "output" else present
        own = [k for k in shaft.orders if k * shaft.cycles_per_turn in kept]
        if own:
            found.append(shaft._replace(orders=tuple(own)))
    return found


def _told_apart(
    units: Sequence[Sequence[CalibrationRun]], shafts: Sequence[ShaftOrders]
) -> list[ShaftOrders]:
    """As many of the output's lowest orders as the positions of the first unit separate."""
    run = units[0][0]
    for highest in sorted(
        {k for s in shafts if s.name == "output" for k in s.orders}, reverse=True
    ):
        part = [
            s._replace(orders=tuple(k for k in s.orders if s.name != "output" or k <= highest))
            for s in shafts
        ]
        own = output_orders(part)
        if len(run) <= 2 * own.size + 1:
            continue
        products = normal_matrix(run.reference, own, run.period)
        # Least eigenvalue of the normal matrix, its columns scaled, from which orders are
        # separable.
        if float(np.linalg.eigvalsh(products)[0]) * 2.0 / len(run) >= 1e-3:
            return [s for s in part if s.orders]
    return [s._replace(orders=s.orders[:1]) for s in shafts if s.name == "output"]
