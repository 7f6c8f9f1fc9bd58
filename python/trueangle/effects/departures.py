"""Departures of an effect from its textbook law, which no real one follows exactly."""

from __future__ import annotations

import numpy as np

from ..estimation.linear import linear_residual
from ..joint.signals import Signals
from ..support.arrays import Array

#: Lengths (degrees) of the transitions by which an error of reversal may be softened.
LENGTHS = (0.1, 0.5, 2.0, 8.0, 30.0)

#: Share of a run over which an error may lag behind what it follows.
LAG = 0.03

#: Remaining weight of an earlier reading that is only rounding.
FORGOTTEN = 1e-18


def departure_columns(signals: Signals, factor: str, signal: Array) -> Array:
    """Columns of the departures of an error ``signal`` from its law in a factor x.

    ::

        s x,    s |x|,    s x²,    <s>_late - s,    |s| sign(ṡ)

    curvature, saturation, lag and a loop; for an error of reversal transitions of other
    lengths. None where the factor was not recorded or has no such form.

    Parameters
    ----------
    signals : Signals
    factor : {"direction", "velocity", "temperature", "torque"}
    signal : ndarray, shape (n,)

    Returns
    -------
    ndarray, shape (n, k)
    """
    if factor == "direction":
        soft = (signal * signals.direction)[:, None] * spring_transitions(signals)
        return np.asarray(soft - signal[:, None])
    x = getattr(signals, factor) if factor in ("velocity", "temperature", "torque") else None
    if x is None or not np.ptp(x) > 0.0:
        return np.zeros((len(signals), 0))
    x = x - x.mean() if factor == "temperature" else x
    x = x / float(np.abs(x).max())
    late = _late(signals, signal)
    loop = np.abs(signal) * np.sign(signal - late)
    curved = signal[:, None] * np.column_stack([x, np.abs(x), x**2, np.abs(x) ** 3])
    # A part along the error itself is more of that error, not a departure from its form.
    return np.column_stack([linear_residual(signal[:, None], curved), late - signal, loop])


def spring_transitions(signals: Signals) -> Array:
    """States of springs of several lengths, relaxed and run in at the start of a run."""
    return np.column_stack([signals.presliding(x, start) for start in (0.0, 1.0) for x in LENGTHS])


def _late(signals: Signals, values: Array) -> Array:
    """``values`` behind a lag of a share of each run."""
    late = np.empty_like(values)
    for start, stop in signals.run_bounds():
        keep = float(np.exp(-1.0 / max(LAG * (stop - start), 1e-3)))
        state = (1.0 - keep) * values[start:stop]
        state[0] = values[start]
        # What each reading still holds of those before: of 1, of 3, of 7 ... of them.
        back = 1
        while back < stop - start and keep > FORGOTTEN:
            state[back:] += keep * state[:-back]
            back, keep = 2 * back, keep * keep
        late[start:stop] = state
    return late
