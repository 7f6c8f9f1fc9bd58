"""Which factors the error follows: a search over groups of columns by their evidence."""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..._core import Groups, GroupSums
from ...joint.signals import Signals
from ...support.arrays import Array
from .extension import curves_of
from .factor import Factor, FactorCurve
from .group import FACTORS, FEW, TOGETHER, Group, lines_of

#: Readings used at most; of more, every n-th.
MOST_READINGS: Final = 2500

#: Part of the variance that each factor may have where the noise is first looked for.
AT_FIRST: Final = 0.3

#: Highest order of groups that are fitted where the noise is first estimated.
LOWEST: Final = 4.0

#: Rounds of noise and search at most.
ROUNDS: Final = 3

#: Log Bayes factor below which two accounts are not distinguished (Kass and Raftery: 20 to 1).
ALIKE: Final = 3.0

#: Share of what a group's leaving takes that another must give back to be tried in its place.
TRIED: Final = 0.5

#: Share of a function that is left by columns which are nearly the same.
SAME_COLUMNS: Final = 0.05

#: Columns of groups that are compared so, at most.
MOST_ALIKE: Final = 8

#: Standard deviations of a 95 % interval.
BAND: Final = 1.96

#: What groups that are forms of a name have in the place of a factor.
NAME: Final = "name"

#: Smallest variance of readings that is distinguished from zero.
NOTHING: Final = 1e-24

#: Smallest variances of the noise and of a factor, over that of the readings, that sums of squares
#: hold.
ROUNDING: Final = 1e-9
HELD: Final = 1e-7


def _prior(groups: Sequence[Group]) -> list[float]:
    """Of each group: one of them is expected, and the strongest of many counts as one.

    What holds the functions of two factors is as probable as both.
    """
    each = 1.0 / max(len(groups), 2)
    return [0.0 if g.factor == NAME else each**g.factors / g.alternatives for g in groups]


@dataclass(frozen=True, eq=False)
class FactorAccount:
    """Groups of columns at readings, and which of them are in.

    Attributes
    ----------
    groups : sequence of Group
    sums : GroupSums
        Under the noise that was found.
    tau : list of float
        Prior variance of each group; 0 of those that are out.
    total : float
        Variance of the error.
    """

    groups: Sequence[Group]
    sums: GroupSums
    tau: list[float]
    total: float

    @cached_property
    def prior(self) -> list[float]:
        """Prior probability of each group."""
        return _prior(self.groups)

    @cached_property
    def inside(self) -> list[int]:
        """Groups that are in."""
        return [k for k, tau in enumerate(self.tau) if tau > 0.0]

    def evidence(self, tau: Sequence[float]) -> float:
        """Log evidence of a model."""
        return self.sums.posterior(list(tau))[0]

    def any_size(self, given: Sequence[float], tau: Sequence[float]) -> list[float]:
        """A model with groups that are given of any size: columns that others have are theirs."""
        return [1e4 * one or other for one, other in zip(given, tau, strict=True)]

    def variance(self, tau: Sequence[float], groups: Sequence[int]) -> float:
        """Variance over the readings of what some groups of a model take."""
        _, mean, _ = self.sums.posterior(list(tau))
        own = self.columns_of(groups)
        return float(np.var(self.columns[:, own] @ mean[own]))

    @cached_property
    def columns(self) -> Array:
        """Those of all groups."""
        return np.hstack([group.columns for group in self.groups])

    def columns_of(self, groups: Sequence[int]) -> NDArray[np.intp]:
        """Places of the columns of some groups."""
        of = np.repeat(np.arange(len(self.groups)), [g.columns.shape[1] for g in self.groups])
        return np.flatnonzero(np.isin(of, groups))

    def without(self, groups: Iterable[int]) -> list[float]:
        """The model less some groups."""
        left = list(self.tau)
        for k in groups:
            left[k] = 0.0
        return left

    def best_beside(
        self, given: Sequence[float], allowed: Iterable[int], start: Sequence[float] | None = None
    ) -> tuple[float, list[float]]:
        """Score and model of the best of some groups, added to those given."""
        probabilities = [0.0] * len(self.groups)
        for k in allowed:
            if given[k] == 0.0:
                probabilities[k] = self.prior[k]
        begin = [0.0] * len(self.groups) if start is None else list(start)
        return _searched(self.sums, self.groups, given, probabilities, begin)


def _searched(
    sums: GroupSums,
    groups: Sequence[Group],
    given: Sequence[float],
    probabilities: Sequence[float],
    start: Sequence[float],
) -> tuple[float, list[float]]:
    """Score and model of a search, from narrow groups alone where these are better.

    One move exchanges one group: several narrow ones do not come for a wide one at once.
    """
    found = sums.search(list(given), list(probabilities), list(start))
    is_wide = [group.columns.shape[1] > FEW for group in groups]
    if not any(wide and tau > 0.0 for wide, tau in zip(is_wide, found[1], strict=True)):
        return found
    narrow = [0.0 if wide else p for p, wide in zip(probabilities, is_wide, strict=True)]
    few = sums.search(list(given), narrow, list(start))
    return sums.search(list(given), list(probabilities), few[1]) if few > found else found


def factor_account(signals: Signals, error: Array, groups: Sequence[Group]) -> FactorAccount | None:
    """The groups that readings follow, under the noise of most evidence.

    ::

        y = z + sum_g X_g b_g + n,   b_g ~ 0 or N(0, tau_g I)

    with one zero z for all runs, and noise of white and five exponential parts in every run.

    Parameters
    ----------
    signals : Signals
    error : ndarray, shape (n,)
    groups : sequence of Group
    """
    total = float(np.var(error))
    if not total > NOTHING:
        return None
    widths = [group.columns.shape[1] for group in groups]
    columns = np.hstack([group.columns for group in groups])
    y = error - error.mean()
    cuts = [0, *(np.flatnonzero(np.diff(signals.run)) + 1).tolist(), len(y)]
    clock = signals.clock if signals.time is not None else None
    parts = []
    for start, stop in itertools.pairwise(cuts):
        time = None if clock is None else np.maximum.accumulate(clock[start:stop])
        if time is not None and not time[-1] > time[0]:
            time = None
        parts.append((columns[start:stop], y[start:stop], time))
    core = Groups(parts, widths)
    scale = _scale(y, cuts)
    noise = core.noise([AT_FIRST * total if _is_first(g) else 0.0 for g in groups], scale)
    sums = core.sums(_above_rounding(noise, total), total)
    tau = [0.0] * len(groups)
    for _ in range(ROUNDS):
        _, found = _searched(sums, groups, [0.0] * len(groups), _prior(groups), tau)
        is_same = [t > 0.0 for t in found] == [t > 0.0 for t in tau]
        tau = found
        if is_same:
            break
        noise = core.noise(tau, scale, noise)
        sums = core.sums(_above_rounding(noise, total), total)
    return FactorAccount(groups, sums, tau, total)


def _above_rounding(noise: Array, total: float) -> Array:
    """White noise of readings without any: what rounding of products leaves."""
    return np.array([max(noise[0], ROUNDING * total), *noise[1:]])


def _is_first(group: Group) -> bool:
    """Groups that the noise is first estimated with, so that no strong error enters it."""
    low = len(group.orders) == 0 or max(group.orders) <= LOWEST
    return group.factor == NAME or (group.columns.shape[1] <= FEW and low and not group.is_product)


def _scale(y: Array, cuts: Sequence[int]) -> float:
    """Variance of the noise by neighbours, or a small part of that of the readings."""
    steps = [np.diff(y[a:b]) ** 2 for a, b in itertools.pairwise(cuts)]
    every = np.concatenate(steps)
    between = 0.5 * float(np.median(every)) / 0.455 if every.size else 0.0
    return max(between, ROUNDING * float(np.var(y)))


def factors_of(
    account: FactorAccount,
    shafts: dict[str, float],
    named: Container[float],
    beside: Sequence[float] | None = None,
) -> list[Factor]:
    """The factors that are in, strongest first.

    Of a model with names, of variances ``beside``, the functions are those next to names of any
    size. Lines of the place that are not ``named`` are parts of products with them.
    """
    tau = account.tau if beside is None else account.any_size(beside, account.tau)
    _, mean, covariance = account.sums.posterior(tau)
    lines = [k for k, group in enumerate(account.groups) if group.factor == "place"]
    account = _with_constants(account, mean, named)
    base = account.evidence(account.tau)
    kinds: dict[tuple[str, str | None], list[int]] = {}
    for k in account.inside:
        group = account.groups[k]
        if group.factor == NAME:
            continue
        shaft = _shaft(group.orders, shafts) if group.orders or group.jump is not None else None
        kinds.setdefault((group.factor, shaft), []).append(k)
    found = []
    for (factor, shaft), members in kinds.items():
        groups = [account.groups[k] for k in members]
        means = [mean[account.columns_of([k])] for k in members]
        at = account.columns_of(members)
        columns = account.columns[:, at]
        fitted = columns @ mean[at]
        rms, std = _size(columns, mean[at], covariance[np.ix_(at, at)])
        if rms**2 < HELD * account.total:
            continue
        orders = [m for group in groups for m in group.orders]
        cycles = shafts[shaft] if shaft else 1.0
        found.append(
            Factor(
                factor,
                shaft,
                tuple(sorted({m / cycles for m in orders if m})) or None,
                rms,
                max(rms - BAND * std, 0.0),
                rms + BAND * std,
                rms**2 / max(account.total, rms**2),
                base - account.evidence(account.without(members)),
                (),
                _alike(account, members, lines, fitted),
                _curve(account, members, mean, covariance),
                curves_of(factor, shaft, groups, means, shafts),
                _jumps(groups, means),
                tuple(sorted(group.event for group in groups if group.event is not None)),
                fitted,
            )
        )
    return sorted(found, key=lambda f: (-f.rms, FACTORS.index(f.factor)))


def _with_constants(account: FactorAccount, mean: Array, named: Container[float]) -> FactorAccount:
    """Lines of the place that are what products with them are on average, as parts of these."""
    groups = list(account.groups)
    sizes = {
        k: float(np.var(groups[k].columns @ mean[account.columns_of([k])])) for k in account.inside
    }
    for k in account.inside:
        products = [j for j in account.inside if groups[j].is_of_line(account.groups[k].orders)]
        is_line = groups[k].factor == "place" and len(groups[k].orders) == 1
        if is_line and products and groups[k].orders[0] not in named:
            groups[k] = groups[k].as_constant_of(groups[max(products, key=sizes.__getitem__)])
    return replace(account, groups=groups)


def _jumps(groups: Sequence[Group], means: Sequence[Array]) -> tuple[tuple[float, float], ...]:
    """Where a function of the place jumps, and by how much upwards."""
    found = []
    for group, mean in zip(groups, means, strict=True):
        if group.jump is not None:
            below, above = group.functions_at(group.jump + np.array([-1e-6, 1e-6]))[:, 0]
            found.append((group.jump, float((above - below) * mean[0])))
    return tuple(sorted(found))


def _size(columns: Array, mean: Array, covariance: Array) -> tuple[float, float]:
    """Root mean square of a function, and its standard deviation.

    ::

        E f = m' Q m + tr(Q C),   var f = 4 m' Q C Q m + 2 tr(Q C Q C)
    """
    centred = columns - columns.mean(axis=0)
    power = centred.T @ centred / len(columns)
    both = power @ covariance
    square = float(mean @ power @ mean)
    spread = 4.0 * float(mean @ both @ power @ mean) + 2.0 * float(np.sum(both * both.T))
    rms = float(np.sqrt(max(square, 0.0)))
    return rms, float(np.sqrt(max(spread, 0.0))) / max(2.0 * rms, 1e-12)


def _shaft(orders: Sequence[float], shafts: dict[str, float]) -> str:
    """The shaft of whose turn orders are low whole numbers; the output else."""
    for name, cycles in shafts.items():
        if name == "output" or abs(cycles) < 2.0:
            continue
        ratios = [m / abs(cycles) for m in orders]
        if all(abs(r - round(r)) < 1e-6 and 1 <= round(r) <= 8 for r in ratios):
            return name
    return "output"


def _alike(
    account: FactorAccount, members: Sequence[int], lines: Sequence[int], fitted: Array
) -> tuple[str, ...]:
    """Factors that explain as much in the place of one, or are nearly the same columns.

    The evidence may distinguish the latter, but only by errors of the signals. Products come with
    the lines of the place that are their means. Two factors that act together are more than one.
    """
    groups = account.groups
    rest = account.without(members)
    own, _ = account.best_beside(rest, members)
    kinds: dict[str, list[int]] = {}
    no_other = (groups[members[0]].factor, NAME, *TOGETHER)
    for k, group in enumerate(groups):
        if account.tau[k] == 0.0 and group.factor not in no_other:
            kinds.setdefault(group.factor, []).append(k)
    losses, _, instead = account.sums.changes(account.tau)
    orders = {m for k in members for m in groups[k].orders}
    is_line = groups[members[0]].factor == "place"
    means = [k for k in lines if not (is_line or rest[k]) and orders & {*groups[k].orders}]
    width = sum(groups[k].columns.shape[1] for k in members)
    found = []
    for kind, others in kinds.items():
        also = means if kind.endswith("_place") else []
        same = [[j for j in also if groups[j].orders == groups[k].orders] for k in others]
        parts = [[k, *beside] for k, beside in zip(others, same, strict=True)]
        columns = [np.hstack([groups[k].columns for k in part]) for part in parts]
        if any(_holds(x, fitted, width) for x in columns):
            found.append(kind)
            continue
        beside = [*others, *also]
        if all(instead[k, j] < TRIED * max(losses[k], 1e-9) for k in members for j in beside):
            continue
        score, tau = account.best_beside(rest, beside)
        if score > own - ALIKE and any(tau[k] > 0.0 for k in others):
            found.append(kind)
    return tuple(sorted(found, key=FACTORS.index))


def _holds(columns: Array, function: Array, width: int) -> bool:
    """Columns hold a function mostly in a number of their principal parts."""
    if columns.shape[1] > max(MOST_ALIKE, width):
        return False
    parts = np.linalg.svd(columns - columns.mean(axis=0), full_matrices=False)[0][:, :width]
    own = function - np.mean(function)
    left = own - parts @ (parts.T @ own)
    return bool(left @ left < SAME_COLUMNS * (own @ own))


def _curve(
    account: FactorAccount, members: Sequence[int], mean: Array, covariance: Array
) -> FactorCurve:
    """The function of the strongest axis of a factor's groups."""
    widest = max(members, key=lambda k: account.groups[k].at.size)
    at, unit = account.groups[widest].at, account.groups[widest].unit
    own = [k for k in members if np.array_equal(account.groups[k].at, at)]
    value: Array = np.zeros(at.size)
    variance: Array = np.zeros(at.size)
    products = account.groups[own[0]].is_product
    index = account.columns_of(own)
    if not products:
        rows = np.hstack([account.groups[k].values_about_mean() for k in own])
        value = rows @ mean[index]
        variance = np.einsum("ij,jk,ik->i", rows, covariance[np.ix_(index, index)], rows)
    else:
        squares, slopes = np.zeros(at.size), np.zeros(at.size)
        for values, columns in lines_of([account.groups[k] for k in own]).values():
            for part in range(2):
                f = values @ mean[index[columns[part::2]]]
                spread = covariance[np.ix_(*2 * [index[columns[part::2]]])]
                squares += f**2
                slopes += f**2 * np.einsum("ij,jk,ik->i", values, spread, values)
        value = np.sqrt(squares)
        variance = slopes / np.maximum(squares, 1e-24)
    apart = BAND * np.sqrt(np.maximum(variance, 0.0))
    low = value - apart
    return FactorCurve(at, unit, value, np.maximum(low, 0.0) if products else low, value + apart)
