"""Would a run that took no part gain by a correction? Orders of some runs only do harm."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError
from ..runs import CalibrationRun
from ..shafts import ShaftOrders

__all__ = ["check_new_run", "gains_of_runs"]

Array = NDArray[np.float64]

#: Readings looked at, and columns times readings: drawn at random, so that no grid is met.
_LOOKED_AT: Final = 24_000
_CELLS: Final = 8_000_000
#: Readings for each column of what is left of a run's own, at least.
_PER_COLUMN: Final = 2.0
#: Penalty relative to the mean of the diagonal: orders of partial travel nearly cancel.
_RIDGE: Final = 1e-6
#: Standard deviations between runs by which the mean gain must exceed nothing: of forty further
#: runs one may lose then. Runs of one joint have ten and more, those of unlike joints below 1.6.
_SURE: Final = 2.0


def check_new_run(
    runs: Sequence[CalibrationRun], wanted: Sequence[ShaftOrders], argument: str
) -> None:
    r"""Raise where orders selected by evidence would not help a further run.

    With :math:`g_r` the decrease of the mean square of run r by what the others say, it asks for

    .. math:: \bar g > 2\sqrt{\max(0,\;
              \operatorname{var} g - \overline{4\sigma_r^2 c^T G_r c/n_r^2})}

    the scatter between runs beyond that of the noise.

    Raises
    ------
    NoModelError
        The runs contradict each other: says in how many the error would be larger.
    """
    orders = [k * shaft.cycles_per_turn for shaft in wanted for k in shaft.orders]
    found = gains_of_runs(runs, orders, argument)
    if found is None:
        return
    gains, noise = found
    beyond = max(0.0, float(gains.var(ddof=1)) - noise)
    if float(gains.mean()) > _SURE * np.sqrt(beyond):
        return
    worse = int(np.count_nonzero(gains < 0.0))
    listed = ", ".join(f"{order:g}" for order in orders[:6]) + (" ..." if orders[6:] else "")
    raise NoModelError(
        f"no correction can be given: what the other runs say of order {listed} would make the "
        f"error of {worse} of {len(runs)} runs larger, and that of the rest unevenly smaller; they "
        "seem to be of unlike joints: fit each alone (--run), or declare the orders (--orders)"
    )


def gains_of_runs(
    runs: Sequence[CalibrationRun], orders: Sequence[float], argument: str
) -> tuple[Array, float] | None:
    """Decrease of every run's mean square by a fit to the others, and its variance by noise.

    None where a run alone, or too few readings, cannot say.
    """
    columns = 2 * len(orders)
    total = sum(map(len, runs))
    share = min(1.0, _LOOKED_AT / total, _CELLS / (columns * total))
    if len(runs) < 2 or share * total < _PER_COLUMN * columns * len(runs):
        return None
    rng = np.random.default_rng(0)
    grams, moments, energies, sizes = [], [], [], []
    for run in runs:
        keep = slice(None) if share == 1.0 else np.flatnonzero(rng.random(len(run)) < share)
        x = (2.0 * np.pi / run.period * getattr(run, argument))[keep, None] * np.asarray(orders)
        if len(x) < 2:
            return None
        weight = np.ones(len(x)) if run.weights is None else run.weights[keep]
        if not weight.any():
            return None
        root = np.sqrt(weight / weight.mean())[:, None]
        design = root * _about(np.hstack([np.cos(x), np.sin(x)]), weight)
        error = root[:, 0] * _about(run.centred_error[keep, None], weight)[:, 0]
        grams.append(design.T @ design)
        moments.append(design.T @ error)
        energies.append(float(error @ error))
        sizes.append(len(x))
    gains, noise = np.empty(len(runs)), 0.0
    gram, moment = sum(grams), sum(moments)
    for i, (own, mine) in enumerate(zip(grams, moments, strict=True)):
        others = _solved(gram - own, moment - mine)
        power = float(others @ own @ others)
        gains[i] = (2.0 * float(others @ mine) - power) / sizes[i]
        left = max(0.0, energies[i] - float(_solved(own, mine) @ mine)) / sizes[i]
        noise += 4.0 * left * power / sizes[i] ** 2 / len(runs)
    return gains, noise


def _about(columns: Array, weight: Array) -> Array:
    return np.asarray(columns - (weight @ columns) / weight.sum())


def _solved(gram: Array, moment: Array) -> Array:
    ridge = _RIDGE * max(float(np.trace(gram)) / len(gram), 1e-300)
    return np.asarray(np.linalg.solve(gram + ridge * np.eye(len(gram)), moment))
