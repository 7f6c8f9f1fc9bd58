"""What a model file states about its origin: record of the fit and provenance."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from ..support.decoding import Decoder, shown_value
from ..support.files import InputFile

#: Bound of the ends of a span, turns.
MOST_TURNS = 1e9

#: Ranges of signals and runs or files that a record lists, at most.
MAX_TERMS = 64
MAX_OFFSETS = 1_000_000


@dataclass(frozen=True)
class TableRecord:
    """The table of a machine that a model was read from.

    ``target`` is the machine's name in `trueangle.export_model`, ``argument`` the angle at which it
    looks up; ``rms`` and ``max_abs`` are what its own arithmetic (lines between its entries,
    whole numbers) adds to the model's error, in the unit of the model's period.
    """

    target: str
    argument: str
    rms: float
    max_abs: float


@dataclass(frozen=True)
class FitRecord:
    """How a model was fitted: what its file states under ``fit``.

    ``span`` is the range of angles that was fitted, ``(0, period)`` for a full turn;
    ``residual`` is the residual standard deviation (None where no reading is left over to
    take it from), ``offsets`` the zero of every run and ``offset_spread`` their standard
    deviation, all in the unit of the model's period. ``positions`` counts the distinct
    angles within a turn; ``note`` states where the model is verified and where not.
    ``calibrated_without_reference`` marks a model of `trueangle.selfcal`, and ``blind`` what
    such a model cannot know, one sentence each. ``freedom`` is there where the covariance was taken
    from how runs or segments of readings scatter: its degrees of freedom, the fewest of any
    coefficient, which are far fewer than readings less unknowns. ``signals`` holds the range of
    each signal that the terms of the model were found over, ``(name, lowest, highest)``, and
    ``table`` is there where the model was read from a machine.
    """

    samples: int
    runs: int
    span: tuple[float, float]
    residual: float | None
    method: str = "plain"
    loss: str = "linear"
    wild: int = 0
    ridge: float = 0.0
    offsets: tuple[float, ...] = ()
    offset_spread: float = 0.0
    positions: int | None = None
    note: str = ""
    calibrated_without_reference: bool = False
    blind: tuple[str, ...] = ()
    freedom: float | None = None
    signals: tuple[tuple[str, float, float], ...] = ()
    table: TableRecord | None = None

    def mirrored(self) -> FitRecord:
        """The record of the same fit with every angle counted the other way."""
        return replace(
            self,
            span=(-self.span[1], -self.span[0]),
            offsets=tuple(-zero for zero in self.offsets),
            signals=tuple(
                (name, -high, -low) if name == "velocity" else (name, low, high)
                for name, low, high in self.signals
            ),
        )


@dataclass(frozen=True)
class Provenance:
    """Where a model came from: its input files with their sha256, and the package."""

    inputs: tuple[InputFile, ...] = ()
    package: str = ""


class RecordReader(Decoder):
    """Checks the records key by key."""

    def fit(self, value: Any, period: float) -> FitRecord | None:
        """What is recorded of the fit."""
        if value is None:
            return None
        needed = ("samples", "runs", "span", "residual")
        table = self.table(value, {f.name: f.name in needed for f in fields(FitRecord)}, "fit")
        checked: dict[str, Any] = {}
        for key, entry in table.items():
            name = f"fit.{key}"
            if key in ("method", "loss", "note"):
                checked[key] = self.text(entry, name)
            elif key == "calibrated_without_reference":
                if not isinstance(entry, bool):
                    raise self.error(f"true or false is needed, got {shown_value(entry)}", name)
                checked[key] = entry
            elif key == "blind":
                # Most sentences of a record about what its model is blind to.
                texts = self.items(entry, name, "texts", 1000)
                checked[key] = tuple(self.text(t, f"{name}[{i}]") for i, t in enumerate(texts))
            elif key == "signals":
                ranges = self.items(entry, name, "ranges", MAX_TERMS)
                checked[key] = tuple(self.range(r, f"{name}[{i}]") for i, r in enumerate(ranges))
            elif key == "table":
                read = self.table(entry, {f.name: True for f in fields(TableRecord)}, name)
                checked[key] = TableRecord(
                    self.text(read["target"], f"{name}.target"),
                    self.text(read["argument"], f"{name}.argument"),
                    self.number(read["rms"], f"{name}.rms"),
                    self.number(read["max_abs"], f"{name}.max_abs"),
                )
            elif key in ("span", "offsets"):
                checked[key] = self.numbers(entry, name, MAX_OFFSETS)
            elif key in ("samples", "runs", "wild", "positions"):
                unknown = entry is None and key == "positions"
                checked[key] = None if unknown else self.whole(entry, name)
            elif entry is None and key == "residual":
                checked[key] = None
            else:
                checked[key] = self.number(entry, name)
        if checked.get("freedom", 1.0) <= 0.0:
            raise self.error(f"must be positive, got {checked['freedom']:g}", "fit.freedom")
        span = checked["span"]
        if len(span) != 2 or span[0] > span[1] or max(map(abs, span)) > MOST_TURNS * period:
            raise self.error(
                f"two angles, the first the smaller, are needed, got {span}", "fit.span"
            )
        return FitRecord(**checked)

    def range(self, value: Any, key: str) -> tuple[str, float, float]:
        """A signal and its least and greatest value."""
        found = self.items(value, key, "a name and two numbers", 3)
        if len(found) != 3:
            raise self.error(f"a name and two numbers are needed, got {shown_value(found)}", key)
        low, high = (self.number(end, key) for end in found[1:])
        if low > high:
            raise self.error(f"the least value comes first, got {shown_value(found)}", key)
        return self.text(found[0], key), low, high

    def provenance(self, value: Any) -> Provenance:
        """Files that the model was made of."""
        if value is None:
            return Provenance()
        table = self.table(value, {"inputs": True, "package": True}, "provenance")
        inputs = []
        listed = self.items(table["inputs"], "provenance.inputs", "files", MAX_OFFSETS)
        for i, entry in enumerate(listed):
            where = f"provenance.inputs[{i}]"
            source = self.table(entry, {"file": True, "sha256": True}, where)
            texts = (self.text(source[key], f"{where}.{key}") for key in ("file", "sha256"))
            inputs.append(InputFile(*texts))
        return Provenance(tuple(inputs), self.text(table["package"], "provenance.package"))
