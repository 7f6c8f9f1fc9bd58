"""A model that was there before: how it was made, and what it leaves of these runs."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model.model import HarmonicModel
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, circular_mean, wrap

__all__ = ["given_model"]


def given_model(
    model: HarmonicModel | str | PathLike[str], runs: Sequence[CalibrationRun]
) -> dict[str, Any]:
    """Whether it was calibrated without a reference, what it is blind to, error on the runs.

    Every run keeps a zero of its own. Models that need signals are described only.
    """
    if not isinstance(model, HarmonicModel):
        from ..model.file import load_model

        model = load_model(model)
    record = model.fit
    content: dict[str, Any] = {
        "method": None if record is None else record.method,
        "calibrated_without_reference": bool(record and record.calibrated_without_reference),
        "blind": [] if record is None else list(record.blind),
        "note": "" if record is None else record.note,
        "before_arcsec": None,
        "after_arcsec": None,
    }
    if model.signals or model.terms:
        return content
    before: list[NDArray[np.float64]] = []
    after: list[NDArray[np.float64]] = []
    for run in runs:
        turn = model.period / run.period
        for angle, found in (
            (run.indicated * turn, before),
            (np.asarray(model.correct(run.indicated * turn)), after),
        ):
            gap = angle - run.reference * turn
            found.append(wrap(gap - circular_mean(gap, model.period), model.period))
    factor = ARCSEC_PER_TURN / model.period
    for name, parts in (("before_arcsec", before), ("after_arcsec", after)):
        content[name] = float(np.sqrt(np.mean(np.concatenate(parts) ** 2))) * factor
    return content
