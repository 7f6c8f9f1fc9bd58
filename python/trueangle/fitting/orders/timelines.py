"""Orders of a single run that are lines in time: of a fixed frequency, at any place."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..._core import Groups, line_columns
from ...estimation.evidence import EvidenceEstimate


def lines_in_time(
    estimate: EvidenceEstimate, orders: Collection[float], tested: Collection[float], chance: float
) -> set[float]:
    """Those of the orders ``tested`` that lines in time hold better than places do.

    Where the speed varies, a line of a fixed frequency is no order, and several orders next to one
    another are needed for it. Both compete under the noise of the estimate: the ``orders`` that
    are in, with the probability that they had, and lines at every half cycle of the run near
    those tested, each with the probability ``chance``. Of several runs that is not asked: there
    the phase of such a line differs from run to run.
    """
    theta, error, time, _ = estimate.runs[0]
    if len(estimate.runs) > 1 or time is None or not tested:
        return set()
    # Time in turns of the mean speed: a line near order k has k cycles in one of them.
    travel = np.ptp(theta)
    clock = (time - time[0]) / np.ptp(time) * travel
    near = {k + 2.0 * np.pi / travel * s for k in tested for s in np.arange(-1.5, 2.0, 0.5)}
    given = (theta, [*orders]), (clock, sorted(near))
    columns = np.hstack([line_columns(at, np.array(lines, float)) for at, lines in given])
    columns -= columns.mean(axis=0)
    known = dict(zip(estimate.orders, estimate.prior.tolist(), strict=True))
    chances = [min(known[k], 0.99) for k in orders] + [chance] * len(near)
    total = float(np.var(error))
    readings = [(columns, error - error.mean(), time)]
    sums = Groups(readings, [2] * len(chances)).sums(estimate.noise, total)
    none = [0.0] * len(chances)
    found = max(
        sums.search(none, chances, [total] * len(orders) + [0.0] * len(near)),
        sums.search(none, chances, none),
    )
    return set(tested) - {k for k, size in zip(orders, found[1], strict=False) if size > 0.0}
