"""What a model file records of the fit and of where its readings came from, checked when read."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from ..support.decoding import Decoder, shown
from ..support.files import Source
from .records import FitRecord, Provenance, TableRecord
from .validity import MOST_TURNS

__all__ = ["MAX_TERMS", "RecordReader"]

#: Ranges of signals and runs or files that a record lists, at most.
MAX_TERMS = 64
MAX_OFFSETS = 1_000_000
#: Sentences that a record says of what its model is blind to.
_MOST_SENTENCES = 1000


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
                    raise self.error(f"true or false is needed, got {shown(entry)}", name)
                checked[key] = entry
            elif key == "blind":
                texts = self.items(entry, name, "texts", _MOST_SENTENCES)
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
            raise self.error(f"a name and two numbers are needed, got {shown(found)}", key)
        low, high = (self.number(end, key) for end in found[1:])
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
            inputs.append(Source(*texts))
        return Provenance(tuple(inputs), self.text(table["package"], "provenance.package"))
