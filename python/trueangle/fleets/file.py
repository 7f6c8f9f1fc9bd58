"""The file of a fleet: its result in arcsec, and the prior in the numbers it was found with."""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..fitting.prior import Prior
from ..joint.shafts import ShaftOrders
from ..support.angles import ARCSEC_PER_TURN
from ..support.decoding import Decoder, json_text, read_text
from ..support.files import RUNS_BYTES
from ..support.kinds import told_kinds
from .history import HistoryOrder, HistoryRow
from .result import BetweenOrder, CommonOrder, Fleet
from .text import FORMAT, VERSION
from .tolerance import Tolerance
from .unit import VERDICTS, FleetUnit, UnitOrder

__all__ = ["FORMAT", "load_fleet"]

_KEYS = dict.fromkeys(
    ("format", "version", "prior", "units", "common", "between", "tolerance", "history", "notes"),
    True,
)
_PRIOR = dict.fromkeys(
    ("period", "shafts", "mean", "variance", "freedom", "noise_variance", "noise_freedom", "units"),
    True,
)
_UNIT = dict.fromkeys(
    (
        "unit",
        "verdict",
        "because",
        "orders",
        "peak_to_peak_arcsec",
        "left_arcsec",
        "p",
        "limit",
    ),
    True,
)
_ROW = dict.fromkeys(("order", "amplitude_arcsec", "phase_deg", "std_arcsec", "z"), True)
_COMMON = dict.fromkeys(("order", "shaft", "amplitude_arcsec", "phase_deg", "std_arcsec"), True)
_BETWEEN = dict.fromkeys(("order", "std_arcsec", "repeatability_arcsec"), True)
_SHAFT = dict.fromkeys(("name", "cycles_per_turn", "orders"), True)
_TOLERANCE = dict.fromkeys(
    ("share", "confidence", "factor", "method", "peak_to_peak_arcsec", "left_arcsec"), True
)
_HISTORY = dict.fromkeys(
    (*(name for name in HistoryRow._fields if name != "bound"), "bound_arcsec"), True
)
_MOVED = dict.fromkeys(HistoryOrder._fields, True)

#: Units, and orders of each, at most.
_MOST_UNITS = 2_000_000
_MOST_ORDERS = 4096


@told_kinds
def load_fleet(path: str | PathLike[str]) -> Fleet:
    """Read and check the file of a fleet; nothing in it is executed.

    Raises
    ------
    FileError
        Not JSON, truncated, of a later version, unknown or missing keys, numbers that are not
        finite: names the key and what to do.
    """
    return _FleetReader(Path(path), FileError).fleet()


class _FleetReader(Decoder):
    """Checks a fleet key by key."""

    def fleet(self) -> Fleet:
        text = read_text(self.path, RUNS_BYTES, self.kind, "a fleet")
        content = json_text(self.path, text, self.kind, "a fleet file")
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise self.error(f"'format' must be {FORMAT!r}: this is not a fleet file")
        if content.get("version") != VERSION:
            raise self.error(f"version {VERSION} is known; install a later trueangle", "version")
        self.table(content, _KEYS)
        prior = self.prior(content["prior"])
        self.turn = prior.period / ARCSEC_PER_TURN
        common = self.table(content["common"], {"aligned": True, "orders": True}, "common")
        between = self.table(content["between"], {"orders": True}, "between")
        aligned = common["aligned"]
        if not isinstance(aligned, bool):
            raise self.error("true or false is needed", "common.aligned")
        shared = tuple(self.each(common["orders"], "common.orders", self.common))
        scatter = tuple(self.each(between["orders"], "between.orders", self.between))
        if [order.order for order in scatter] != [order.order for order in shared]:
            raise self.error("the orders of common.orders are needed", "between.orders")
        return Fleet(
            tuple(self.each(content["units"], "units", self.unit, _MOST_UNITS)),
            shared,
            scatter,
            self.tolerance(content["tolerance"]),
            tuple(self.each(content["history"], "history", self.history, _MOST_UNITS)),
            aligned,
            prior,
            tuple(self.each(content["notes"], "notes", self.text)),
        )

    def each(self, value: Any, key: str, read: Any, most: int = _MOST_ORDERS) -> list[Any]:
        entries = self.items(value, key, "entries", most)
        return [read(entry, f"{key}[{i}]") for i, entry in enumerate(entries)]

    def positive(self, value: Any, key: str) -> float:
        number = self.number(value, key)
        if number < 0.0:
            raise self.error("must not be negative", key)
        return number

    def angle(self, value: Any, key: str) -> float:
        return self.positive(value, key) * self.turn

    def maybe(self, value: Any, key: str) -> float | None:
        return None if value is None else self.number(value, key)

    def prior(self, value: Any) -> Prior:
        given = self.table(value, _PRIOR, "prior")
        period = self.number(given["period"], "prior.period")
        if period <= 0.0:
            raise self.error("must be positive", "prior.period")
        shafts = tuple(self.each(given["shafts"], "prior.shafts", self.shaft))
        size = 2 * sum(len(shaft.orders) for shaft in shafts)
        mean, variance = (
            np.array(self.numbers(given[name], f"prior.{name}", 2 * _MOST_ORDERS))
            for name in ("mean", "variance")
        )
        if mean.size != size or variance.size != size or (variance < 0.0).any():
            raise self.error(f"{size} numbers, none negative, are needed", "prior.variance")
        worth = self.maybe(given["noise_freedom"], "prior.noise_freedom")
        noise = self.number(given["noise_variance"], "prior.noise_variance")
        if noise <= 0.0:
            raise self.error("must be positive", "prior.noise_variance")
        return Prior(
            period,
            shafts,
            mean,
            variance,
            max(self.positive(given["freedom"], "prior.freedom"), 1.0),
            noise,
            math.inf if worth is None else worth,
            self.whole(given["units"], "prior.units", 1),
        )

    def shaft(self, value: Any, key: str) -> ShaftOrders:
        given = self.table(value, _SHAFT, key)
        orders = self.each(
            given["orders"], f"{key}.orders", lambda v, k: self.whole(v, k, 1, 2**31)
        )
        cycles = self.number(given["cycles_per_turn"], f"{key}.cycles_per_turn")
        if cycles <= 0.0:
            raise self.error("must be positive", f"{key}.cycles_per_turn")
        return ShaftOrders(self.text(given["name"], f"{key}.name"), cycles, tuple(orders))

    def unit(self, value: Any, key: str) -> FleetUnit:
        given = self.table(value, _UNIT, key)
        verdict = given["verdict"]
        if verdict not in VERDICTS:
            raise self.error(f"one of {', '.join(VERDICTS)} is needed", f"{key}.verdict")
        return FleetUnit(
            self.text(given["unit"], f"{key}.unit"),
            verdict,
            self.text(given["because"], f"{key}.because"),
            tuple(self.each(given["orders"], f"{key}.orders", self.row)),
            self.angle(given["peak_to_peak_arcsec"], f"{key}.peak_to_peak_arcsec"),
            self.angle(given["left_arcsec"], f"{key}.left_arcsec"),
            self.number(given["p"], f"{key}.p"),
            self.number(given["limit"], f"{key}.limit"),
        )

    def row(self, value: Any, key: str) -> UnitOrder:
        given = self.table(value, _ROW, key)
        return UnitOrder(
            self.number(given["order"], f"{key}.order"),
            self.angle(given["amplitude_arcsec"], f"{key}.amplitude_arcsec"),
            self.number(given["phase_deg"], f"{key}.phase_deg"),
            self.angle(given["std_arcsec"], f"{key}.std_arcsec"),
            self.number(given["z"], f"{key}.z"),
        )

    def common(self, value: Any, key: str) -> CommonOrder:
        given = self.table(value, _COMMON, key)
        amplitude = self.angle(given["amplitude_arcsec"], f"{key}.amplitude_arcsec")
        phase = math.radians(self.number(given["phase_deg"], f"{key}.phase_deg"))
        return CommonOrder(
            self.number(given["order"], f"{key}.order"),
            self.text(given["shaft"], f"{key}.shaft"),
            amplitude * math.sin(phase),
            amplitude * math.cos(phase),
            self.angle(given["std_arcsec"], f"{key}.std_arcsec"),
        )

    def between(self, value: Any, key: str) -> BetweenOrder:
        given = self.table(value, _BETWEEN, key)
        again = self.maybe(given["repeatability_arcsec"], f"{key}.repeatability_arcsec")
        return BetweenOrder(
            self.number(given["order"], f"{key}.order"),
            self.angle(given["std_arcsec"], f"{key}.std_arcsec"),
            None if again is None else again * self.turn,
        )

    def tolerance(self, value: Any) -> Tolerance:
        given = self.table(value, _TOLERANCE, "tolerance")
        sizes = [
            self.maybe(given[name], f"tolerance.{name}")
            for name in ("peak_to_peak_arcsec", "left_arcsec")
        ]
        return Tolerance(
            self.number(given["share"], "tolerance.share"),
            self.number(given["confidence"], "tolerance.confidence"),
            self.maybe(given["factor"], "tolerance.factor"),
            self.text(given["method"], "tolerance.method"),
            *(math.nan if size is None else size * self.turn for size in sizes),
        )

    def history(self, value: Any, key: str) -> HistoryRow:
        given = self.table(value, _HISTORY, key)
        due = given["next_calibration"]
        bound = self.maybe(given["bound_arcsec"], f"{key}.bound_arcsec")
        return HistoryRow(
            self.text(given["unit"], f"{key}.unit"),
            self.text(given["when"], f"{key}.when"),
            self.maybe(given["order"], f"{key}.order"),
            self.number(given["statistic"], f"{key}.statistic"),
            self.number(given["limit"], f"{key}.limit"),
            self.text(given["verdict"], f"{key}.verdict"),
            None if due is None else self.text(due, f"{key}.next_calibration"),
            given["extrapolated"] is True,
            None if bound is None else bound * self.turn,
            self.number(given["cusum_limit"], f"{key}.cusum_limit"),
            tuple(self.each(given["orders"], f"{key}.orders", self.moved)),
        )

    def moved(self, value: Any, key: str) -> HistoryOrder:
        given = self.table(value, _MOVED, key)
        return HistoryOrder(*(self.positive(given[name], f"{key}.{name}") for name in _MOVED))
