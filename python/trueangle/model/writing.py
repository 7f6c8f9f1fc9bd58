"""The file of a model or of a robot as it is written: its plain values, its text."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import asdict, replace
from os import PathLike
from typing import Any, Final

from ..errors import LargeModelWarning, level_of_caller
from ..support.files import MODEL, MODEL_BYTES, written_atomically
from ..support.plainresult import pretty_json
from .errormodel import ErrorModel
from .records import FitRecord
from .validity import check_lines

FORMAT = "trueangle-model"
ROBOT_FORMAT = "trueangle-robot"
VERSION = 1

#: Bytes of a number in a file at most: 17 digits, sign, point, exponent and separator.
FLOAT_BYTES: Final = 26


def model_text(model: ErrorModel) -> str:
    """What the file of a model holds."""
    return pretty_json(plain_model(model)) + "\n"


def plain_model(model: ErrorModel) -> dict[str, Any]:
    """The object that the file of a model is."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "period": model.period,
        "argument": model.argument,
        "indicated": {"sign": model.indicated_sign},
        **({} if model.channels is None else {"channels": model.channels.to_table()}),
        "shafts": [asdict(shaft) for shaft in model.shafts],
        "constant": model.constant,
        "terms": [term.to_table() for term in model.terms],
        "covariance": None if model.covariance is None else model.covariance.tolist(),
        "condition_number": model.condition_number,
        "fit": None if model.fit is None else _record(model.fit),
        "provenance": {
            "inputs": [source._asdict() for source in model.provenance.inputs],
            "package": model.provenance.package,
        },
    }


def save_model(model: ErrorModel, path: str | PathLike[str]) -> None:
    """Write ``model``; see `HarmonicModel.save`."""
    text = model_text(_readable(model, path, 1))
    hashes = [source.sha256 for source in model.provenance.inputs]
    with written_atomically(path, kind=MODEL, hashes=hashes) as file:
        file.write(text)


def _readable(model: ErrorModel, path: str | PathLike[str], models: int) -> ErrorModel:
    """The model, without a covariance that makes a file of ``models`` longer than is read back.

    Raises
    ------
    ArgumentError
        Harmonics of which no file is read back.
    """
    check_lines(model.shafts, model.period if model.argument == "reference" else math.inf)
    covariance = model.covariance
    if covariance is None or models * FLOAT_BYTES * covariance.size <= MODEL_BYTES:
        return model
    warnings.warn(
        f"{path}: saved without the covariance of {len(covariance)} numbers, which makes the file "
        f"longer than the {MODEL_BYTES >> 20} MiB that are read back; fit fewer orders to keep it",
        LargeModelWarning,
        stacklevel=level_of_caller(),
    )
    return replace(model, covariance=None)


def save_robot(
    models: Mapping[str, ErrorModel],
    name: str,
    signals: Mapping[str, Mapping[str, Any]],
    path: str | PathLike[str],
) -> None:
    """Write the models of a robot; see `Robot.save`."""
    content: dict[str, Any] = {"format": ROBOT_FORMAT, "version": VERSION}
    if name:
        content["name"] = name
    if signals:
        content["signals"] = {
            joint: {role: [*column] for role, column in columns.items()}
            for joint, columns in signals.items()
        }
    content["joints"] = {
        joint: plain_model(_readable(model, path, len(models))) for joint, model in models.items()
    }
    text = pretty_json(content) + "\n"
    hashes = [source.sha256 for model in models.values() for source in model.provenance.inputs]
    with written_atomically(path, kind=MODEL, hashes=hashes) as file:
        file.write(text)


def _record(record: FitRecord) -> dict[str, Any]:
    """The record; the keys of a calibration without a reference only for such a one."""
    table = asdict(record)
    if not record.calibrated_without_reference:
        del table["calibrated_without_reference"], table["blind"]
    for name in ("freedom", "signals", "table"):
        if not table[name]:
            del table[name]
    return table
