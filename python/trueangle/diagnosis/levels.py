"""Gain of findings at levels of their factor that were held out as a whole.

The speeds, temperatures, loads and mounts at which runs were made.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..estimation.linear import pseudo_inverse
from ..estimation.regression import Regression
from ..joint.signals import Signals
from ..support.arrays import Array, distinct
from ..support.deadline import current_deadline
from ..support.plainresult import plain_fields
from .holdout import error_numbers, held_out_residuals, rebuilt_term, reducible_share

Rows = NDArray[np.bool_]

#: Factors that have levels, and the unit of each.
UNITS = {"velocity": "deg/s", "temperature": "C", "torque": "Nm", "mount": "deg"}

#: Share of the whole range that parts one level from the next, and the least range that
#: makes levels: of the largest value, or absolute (kelvin, degrees of the mount).
GAP = 0.1
LEAST_SHARE = 0.2
LEAST_RANGE = {"temperature": 2.0, "mount": 0.5}

#: Share of a run's torque that must have one sign for it to be of that sign.
ONE_SIGN = 0.9

#: Levels at most; of more, neighbours are put together.
MOST_LEVELS = 5

NONE_TO_SPARE = "no level can be held out: the others alone do not separate this cause"

#: Share of its regressors' power by which a cause must differ from all else at the levels
#: that are left, to be fitted there at all.
LEAST_OWN = 0.05

#: Power that a cause must have at a level, over that of the errors which the law fitted at the
#: others has there; and over the variance of one reading, all readings together: the share that
#: is gained is then known to about a fifth.
LEAST_CARRIED, LEAST_SHOWN = 9.0, 100.0


@dataclass(frozen=True)
class LevelGain:
    """What a finding gains at a level of its factor that was held out as a whole.

    Attributes
    ----------
    factor, unit : str
    levels : list of float
        Every level of the factor in the data.
    held_out : list of float
        Those that were held out in turn; none where the others never show the cause alone.
    rms_before, rms_after : float or None
        Arcsec at the levels held out, together.
    reducible_share : float or None
    interval : (float, float) or None
        95 % of its bootstrap over runs.
    note : str
        How far the cause's law was carried.
    """

    factor: str
    unit: str
    levels: list[float]
    held_out: list[float] = field(default_factory=list)
    rms_before: float | None = None
    rms_after: float | None = None
    reducible_share: float | None = None
    interval: tuple[float, float] | None = None
    note: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The ``by_level`` object of a gain."""
        rms = "rms_before_arcsec=rms_before rms_after_arcsec=rms_after"
        share = "reducible_share reducible_share_interval=interval"
        return plain_fields(self, f"factor unit levels held_out {rms} {share} note")


def levels_of_runs(signals: Signals, factor: str) -> tuple[NDArray[np.int64], list[float]] | None:
    """Level of every reading (that of its run) and the mean value of every level, ascending.

    None where the factor has no levels, was not recorded or did not change from run to run.
    Levels are parted by gaps; runs at values without a gap by equal parts of their range.

    Examples
    --------
    >>> from trueangle.simulation import RunDesign, Simulation, join_runs, simulate
    >>> runs = tuple(RunDesign(samples=50, speed_deg_s=v) for v in (5.0, 30.0, 5.0))
    >>> level, values = levels_of_runs(join_runs(simulate(Simulation(runs=runs))), "velocity")
    >>> level[::50].tolist(), [round(v) for v in values]
    ([0, 1, 0], [5, 30])
    """
    column = getattr(signals, factor) if factor in UNITS else None
    if column is None:
        return None
    bounds = signals.run_bounds()
    parts = [column[start:stop] for start, stop in bounds]
    of_run = _torques(parts) if factor == "torque" else np.array([_value(factor, x) for x in parts])
    span = float(np.ptp(of_run))
    if span <= LEAST_RANGE.get(factor, LEAST_SHARE * float(np.abs(of_run).max())):
        return None
    order = np.argsort(of_run, kind="stable")
    group = np.zeros(of_run.size, dtype=np.int64)
    group[order[1:]] = np.cumsum(np.diff(of_run[order]) > GAP * span)
    count = int(group.max()) + 1
    if count > MOST_LEVELS:
        group = group * MOST_LEVELS // count
    elif count == 1:  # in many small steps: as many equal parts of the range
        group = ((of_run - of_run.min()) / span * MOST_LEVELS).astype(np.int64)
        _, group = np.unique(np.minimum(group, MOST_LEVELS - 1), return_inverse=True)
    values = np.bincount(group, of_run) / np.bincount(group)
    sizes = [stop - start for start, stop in bounds]
    return np.repeat(group, sizes), [float(value) for value in values]


def _value(factor: str, column: Array) -> float:
    """What one run counts as."""
    if factor == "velocity":
        moving = np.abs(column[column != 0.0])
        return float(np.median(moving)) if moving.size else 0.0
    mean = float(np.mean(column))
    return float(np.degrees(mean)) if factor == "mount" else mean


def _torques(columns: Sequence[Array]) -> Array:
    """What runs count as: their torque, or where one has either sign all by their sizes.

    Whichever way the torque counts, the same runs have one level.
    """
    mean = np.array([np.mean(torque) for torque in columns])
    size = np.array([np.mean(np.abs(torque)) for torque in columns])
    has_both = (np.abs(mean) <= ONE_SIGN * size) & (size > GAP * size.max())
    return size if has_both.any() else mean


def gains_by_level(
    regression: Regression,
    groups: Sequence[Sequence[int]],
    own_zero: bool,
    unit: NDArray[np.int64],
    rng: np.random.Generator,
) -> dict[int, LevelGain]:
    """Gain of the findings (by their place) at levels of their factor that were held out.

    Nothing is reported on a factor whose levels were not all tested when the time was up.
    """
    found: dict[int, LevelGain] = {}
    at = current_deadline()
    for factor in UNITS:
        causes = [regression.terms[group[0]].cause for group in groups]
        concerned = [
            k
            for k, cause in enumerate(causes)
            if EFFECTS[cause].factor == factor and EFFECTS[cause].transfers
        ]
        split = levels_of_runs(regression.signals, factor) if concerned else None
        if split is None:
            continue
        level, values = split
        # With the finding and without it at every level held out; NaN where it cannot be.
        left = np.full((len(concerned), 2, regression.n), np.nan)
        for j in range(len(values)):
            at.at(f"holding out levels of {factor}", j, len(values))
            if at.over:
                return found
            test = level == j
            able = [k for k in concerned if _is_tested_by(regression, groups[k], test)]
            if not able:
                continue
            # Two mounts do not determine the sense of mounts: the sense from all of them is kept.
            after, *before = held_out_residuals(
                regression, [groups[k] for k in able], test, own_zero, search=factor != "mount"
            )
            for k, values_before in zip(able, before, strict=True):
                left[concerned.index(k)][:, test] = values_before, after
        for k, (before_k, after_k) in zip(concerned, left, strict=True):
            used = ~regression.outlying & ~np.isnan(before_k)
            held = [values[j] for j in distinct(level[used])]
            if not held:
                found[k] = LevelGain(factor, UNITS[factor], values, note=NONE_TO_SPARE)
                continue
            _, of_unit = np.unique(unit[used], return_inverse=True)
            share, interval = reducible_share(
                before_k[used], after_k[used], of_unit, regression.variance, rng
            )
            found[k] = LevelGain(
                factor,
                UNITS[factor],
                values,
                held,
                error_numbers(before_k[used])[0],
                error_numbers(after_k[used])[0],
                share,
                interval,
                _reach(values, held),
            )
    return found


def _reach(levels: list[float], held_out: list[float]) -> str:
    """How far the law of a cause was carried."""
    if len(levels) == 2:
        reach = "fitted at one level, tested at the other"
    elif {levels[0], levels[-1]} & {*held_out}:
        reach = "tested at levels between and beyond those fitted"
    else:
        reach = "tested at levels between those fitted"
    if len(held_out) < len(levels):
        reach += "; the other levels are needed for the fit"
    return reach


def _is_tested_by(regression: Regression, group: Sequence[int], test: Rows) -> bool:
    """Whether holding out some readings tests the law of a finding.

    The others must distinguish it from all else, well enough to predict it in those held out, and
    it must be significant there.
    """
    train = regression.of_rows(~test)
    terms = [rebuilt_term(term, ~test) for term in regression.terms]
    rest = train.with_terms(t for k, t in enumerate(terms) if k not in group)
    columns = np.hstack([terms[k].columns for k in group])
    own = rest.whiten(columns)
    power = np.einsum("ij,ij->j", own, own)
    own = own - rest.q @ (rest.q.T @ own)
    left = np.einsum("ij,ij->j", own, own)
    if not (left > LEAST_OWN * np.maximum(power, 1e-300)).all():
        return False
    fitted = regression.fitted()
    there = np.hstack([fitted[k][0].columns[test] for k in group])
    size = float(np.sum((there @ np.concatenate([fitted[k][1] for k in group])) ** 2))
    carried = np.einsum("ij,jk,ik->", there, pseudo_inverse(own.T @ own), there)
    return bool(size > max(LEAST_CARRIED * carried, LEAST_SHOWN) * regression.variance)
