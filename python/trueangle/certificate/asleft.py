"""Readings as a model leaves them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..runs.run import CalibrationRun

__all__ = ["corrected_runs", "is_of_these", "model_as_left"]


def model_as_left(model: HarmonicModel | str | PathLike[str]) -> HarmonicModel:
    """The model itself, or that of a file."""
    if isinstance(model, HarmonicModel):
        return model
    from ..model.file import load_model

    return load_model(model)


def corrected_runs(model: HarmonicModel, runs: Sequence[CalibrationRun]) -> list[CalibrationRun]:
    """Runs whose indicated angle is the model's correction of it, signals included.

    Raises
    ------
    ArgumentError
        The model needs a signal that a run does not have.
    """
    return [_corrected(model, run) for run in runs]


def _corrected(model: HarmonicModel, run: CalibrationRun) -> CalibrationRun:
    turn = model.period / run.period
    signals: dict[str, Any] = {}
    for name in model.uses_signals:
        values = {"direction": run.direction, "velocity": run.speed}.get(name)
        values = run.signal(name) if values is None else values
        if values is None and name in model.signals:
            raise ArgumentError(
                f"the model needs {name}, which the readings lack: record it, or take a model of "
                "the angle alone"
            )
        if values is not None:
            signals[name] = values * turn if name == "velocity" else values
    angle = np.asarray(model.correct(run.indicated * turn, **signals)) / turn
    return replace(run, indicated=angle)


def is_of_these(model: HarmonicModel, runs: Sequence[CalibrationRun]) -> bool:
    """Whether files of these readings are among those that the model was fitted to."""
    fitted = {source.sha256 for source in model.provenance.inputs} if model.provenance else set()
    return any(run.source is not None and run.source.sha256 in fitted for run in runs)
