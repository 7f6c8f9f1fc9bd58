"""The file of a fleet: its result in arcsec, and the prior in the numbers it was found with."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, fields
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ..errors import FileError
from ..fitting.prior import Prior
from ..joint.shafts import MOST_ORDERS, ShaftOrders
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import told_kinds
from ..support.decoding import Decoder, Entries, json_value, read_text
from ..support.files import RUNS_BYTES
from .history import HistoryOrder, HistoryRow
from .result import FORMAT, VERSION, BetweenOrder, CommonOrder, Fleet
from .tolerance import Tolerance
from .unit import VERDICTS, FleetUnit, UnitOrder

__all__ = ["FORMAT", "load_fleet"]

T = TypeVar("T")

_KEYS = ("prior", "units", "common", "between", "tolerance", "history", "notes")
_PRIOR = {field.name: field.default is MISSING for field in fields(Prior)}
_UNIT = ("unit", "verdict", "because", "orders", "peak_to_peak_arcsec", "left_arcsec", "p", "limit")
_ROW = ("order", "amplitude_arcsec", "phase_deg", "std_arcsec", "z")
_COMMON = ("order", "shaft", "amplitude_arcsec", "phase_deg", "std_arcsec")
_BETWEEN = ("order", "std_arcsec", "repeatability_arcsec")
_SHAFT = ("name", "cycles_per_turn", "orders")
_TOLERANCE = ("share", "confidence", "factor", "method", "peak_to_peak_arcsec", "left_arcsec")
_HISTORY = (*(name for name in HistoryRow._fields if name != "bound"), "bound_arcsec")

#: Units, at most.
_MOST_UNITS = 2_000_000


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
        content = json_value(self.path, text, self.kind, "a fleet file")
        if not isinstance(content, dict) or content.get("format") != FORMAT:
            raise self.error(f"'format' must be {FORMAT!r}: this is not a fleet file")
        if content.get("version") != VERSION:
            raise self.error(f"version {VERSION} is known; install a later trueangle", "version")
        self.table(content, dict.fromkeys(("format", "version", *_KEYS), True))
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

    def each(self, value: Any, key: str, read: Any, most: int = MOST_ORDERS) -> list[Any]:
        entries = self.items(value, key, "entries", most)
        return [read(entry, f"{key}[{i}]") for i, entry in enumerate(entries)]

    def positive(self, value: Any, key: str) -> float:
        number = self.number(value, key)
        if number < 0.0:
            raise self.error("must not be negative", key)
        return number

    def above_zero(self, value: Any, key: str) -> float:
        number = self.number(value, key)
        if number <= 0.0:
            raise self.error("must be positive", key)
        return number

    def angle(self, value: Any, key: str) -> float:
        return self.positive(value, key) * self.turn

    def maybe(self, value: Any, key: str) -> float | None:
        return None if value is None else self.number(value, key)

    def maybe_angle(self, value: Any, key: str) -> float | None:
        number = self.maybe(value, key)
        return None if number is None else number * self.turn

    def maybe_text(self, value: Any, key: str) -> str | None:
        return None if value is None else self.text(value, key)

    def listed(self, read: Callable[[Any, str], T]) -> Callable[[Any, str], tuple[T, ...]]:
        return lambda value, key: tuple(self.each(value, key, read))

    def prior(self, value: Any) -> Prior:
        of = Entries(self.table(value, _PRIOR, "prior"), "prior")
        period = of(self.above_zero, "period")
        shafts = of(self.listed(self.shaft), "shafts")
        size = 2 * sum(len(shaft.orders) for shaft in shafts)
        mean, variance = (np.array(of(self.coefficients, name)) for name in ("mean", "variance"))
        if mean.size != size or variance.size != size or (variance < 0.0).any():
            raise self.error(f"{size} numbers, none negative, are needed", "prior.variance")
        runs = np.array(of(self.coefficients, "run_variance")) if "run_variance" in value else None
        if runs is not None and (runs.size != size or (runs < 0.0).any()):
            raise self.error(f"{size} numbers, none negative, are needed", "prior.run_variance")
        worth = of(self.maybe, "noise_freedom")
        noise = of(self.above_zero, "noise_variance")
        return Prior(
            period,
            shafts,
            mean,
            variance,
            max(of(self.positive, "freedom"), 1.0),
            noise,
            math.inf if worth is None else worth,
            of(lambda v, k: self.whole(v, k, 1), "units"),
            runs,
        )

    def coefficients(self, value: Any, key: str) -> tuple[float, ...]:
        return self.numbers(value, key, 2 * MOST_ORDERS)

    def shaft(self, value: Any, key: str) -> ShaftOrders:
        of = self.entries(value, _SHAFT, key)
        orders = of(self.listed(lambda v, k: self.whole(v, k, 1, 2**31)), "orders")
        cycles = of(self.above_zero, "cycles_per_turn")
        return ShaftOrders(of(self.text, "name"), cycles, orders)

    def verdict(self, value: Any, key: str) -> Any:
        if value not in VERDICTS:
            raise self.error(f"one of {', '.join(VERDICTS)} is needed", key)
        return value

    def unit(self, value: Any, key: str) -> FleetUnit:
        of = self.entries(value, _UNIT, key)
        verdict = of(self.verdict, "verdict")
        return FleetUnit(
            of(self.text, "unit"),
            verdict,
            of(self.text, "because"),
            of(self.listed(self.row), "orders"),
            of(self.angle, "peak_to_peak_arcsec"),
            of(self.angle, "left_arcsec"),
            of(self.number, "p"),
            of(self.number, "limit"),
        )

    def row(self, value: Any, key: str) -> UnitOrder:
        of = self.entries(value, _ROW, key)
        return UnitOrder(
            of(self.number, "order"),
            of(self.angle, "amplitude_arcsec"),
            of(self.number, "phase_deg"),
            of(self.angle, "std_arcsec"),
            of(self.number, "z"),
        )

    def common(self, value: Any, key: str) -> CommonOrder:
        of = self.entries(value, _COMMON, key)
        amplitude = of(self.angle, "amplitude_arcsec")
        phase = math.radians(of(self.number, "phase_deg"))
        return CommonOrder(
            of(self.number, "order"),
            of(self.text, "shaft"),
            amplitude * math.sin(phase),
            amplitude * math.cos(phase),
            of(self.angle, "std_arcsec"),
        )

    def between(self, value: Any, key: str) -> BetweenOrder:
        of = self.entries(value, _BETWEEN, key)
        again = of(self.maybe_angle, "repeatability_arcsec")
        return BetweenOrder(of(self.number, "order"), of(self.angle, "std_arcsec"), again)

    def tolerance(self, value: Any) -> Tolerance:
        of = self.entries(value, _TOLERANCE, "tolerance")
        sizes = [of(self.maybe_angle, name) for name in ("peak_to_peak_arcsec", "left_arcsec")]
        return Tolerance(
            of(self.number, "share"),
            of(self.number, "confidence"),
            of(self.maybe, "factor"),
            of(self.text, "method"),
            *(math.nan if size is None else size for size in sizes),
        )

    def history(self, value: Any, key: str) -> HistoryRow:
        of = self.entries(value, _HISTORY, key)
        bound = of(self.maybe_angle, "bound_arcsec")
        return HistoryRow(
            of(self.text, "unit"),
            of(self.text, "when"),
            of(self.maybe, "order"),
            of(self.number, "statistic"),
            of(self.number, "limit"),
            of(self.text, "verdict"),
            of(self.maybe_text, "next_calibration"),
            of(lambda v, _: v is True, "extrapolated"),
            bound,
            of(self.number, "cusum_limit"),
            of(self.listed(self.moved), "orders"),
        )

    def moved(self, value: Any, key: str) -> HistoryOrder:
        of = self.entries(value, HistoryOrder._fields, key)
        return HistoryOrder(*(of(self.positive, name) for name in HistoryOrder._fields))
