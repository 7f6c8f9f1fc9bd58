"""A model as text: in words, and its file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from os import PathLike
from typing import Any

from ..errors import ArgumentError
from ..support.angles import arcsec, unit_name
from ..support.display_units import error_unit, sine_of_rms
from ..support.files import MODEL, MODEL_BYTES, written_atomically
from ..support.layout import laid_out, wrapped
from ..support.plainresult import pretty_json
from .errormodel import ErrorModel
from .records import FitRecord

FORMAT = "trueangle-model"
ROBOT_FORMAT = "trueangle-robot"
VERSION = 1

#: Lines that a summary lists before it says how many more there are.
_LISTED = 40

#: Names that one line lists, and their letters.
_NAMED, _LETTERS = 4, 24


def model_text(model: ErrorModel) -> str:
    """What the file of a model holds."""
    return pretty_json(model_content(model)) + "\n"


def model_content(model: ErrorModel) -> dict[str, Any]:
    """The object that the file of a model is."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "period": model.period,
        "argument": model.argument,
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
    text = model_text(model)
    if len(text) > MODEL_BYTES:
        raise ArgumentError(
            f"{path}: the model takes {len(text)} bytes, and at most {MODEL_BYTES} are read back; "
            "save it without its covariance"
        )
    hashes = [source.sha256 for source in model.provenance.inputs]
    with written_atomically(path, kind=MODEL, hashes=hashes) as file:
        file.write(text)


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
    content["joints"] = {joint: model_content(model) for joint, model in models.items()}
    text = pretty_json(content) + "\n"
    if len(text) > MODEL_BYTES:
        raise ArgumentError(
            f"{path}: the models take {len(text)} bytes, and at most {MODEL_BYTES} are read back; "
            "save them without their covariances"
        )
    hashes = [source.sha256 for model in models.values() for source in model.provenance.inputs]
    with written_atomically(path, kind=MODEL, hashes=hashes) as file:
        file.write(text)


def _record(record: FitRecord) -> dict[str, Any]:
    """The record; what only a calibration without a reference says, only of one."""
    table = asdict(record)
    if not record.calibrated_without_reference:
        del table["calibrated_without_reference"], table["blind"]
    for name in ("freedom", "signals", "table"):
        if not table[name]:
            del table[name]
    return table


def one_line(model: ErrorModel) -> str:
    """What the model is, in one line of a screen."""
    lines = len(model.orders)
    parts = [
        f"{lines} {'order' if lines == 1 else 'orders'}"
        + (f" of {_listed([shaft.name for shaft in model.shafts])}" if model.shafts else ""),
        f"period {model.period:g}",
        f"argument {model.argument}",
    ]
    if model.terms:
        parts.append(f"with {_listed([term.kind for term in model.terms])}")
    return f"<HarmonicModel: {', '.join(parts)}>"


def model_summary(model: ErrorModel) -> str:
    """The harmonics by shaft and order, in arcseconds, and what is known of the fit."""
    period, unit = model.period, unit_name(model.period)
    rms = math.sqrt(0.5 * float(model.amplitudes @ model.amplitudes))
    shown = error_unit("auto", sine_of_rms(arcsec(rms, period)))
    lines = [
        *wrapped(one_line(model)[1:-1], 2),
        f"constant {model.constant:.6g} {unit}, {arcsec(model.constant, period):.6g} arcsec",
        f"{'shaft':16s} {'order':>10s} {f'amplitude, {shown.name}':>18s} {'phase, deg':>11s}",
    ]
    rows = [
        f"{shaft.name:16.16s} {k:10d} {shown.number(arcsec(c, period)):>18} "
        f"{math.degrees(p) % 360.0:11.2f}"
        for shaft in model.shafts
        for k, c, p in zip(shaft.orders, shaft.amplitudes, shaft.phases, strict=True)
    ]
    lines += rows[:_LISTED]
    if len(rows) > _LISTED:
        lines.append(f"... and {len(rows) - _LISTED} more")
    if model.fit is not None:
        start, stop = model.fit.span
        lines.append(
            f"fitted to {model.fit.samples} readings of {model.fit.runs} runs "
            f"between {start:.6g} and {stop:.6g} {unit}"
        )
    return laid_out(lines)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(name[:_LETTERS] for name in names[:_NAMED]) + more
