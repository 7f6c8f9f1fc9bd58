"""The model file: JSON that states sign, unit and argument, checked when read."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .errors import ArgumentError, ModelFileError, TrueAngleError
from .files import MODEL, MODEL_BYTES, read_whole, written_atomically
from .model import HarmonicModel
from .records import FitRecord, Provenance
from .runs import Source
from .shafts import Shaft
from .terms import TERMS, Term

__all__ = ["FORMAT", "VERSION", "load_model", "save_model"]

FORMAT = "trueangle-model"
VERSION = 1

#: Key of the file -> whether it must be there.
_KEYS = {
    "format": True,
    "version": True,
    "period": True,
    "argument": True,
    "shafts": True,
    "constant": True,
    "terms": False,
    "covariance": False,
    "condition_number": False,
    "fit": False,
    "provenance": False,
}
_SHAFT_KEYS = ("name", "cycles_per_turn", "orders", "cosine", "sine")


def save_model(model: HarmonicModel, path: str | PathLike[str]) -> None:
    """Write ``model``; see `HarmonicModel.save`."""
    content = {
        "format": FORMAT,
        "version": VERSION,
        "period": model.period,
        "argument": model.argument,
        "shafts": [asdict(shaft) for shaft in model.shafts],
        "constant": model.constant,
        "terms": [term.to_table() for term in model.terms],
        "covariance": None if model.covariance is None else model.covariance.tolist(),
        "condition_number": model.condition_number,
        "fit": None if model.fit is None else asdict(model.fit),
        "provenance": {
            "inputs": [source._asdict() for source in model.provenance.inputs],
            "package": model.provenance.package,
        },
    }
    text = _pretty(content) + "\n"
    if len(text) > MODEL_BYTES:
        raise ArgumentError(
            f"{path}: the model takes {len(text)} bytes, and at most {MODEL_BYTES} are read back; "
            "save it without its covariance"
        )
    hashes = [source.sha256 for source in model.provenance.inputs]
    with written_atomically(path, kind=MODEL, hashes=hashes) as file:
        file.write(text)


def load_model(path: str | PathLike[str]) -> HarmonicModel:
    """Read and check a model file; nothing in it is executed.

    Raises
    ------
    ModelFileError
        Not JSON, truncated, of a later version, unknown or missing keys, numbers that
        are not finite, a model that cannot be inverted: names the key and what to do.
    """
    return _Reader(Path(path)).model()


def _pretty(value: Any, indent: int = 0) -> str:
    """JSON with one line per key and per list of plain numbers."""
    pad = "  " * (indent + 1)
    end = "\n" + "  " * indent
    if isinstance(value, Mapping) and value:
        items = [f"{pad}{json.dumps(key)}: {_pretty(v, indent + 1)}" for key, v in value.items()]
        return "{\n" + ",\n".join(items) + end + "}"
    nested = isinstance(value, (list, tuple)) and any(isinstance(v, (Mapping, list)) for v in value)
    if nested:
        return "[\n" + ",\n".join(pad + _pretty(v, indent + 1) for v in value) + end + "]"
    return json.dumps(value, allow_nan=False)


class _Reader:
    """Checks one file key by key; every refusal names file and key."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def error(self, problem: str, key: str | None = None) -> ModelFileError:
        return ModelFileError(self.path, f"key '{key}': {problem}" if key else problem)

    def content(self) -> dict[str, Any]:
        def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
            doubled = [key for i, (key, _) in enumerate(items) if key in dict(items[:i])]
            if doubled:
                raise self.error("appears twice", doubled[0])
            return dict(items)

        def constant(name: str) -> float:
            raise self.error(f"holds {name}; every number must be finite")

        try:
            text = read_whole(self.path, MODEL_BYTES, "a model").decode("utf-8")
            value = json.loads(text, object_pairs_hook=pairs, parse_constant=constant)
        except json.JSONDecodeError as cause:
            raise ModelFileError(
                self.path,
                f"is not complete JSON ({cause.msg}): truncated or not a model file; "
                "save the model again",
                line=cause.lineno,
            ) from None
        except (UnicodeDecodeError, RecursionError):
            raise self.error("is not a model file: not JSON text") from None
        except TrueAngleError:
            raise
        except ValueError as cause:  # integers of thousands of digits
            raise self.error(f"holds a number that cannot be read: {cause}") from None
        if not isinstance(value, dict) or value.get("format") != FORMAT:
            raise self.error(f'is not a model file: "format" must be "{FORMAT}"')
        return value

    def model(self) -> HarmonicModel:
        content = self.content()
        version = content.get("version")
        if not isinstance(version, int) or isinstance(version, bool) or version < 1:
            raise self.error(f"must be a whole number from 1, got {version!r}", "version")
        if version > VERSION:
            raise self.error(
                f"{version} is later than {VERSION}, the latest this release reads; "
                "upgrade trueangle",
                "version",
            )
        self.keys(content, _KEYS)
        if content["argument"] not in ("reference", "indicated"):
            raise self.error(
                f"must be 'reference' or 'indicated', got {content['argument']!r}", "argument"
            )
        covariance = content.get("covariance")
        if covariance is not None:
            if not isinstance(covariance, list):
                raise self.error("must be a list of rows", "covariance")
            rows = [self.numbers(row, f"covariance[{i}]") for i, row in enumerate(covariance)]
            if any(len(row) != len(rows) for row in rows):
                raise self.error("must be square", "covariance")
            covariance = np.array(rows).reshape(len(rows), -1)
        condition = content.get("condition_number")
        try:
            return HarmonicModel(
                shafts=self.shafts(content["shafts"]),
                constant=self.number(content["constant"], "constant"),
                period=self.number(content["period"], "period"),
                argument=content["argument"],
                covariance=covariance,
                condition_number=None
                if condition is None
                else self.number(condition, "condition_number"),
                fit=self.fit(content.get("fit")),
                provenance=self.provenance(content.get("provenance")),
                terms=self.terms(content.get("terms")),
            )
        except ModelFileError:
            raise
        except ValueError as cause:  # the model's own checks, under the file's name
            raise self.error(str(cause)) from None

    def keys(self, content: Mapping[str, Any], known: Mapping[str, bool], where: str = "") -> None:
        for key in content:
            if key not in known:
                raise self.error(f"is unknown; the keys are {', '.join(known)}", f"{where}{key}")
        for key, needed in known.items():
            if needed and key not in content:
                raise self.error("is missing", f"{where}{key}")

    def number(self, value: Any, key: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(f"a number is needed, got {value!r}", key)
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error("every number must be finite and within double range", key)
        return number

    def numbers(self, values: Any, key: str) -> tuple[float, ...]:
        if not isinstance(values, list):
            raise self.error(f"a list of numbers is needed, got {type(values).__name__}", key)
        return tuple(self.number(value, f"{key}[{i}]") for i, value in enumerate(values))

    def shafts(self, values: Any) -> tuple[Shaft, ...]:
        if not isinstance(values, list):
            raise self.error("a list of shafts is needed", "shafts")
        shafts = []
        for i, value in enumerate(values):
            where = f"shafts[{i}]."
            if not isinstance(value, dict):
                raise self.error("an object is needed", where[:-1])
            self.keys(value, dict.fromkeys(_SHAFT_KEYS, True), where)
            if not isinstance(value["name"], str):
                raise self.error("a text is needed", where + "name")
            orders = self.numbers(value["orders"], where + "orders")
            if any(k != int(k) or not 1 <= k < 2**32 for k in orders):
                raise self.error("orders are whole numbers from 1", where + "orders")
            shafts.append(
                Shaft(
                    value["name"],
                    self.number(value["cycles_per_turn"], where + "cycles_per_turn"),
                    tuple(int(k) for k in orders),
                    self.numbers(value["cosine"], where + "cosine"),
                    self.numbers(value["sine"], where + "sine"),
                )
            )
        return tuple(shafts)

    def terms(self, values: Any) -> tuple[Term, ...]:
        if values is None:
            return ()
        if not isinstance(values, list):
            raise self.error("a list of terms is needed", "terms")
        terms = []
        for i, value in enumerate(values):
            where = f"terms[{i}]"
            if not isinstance(value, dict):
                raise self.error("an object is needed", where)
            kind = value.get("kind")
            if kind not in TERMS:
                raise self.error(
                    f"{kind!r} is unknown; the kinds are {', '.join(TERMS)}; "
                    "a later trueangle may know it",
                    f"{where}.kind",
                )
            table = {key: entry for key, entry in value.items() if key != "kind"}
            try:
                terms.append(TERMS[kind].from_table(table))
            except ArgumentError as cause:
                raise self.error(str(cause), where) from None
        return tuple(terms)

    def fit(self, value: Any) -> FitRecord | None:
        if value is None:
            return None
        known = {
            f.name: f.name in ("samples", "runs", "span", "residual") for f in fields(FitRecord)
        }
        if not isinstance(value, dict):
            raise self.error("an object is needed", "fit")
        self.keys(value, known, "fit.")
        checked: dict[str, Any] = {}
        for key, entry in value.items():
            name = f"fit.{key}"
            if key in ("method", "loss", "note"):
                if not isinstance(entry, str):
                    raise self.error(f"a text is needed, got {entry!r}", name)
                checked[key] = entry
            elif key in ("span", "offsets"):
                checked[key] = self.numbers(entry, name)
            elif key in ("samples", "runs", "wild", "positions"):
                whole = entry is None if key == "positions" else False
                if not whole and (self.number(entry, name) != int(entry) or entry < 0):
                    raise self.error(f"a count is needed, got {entry!r}", name)
                checked[key] = entry
            else:
                checked[key] = self.number(entry, name)
        if len(checked["span"]) != 2:
            raise self.error("two angles are needed", "fit.span")
        return FitRecord(**checked)

    def provenance(self, value: Any) -> Provenance:
        if value is None:
            return Provenance()
        if not isinstance(value, dict):
            raise self.error("an object is needed", "provenance")
        self.keys(value, {"inputs": True, "package": True}, "provenance.")
        inputs = []
        for i, entry in enumerate(value["inputs"]):
            where = f"provenance.inputs[{i}]"
            if not isinstance(entry, dict):
                raise self.error("an object is needed", where)
            self.keys(entry, {"file": True, "sha256": True}, where + ".")
            inputs.append(Source(str(entry["file"]), str(entry["sha256"])))
        return Provenance(tuple(inputs), str(value["package"]))
