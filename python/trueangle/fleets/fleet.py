"""Looking at a fleet: every unit against the others, and against itself months ago."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from ..errors import ArgumentError
from ..joint.joint import Joint
from ..joint.shafts import resolve_orders
from ..runs.files import each_runs
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import told_kinds
from ..support.suggestions import check_choice
from .judgement import judged_fleet
from .result import Fleet
from .sums import FleetSums
from .units import Units


@told_kinds
def fleet(
    runs: Any,
    by: str = "unit",
    *,
    orders: Iterable[float] | Mapping[str, Iterable[float]] | None = None,
    share: float = 0.95,
    confidence: float = 0.95,
    permitted_arcsec: float | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    **reading: Any,
) -> Fleet:
    """Units of one design: who stands out, what all share, what moved since the last time.

    ::

        b_u = μ + d_u,    d_u ~ N(0, T),    b̂_u ~ N(b_u, S_u)

    with ``b̂_u`` each unit's own least squares, T diagonal by order and isotropic in
    cosine and sine, both by restricted maximum likelihood on the units that are no outliers.
    Whether the units share a mean (shafts that are keyed) or none (magnets pressed on at any
    angle) is what predicts held-out units better.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        As `trueangle.read_runs`, with the columns ``unit`` and ``when`` (ISO 8601) where there
        are several dates. Files are summed one after the other and not kept.
    by : {"unit", "run"}
        What tells the units apart. Where no column ``unit`` does, the files or the labels of
        the runs, whichever are more.
    orders : iterable of int, or mapping, optional
        Default: those that the first 32 units together support by evidence, and 1 and 2.
    share, confidence : float
        Of the tolerance limits.
    permitted_arcsec : float, optional
        Error from which a calibration is due: gives the day of the next.
    gear_ratio, fixed_member, shafts
        As in `trueangle.fit`.
    **reading
        ``signals``, ``period``, ``unit_from`` ... of files and tables, as in
        `trueangle.read_runs`.

    Returns
    -------
    Fleet

    Raises
    ------
    ArgumentError
        Runs in different units, no unit whose readings tell the orders apart, shares that are none.
    FileError
        As `trueangle.read_runs`.

    Notes
    -----
    Sums of ``(2 K)^2`` numbers are kept of each unit and day, K being the orders. Units that
    outlie: 1 % of fleets in which none does. What readings of a run have in common is known where
    units have several runs; else it is counted as a difference between units.

    Examples
    --------
    >>> rng = np.random.default_rng(5)
    >>> x = np.arange(0.0, 360.0, 4.0)
    >>> def unit(name, eccentric):
    ...     a, b = eccentric + rng.normal(0.0, 0.01, 2)
    ...     error = a * np.cos(np.radians(x)) + b * np.sin(np.radians(x))
    ...     noise = rng.normal(0.0, 0.001, x.size)
    ...     return ta.CalibrationRun(x, x + error + noise, 360.0, unit=name)
    >>> import trueangle as ta
    >>> found = ta.fleet([unit(f"SN{i}", 0.2 * (i == 7)) for i in range(12)], orders=[1, 2])
    >>> found.units[0].unit, found.units[0].verdict
    ('SN7', 'outlier')
    """
    check_choice("by", by, ("unit", "run"))
    for name, value in (("share", share), ("confidence", confidence)):
        if not 0.0 < value < 1.0:
            raise ArgumentError(f"{name} must lie between 0 and 1, got {value!r}")
    if permitted_arcsec is not None and not 0.0 < permitted_arcsec < math.inf:
        raise ArgumentError(f"permitted_arcsec must be positive, got {permitted_arcsec!r}")
    wanted = None if orders is None else resolve_orders(orders, gear_ratio, fixed_member, shafts)
    if wanted is not None and not wanted:
        raise ArgumentError("orders is empty: name one at least")
    sums = FleetSums(by, wanted, (gear_ratio, fixed_member, shafts))
    each_runs(runs, reading, sums.add)
    dated, untold = sums.calibrations()
    if not dated:
        raise ArgumentError(
            f"orders: the readings of no unit tell all {sums.orders.size} of them apart; "
            "name fewer, or read more places"
        )
    notes = []
    if by == "unit" and not sums.named:
        kind = "file (its name without folders)" if sums.by_file else "run"
        notes.append(
            f"No column names the units: every {kind} is taken for a unit. A role 'unit', or a "
            "pattern of the names (`unit_from=`), says which are one."
        )
    if untold:
        notes.append(f"The readings of {_listed(untold)} do not tell the orders apart; left out.")
    found = Units(dated, sums.shafts or [], sums.period or 1.0)
    joint = Joint(gear_ratio or 1.0, fixed_member if gear_ratio else "none")
    turn = found.period / ARCSEC_PER_TURN
    permitted = None if permitted_arcsec is None else permitted_arcsec * turn
    return judged_fleet(found, joint, share, confidence, permitted, notes)


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return f"{', '.join(names[:5])}{more}"
