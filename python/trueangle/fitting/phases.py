"""Amplitudes and phases of a model's orders, run by run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from ..errors import RankError, TrueAngleError
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .fit import fit as fit_runs
from .result import FitResult
from .robust import Loss


@dataclass(frozen=True)
class Phases:
    """One order in every run: amplitude in arcsec, phase in radians."""

    order: float
    labels: tuple[str, ...]
    amplitude: Array
    phase: Array


def run_phases(fit: FitResult) -> list[Phases]:
    """Amplitude and phase of the model's orders in every run fitted alone.

    Runs whose readings alone do not determine the orders are omitted.

    Raises
    ------
    RankError
        That holds for all of them.
    """
    orders = {shaft.name: shaft.orders for shaft in fit.model.shafts}
    shafts = {shaft.name: shaft.cycles_per_turn for shaft in fit.model.shafts}
    labels, coefficients = [], []
    for number, run in enumerate(fit.runs):
        try:
            alone = fit_runs(
                run, orders, shafts=shafts, argument=fit.model.argument, loss=cast(Loss, fit.loss)
            )
        except TrueAngleError:
            continue
        labels.append(run.label or str(number + 1))
        coefficients.append((alone.amplitudes, alone.phases))
    if not labels:
        raise RankError("no run alone determines these orders and their phases: fit longer runs")
    factor = ARCSEC_PER_TURN / fit.model.period
    amplitude = factor * np.array([a for a, _ in coefficients])
    phase = np.array([p for _, p in coefficients])
    return [
        Phases(order, tuple(labels), amplitude[:, i], phase[:, i])
        for i, order in enumerate(fit.orders)
    ]
