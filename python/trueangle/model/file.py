"""The model file: JSON that states sign, unit and argument, checked when read."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ArgumentError, FileError, ModelFileError, OutsideSpanWarning
from ..joint.shafts import Shaft
from ..runs.rawchannels import CONSTANTS, Channels
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.decoding import MAX_ORDER, json_value, read_text, shown_value
from ..support.files import MODEL_BYTES
from ..support.layout import counted
from .model import HarmonicModel
from .records import MAX_TERMS, MOST_TURNS, RecordReader
from .term import Term
from .validity import check_lines
from .writing import FORMAT as FORMAT
from .writing import ROBOT_FORMAT
from .writing import VERSION as VERSION
from .writing import save_model as save_model

#: Key of the file -> whether it must be there.
_KEYS = {
    "format": True,
    "version": True,
    "period": True,
    "argument": True,
    "indicated": False,
    "channels": False,
    "shafts": True,
    "constant": True,
    "terms": False,
    "covariance": False,
    "condition_number": False,
    "fit": False,
    "provenance": False,
}
_CHANNEL_KEYS = (*CONSTANTS, "direction", "periods_per_turn", "harmonics", "covariance")
_TRACK_KEYS = (*_CHANNEL_KEYS, "second", "second_zero_deg", "excitation_deg")
#: Lines of one term, at most.
MAX_TERM_LINES = 4096
#: Smallest turn in the unit of angles, and the inverse of the largest.
_LEAST_PERIOD = 1e-12
#: Signals (velocity in turns per second) at which any model must correct.
_NORMAL = (
    {"velocity": 0.01, "temperature": 20.0, "torque": 1.0, "current": 1.0, "direction": 1.0},
    {"velocity": -0.01, "temperature": 40.0, "torque": -1.0, "current": -1.0, "direction": -1.0},
)
_SHAFT_KEYS = ("name", "cycles_per_turn", "orders", "cosine", "sine")


@told_kinds
def load_model(path: str | PathLike[str]) -> HarmonicModel:
    """Read and check a model file; nothing in it is executed.

    Raises
    ------
    ModelFileError
        Not JSON, truncated, of a later version, unknown or missing keys, numbers that
        are not finite, a model that cannot be inverted: names the key and what to do.
    """
    return _ModelReader(Path(path), ModelFileError).model()


def embedded_model(text: str, path: str | PathLike[str]) -> HarmonicModel:
    """Model of the text of a model file embedded in another file; raises as `load_model`."""
    file = Path(path)
    return model_of_part(file, json_value(file, text, ModelFileError, "a model file"), "")


def model_file_content(path: Path, wanted: str) -> dict[str, Any]:
    """The object of a file of the format that is wanted and of a version that is known."""
    reader = _ModelReader(path, ModelFileError)
    content = reader.content(wanted)
    reader.version(content)
    return content


def model_of_part(path: Path, value: Any, prefix: str) -> HarmonicModel:
    """The model that a part of a file is; messages put ``prefix`` before its keys."""
    reader = _ModelReader(path, ModelFileError)
    reader.prefix = prefix
    return reader.model_of(value)


class _ModelReader(RecordReader):
    """Checks a model key by key; refusals name file and key, behind the ``prefix`` of a part."""

    prefix = ""

    def error(self, problem: str, key: str | None = None) -> FileError:
        """The error that reports ``problem`` at ``key``."""
        return super().error(problem, ".".join(filter(None, (self.prefix, key))) or None)

    def content(self, wanted: str) -> dict[str, Any]:
        """The file's object, of the format that is wanted."""
        text = read_text(self.path, MODEL_BYTES, self.kind, "a model")
        return self.of_format(json_value(self.path, text, self.kind, "a model file"), wanted)

    def of_format(self, value: Any, wanted: str) -> dict[str, Any]:
        """The object, where it is of the format that is wanted; names the other's reader."""
        found = value.get("format") if isinstance(value, dict) else None
        if found != wanted:
            hint = ""
            if found == ROBOT_FORMAT:
                hint = "; it holds the joints of a robot: read it with ta.load_robot"
            elif found == FORMAT:
                hint = "; it holds the model of one joint: read it with ta.load_model"
            what = "the file of a robot" if wanted == ROBOT_FORMAT else "a model file"
            raise self.error(f'is not {what}: "format" must be "{wanted}"{hint}')
        return dict(value)

    def version(self, content: Mapping[str, Any]) -> None:
        """Refuse a version that a later release wrote."""
        version = self.whole(content.get("version"), "version", 1)
        if version > VERSION:
            raise self.error(
                f"{version} is later than {VERSION}, the latest this release reads; "
                "upgrade trueangle",
                "version",
            )

    def model(self) -> HarmonicModel:
        return self.model_of(self.content(FORMAT))

    def model_of(self, value: Any) -> HarmonicModel:
        """The model of an object that has been read."""
        content = self.of_format(value, FORMAT)
        self.version(content)
        self.table(content, _KEYS)
        argument = content["argument"]
        if argument not in ("reference", "indicated"):
            raise self.error(
                f"must be 'reference' or 'indicated', got {shown_value(argument)}", "argument"
            )
        condition = content.get("condition_number")
        period = self.number(content["period"], "period")
        if not _LEAST_PERIOD <= period <= 1.0 / _LEAST_PERIOD:
            raise self.error(
                f"one turn in the unit of the angles (360 for degrees) is needed, got {period!r}",
                "period",
            )
        shafts = self.shafts(content["shafts"], MOST_TURNS * period)
        try:
            check_lines(shafts, period if argument == "reference" else math.inf)
        except ArgumentError as cause:
            raise self.error(str(cause), "shafts") from None
        try:
            model = HarmonicModel(
                shafts=shafts,
                constant=self.number(content["constant"], "constant"),
                period=period,
                argument=argument,
                covariance=self.covariance(content.get("covariance"), shafts),
                condition_number=None if condition is None else self.condition(condition),
                fit=self.fit(content.get("fit"), period),
                provenance=self.provenance(content.get("provenance")),
                terms=self.terms(content.get("terms")),
                indicated_sign=self.sign(content.get("indicated", {"sign": 1})),
                channels=self.channels(content.get("channels"), period),
            )
            if model.terms:
                self.check_finite(model)
        except FileError:
            raise
        except ValueError as cause:  # the model's own checks, under the file's name
            raise self.error(str(cause)) from None
        return model

    def check_finite(self, model: HarmonicModel) -> None:
        """Terms whose numbers leave no finite correction at a joint's normal signals."""
        angles = np.arange(0.0, 1.0, 1.0 / 16.0) * model.period
        start = 0.0 if model.fit is None else model.fit.span[0]
        for signals in _NORMAL:
            given: Any = {
                name: value * model.period if name == "velocity" else value
                for name, value in signals.items()
                if name in model.uses_signals
            }
            # A quarter turn of other joints.
            others = (name for name in model.uses_signals if name not in signals)
            given |= dict.fromkeys(others, 0.25 * signals["direction"] * model.period)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", OutsideSpanWarning)
                corrected = model.correct(start + angles, **given)
            if not np.isfinite(corrected).all():
                listed = ", ".join(f"{name} {value:g}" for name, value in given.items())
                raise self.error(f"leave no finite correction at {listed or 'any angle'}", "terms")

    def condition(self, value: Any) -> float:
        number = self.number(value, "condition_number")
        if number < 0.0:
            raise self.error(f"must not be negative, got {number!r}", "condition_number")
        return number

    def sign(self, value: Any) -> int:
        """Of the indicated angle against what the sensor reads."""
        sign = self.table(value, {"sign": True}, "indicated")["sign"]
        if isinstance(sign, bool) or sign not in (1, -1):
            raise self.error(f"must be 1 or -1, got {shown_value(sign)}", "indicated.sign")
        return int(sign)

    def channels(self, value: Any, period: float) -> Channels | None:
        """Constants of a sine and a cosine channel."""
        if value is None:
            return None
        table = self._track(value, "channels", _TRACK_KEYS)
        if table.get("second") is not None:
            table["second"] = self._track(table["second"], "channels.second", _CHANNEL_KEYS)
        try:
            return Channels.from_table(table, period)
        except ValueError as cause:
            raise self.error(str(cause), "channels") from None

    def _track(self, value: Any, path: str, keys: tuple[str, ...]) -> dict[str, Any]:
        """Constants of one track, by their types."""
        table = self.table(value, {name: name in CONSTANTS for name in keys}, path)
        checked: dict[str, Any] = {
            name: self.number(table[name], f"{path}.{name}") for name in CONSTANTS
        }
        for name in ("direction", "periods_per_turn", "second_zero_deg", "excitation_deg"):
            if name in table:
                checked[name] = self.number(table[name], f"{path}.{name}")
        harmonics = self.items(
            table.get("harmonics", []), f"{path}.harmonics", "harmonics", MAX_TERM_LINES
        )
        entries = []
        for i, entry in enumerate(harmonics):
            where = f"{path}.harmonics[{i}]"
            found = self.table(entry, {"order": True, "re": True, "im": True, "std": False}, where)
            numbers = {name: self.number(v, f"{where}.{name}") for name, v in found.items()}
            if not numbers["order"].is_integer() or abs(numbers["order"]) > MAX_ORDER:
                raise self.error("a whole number is needed", f"{where}.order")
            entries.append({**numbers, "order": int(numbers["order"])})
        checked["harmonics"] = entries
        rows = table.get("covariance")
        if rows is not None:
            listed = self.items(rows, f"{path}.covariance", "rows", len(CONSTANTS))
            checked["covariance"] = tuple(
                self.numbers(row, f"{path}.covariance[{i}]") for i, row in enumerate(listed)
            )
        if "second" in table:
            checked["second"] = table["second"]
        return checked

    def covariance(self, value: Any, shafts: tuple[Shaft, ...]) -> Array | None:
        if value is None:
            return None
        size = 1 + 2 * sum(len(shaft.orders) for shaft in shafts)
        rows = self.items(value, "covariance", "rows")
        if len(rows) != size:
            raise self.error(
                f"must be square, {size} x {size} for these shafts, got {counted(rows, 'row')}",
                "covariance",
            )
        found = np.empty((size, size))
        for i, row in enumerate(rows):
            numbers = self.numbers(row, f"covariance[{i}]")
            if len(numbers) != size:
                raise self.error(f"must be square, {size} x {size}", "covariance")
            found[i] = numbers
        return found

    def shafts(self, value: Any, most: float) -> tuple[Shaft, ...]:
        shafts = []
        for i, entry in enumerate(self.items(value, "shafts", "shafts")):
            where = f"shafts[{i}]"
            table = self.table(entry, dict.fromkeys(_SHAFT_KEYS, True), where)
            cycles = self.number(table["cycles_per_turn"], f"{where}.cycles_per_turn")
            if not cycles > 0.0:
                raise self.error(f"must be positive, got {cycles!r}", f"{where}.cycles_per_turn")
            listed = self.items(table["orders"], f"{where}.orders", "orders")
            orders = tuple(
                self.whole(k, f"{where}.orders[{j}]", 1, 2**32 - 1) for j, k in enumerate(listed)
            )
            shafts.append(
                Shaft(
                    self.text(table["name"], f"{where}.name"),
                    cycles,
                    orders,
                    self.amplitudes(table["cosine"], f"{where}.cosine", most),
                    self.amplitudes(table["sine"], f"{where}.sine", most),
                )
            )
        return tuple(shafts)

    def amplitudes(self, value: Any, key: str, most: float) -> tuple[float, ...]:
        found = self.numbers(value, key)
        for i, amplitude in enumerate(found):
            if abs(amplitude) > most:
                raise self.error(f"more than {MOST_TURNS:.0g} turns: {amplitude!r}", f"{key}[{i}]")
        return found

    def terms(self, value: Any) -> tuple[Term, ...]:
        if value is None:
            return ()
        from .terms import TERMS  # most models have none

        terms = []
        for i, entry in enumerate(self.items(value, "terms", "terms", MAX_TERMS)):
            where = f"terms[{i}]"
            if not isinstance(entry, dict):
                raise self.error(f"an object is needed, got {shown_value(entry)}", where)
            kind = entry.get("kind")
            if not isinstance(kind, str) or kind not in TERMS:
                raise self.error(
                    f"{shown_value(kind)} is unknown; the kinds are {', '.join(TERMS)}; "
                    "a later trueangle may know it",
                    f"{where}.kind",
                )
            table = {key: self.parameter(v, f"{where}.{key}") for key, v in entry.items()}
            table.pop("kind")
            try:
                terms.append(TERMS[kind].from_table(table))
            except ArgumentError as cause:
                raise self.error(str(cause), where) from None
        return tuple(terms)

    def parameter(self, value: Any, key: str) -> Any:
        """A parameter of a term: a number, a text, none, or lists of numbers."""
        if value is None or isinstance(value, str):
            return value
        if not isinstance(value, list):
            number = self.number(value, key)
            if key.endswith("order") and abs(number) > MAX_ORDER:
                raise self.error(f"more than {MAX_ORDER:.0f} cycles per turn", key)
            return value
        found = self.items(value, key, "numbers", MAX_TERM_LINES)
        for i, entry in enumerate(found):
            if isinstance(entry, list):
                self.numbers(entry, f"{key}[{i}]", MAX_TERM_LINES)
            elif self.number(entry, f"{key}[{i}]") > MAX_ORDER and key.endswith("orders"):
                raise self.error(f"more than {MAX_ORDER:.0f} cycles per turn", f"{key}[{i}]")
        return found
