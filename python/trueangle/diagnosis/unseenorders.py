"""Low orders of the output that were not found: over an arc they are nearly those that were."""

from __future__ import annotations

import numpy as np

from ..effects.local_defect import WHOLE_TURN
from ..effects.missing_order import MissingOrder
from ..effects.scale_error import ScaleError
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import lines_columns
from ..support.arrays import Array

#: Cycles over the travel up to which an order takes part of its neighbours'.
FEW_CYCLES = 5.0


def unseen_order_columns(regression: Regression) -> Array:
    """Columns of the orders up to the highest found and one more, as large as what was found.

    With a ramp, where none was found. Over a whole turn there are none: what was not found is not
    there.
    """
    theta, turns = regression.signals.theta, _turns(regression)
    orders = _low_orders(regression)
    if not orders:
        return np.zeros((regression.n, 0))
    found = [(term, c) for term, c in regression.fitted() if _is_low(term, turns)]
    known = orders | {float(k) for k in regression.around.pattern.orders}
    more = [float(k) for k in range(1, int(max(orders)) + 2) if float(k) not in known]
    columns = lines_columns(theta, np.array(more))
    if all(term.cause != ScaleError.kind for term, _ in found):
        columns = np.column_stack([columns, (theta - theta.mean()) / theta.std()])
    return np.asarray(columns * np.std(sum(term.columns @ c for term, c in found)))


def arc_note(regression: Regression) -> str:
    """What the names of orders over an arc rest on; nothing over a whole turn."""
    if not _low_orders(regression):
        return ""
    turns = _turns(regression)
    return (
        f"{turns:.2g} turns are too few to separate a ramp from low orders: the "
        "fewest that explain the readings are named, and their errors allow for the others"
    )


def _turns(regression: Regression) -> float:
    """Travel of all runs together."""
    return float(np.ptp(regression.signals.theta)) / (2.0 * np.pi)


def _low_orders(regression: Regression) -> set[float]:
    """Orders found over an arc that are nearly others; none over a whole turn."""
    turns = _turns(regression)
    if turns >= WHOLE_TURN:
        return set()
    lines = (term for term in regression.terms if term.cause == MissingOrder.kind)
    return {float(term.shape["output_order"]) for term in lines if _is_low(term, turns)}


def _is_low(term: Extension, turns: float) -> bool:
    """Whether a cause is a ramp, or a whole order of few cycles over the travel."""
    if term.cause != MissingOrder.kind:
        return term.cause == ScaleError.kind
    return _is_of_few(float(term.shape["output_order"]), turns)


def _is_of_few(order: float, turns: float) -> bool:
    return order == round(order) and order * turns <= FEW_CYCLES
