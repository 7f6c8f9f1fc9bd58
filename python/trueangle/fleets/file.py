"""The file of a fleet: its result in arcsec, and the prior in the numbers it was found with."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import MISSING, fields
from functools import partial
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
from ..support.plainresult import declared_fields
from .history import HistoryOrder, HistoryRow
from .result import FORMAT as FORMAT
from .result import VERDICTS, VERSION, BetweenOrder, CommonOrder, Fleet, FleetUnit, UnitOrder
from .tolerance import Tolerance

T = TypeVar("T")

_KEYS = ("prior", "units", "common", "between", "tolerance", "history", "notes")
_PRIOR = {field.name: field.default is MISSING for field in fields(Prior)}
_SHAFT = ("name", "cycles_per_turn", "orders")
_ROWS = {f"tuple[{kind.__name__}, ...]": kind for kind in (UnitOrder, HistoryOrder)}
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
        known = {"aligned": True, "probability": False, "orders": True}
        common = self.table(content["common"], known, "common")
        between = self.table(content["between"], {"orders": True}, "between")
        aligned = common["aligned"]
        if not isinstance(aligned, bool):
            raise self.error("true or false is needed", "common.aligned")
        shared = self.rows(CommonOrder, common["orders"], "common.orders")
        scatter = self.rows(BetweenOrder, between["orders"], "between.orders")
        if [order.order for order in scatter] != [order.order for order in shared]:
            raise self.error("the orders of common.orders are needed", "between.orders")
        return Fleet(
            self.rows(FleetUnit, content["units"], "units", _MOST_UNITS),
            shared,
            scatter,
            self.row(Tolerance, content["tolerance"], "tolerance"),
            self.rows(HistoryRow, content["history"], "history", _MOST_UNITS),
            self.positive(common.get("probability", float(aligned)), "common.probability"),
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

    def maybe(self, value: Any, key: str) -> float | None:
        return None if value is None else self.number(value, key)

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

    def row(self, kind: type[T], value: Any, key: str) -> T:
        """A row by the fields of its class, as `plain_row` writes them."""
        names = {
            f"{name}_arcsec" if of.startswith("Angle") else name: of
            for name, of in declared_fields(kind).items()
        }
        table = self.table(value, dict.fromkeys(names, True), key)
        return kind(*(self.cell(of, table[name], f"{key}.{name}") for name, of in names.items()))

    def rows(self, kind: type[T], value: Any, key: str, most: int = MOST_ORDERS) -> tuple[T, ...]:
        """A list of such rows."""
        return tuple(self.each(value, key, partial(self.row, kind), most))

    def cell(self, kind: str, value: Any, key: str) -> Any:
        """One field of a row, by its declaration."""
        if value is None and kind.endswith("| None"):
            return None
        match kind.removesuffix(" | None"):
            case "AngleOrNaN" if value is None:
                return math.nan
            case "Angle" | "AngleOrNaN":
                return self.positive(value, key) * self.turn
            case "float":
                return self.number(value, key)
            case "bool":
                return value is True
            case "Verdict" if value not in VERDICTS:
                raise self.error(f"one of {', '.join(VERDICTS)} is needed", key)
            case "str" | "Verdict":
                return self.text(value, key)
        return self.rows(_ROWS[kind], value, key)
