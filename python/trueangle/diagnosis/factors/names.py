"""Is a finding's form right? It is compared with the free functions of all factors."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...effects import EFFECTS
from ...effects.missing_order import MissingOrder
from ...effects.time_periodic import TimePeriodic
from ...estimation.extension import Extension
from ...estimation.factor import orthonormal_basis
from ...estimation.regression import Regression
from ...support.arrays import Array
from ..confirmation import NOT_CONFIRMED
from ..finding import Finding
from ..judgedbeliefs import changed_lines
from .account import ALIKE, NAME, FactorAccount
from .factor import WORDS
from .group import Group

#: Variances that a group may have: each name has one of them.
SIZES: Final = 7

#: Share of what its factors take that a name must take.
TAKES: Final = 0.95

#: Factors that hold each other's functions: speeds have a direction, loads a sign, and a place in
#: one direction is half of the place and half of the direction times the place.
FAMILIES: Final = (
    {"direction", "direction_place", "place"},
    {"direction", "reversal_time", "speed"},
    {"load", "load_sign"},
    {"run", "run_time", "temperature"},
)

#: Factor of settling after a reversal, which any form may have: names are not tested by it.
TRANSITION: Final = "reversal_time"

#: Part of columns that may remain outside the span of others that are the same.
_SAME: Final = 1e-6


def name_group(regression: Regression, finding: Finding, rows: NDArray[np.int64]) -> Group | None:
    """A finding's own columns at some readings as a group; None of what has none.

    A finding that describes the noise has none: the account has its own noise; nor has one that is
    a form of no factor.
    """
    effect, fitted = EFFECTS[finding.cause], regression.fitted()
    own = [fitted[k] for k in finding.group if not effect.describes_noise(regression.terms[k])]
    fixed = [pair for pair in own if pair[0].run_effect is None]
    parts = [effect.form_columns(regression.signals, fixed)] if fixed else []
    runs = regression.signals.run[:, None, None] == np.arange(regression.signals.runs)[:, None]
    for drawn in (term.run_effect for term, _ in own if term.run_effect is not None):
        parts.append((drawn.columns[:, None, :] * runs).reshape(regression.n, -1))
    if not (parts and effect.form_of):
        return None
    sought = 0.5 * len(rows) if finding.cause == TimePeriodic.kind else 1.0
    columns = np.hstack(parts)[rows]
    # Places and lengths that were fitted with the columns (Schwarz).
    searched = sum(term.parameters for term, _ in own) - columns.shape[1]
    lines = {order for term, _ in own for order in orders_of(term)}
    return _group(columns, sought * len(rows) ** (0.5 * max(searched, 0)), tuple(lines))


def orders_of(term: Extension) -> list[float]:
    """Orders of a term's lines."""
    order = term.line if term.line is not None else term.shape.get("order", [])
    return [float(m) for m in np.atleast_1d(np.asarray(order, dtype=np.float64))]


def believed_groups(regression: Regression, rows: NDArray[np.int64]) -> Iterator[Group]:
    """Changes of the simulation's lines, a group each: findings of their own."""
    base = regression.readings.base[rows]
    for order, where in changed_lines(regression).items():
        if (group := _group(base[:, where], 1.0, (order,))) is not None:
            yield group


def _group(columns: Array, sought: float = 1.0, lines: tuple[float, ...] = ()) -> Group | None:
    spread = np.std(columns, axis=0)
    columns = columns[:, spread > 0.0] / spread[spread > 0.0]
    if not columns.size:
        return None
    scale = float(np.sqrt(columns.shape[1]))
    return Group(NAME, columns / scale, lines, np.zeros(1), None, "", sought)


class NamedForms:
    """Findings as groups in addition to the free functions of an account.

    Parameters
    ----------
    account : FactorAccount
        With a group for each finding.
    places : dict of int to int
        Group of a finding by its place in the list of findings.
    """

    def __init__(self, account: FactorAccount, places: dict[int, int]) -> None:
        self.account, self.places = account, places
        self._found: dict[tuple[object, ...], tuple[float, list[float]]] = {}
        self.free = [k for k, g in enumerate(account.groups) if g.factor != NAME]
        none = [0.0] * len(account.groups)
        own = [0.5 * (k in places.values()) for k in range(len(none))]
        sizes = account.sums.search(none, own, none)[1] if places else none
        least = 1e-4 * account.total
        self.sizes = [max(size, least) if own[k] else 0.0 for k, size in enumerate(sizes)]

    def given(self, names: Sequence[int]) -> list[float]:
        """The model of these findings alone."""
        inside = {self.places[name] for name in names if name in self.places}
        return [size if k in inside else 0.0 for k, size in enumerate(self.sizes)]

    def beside(
        self,
        names: Sequence[int],
        start: Sequence[float] | None = None,
        without: Sequence[str] = (),
    ) -> tuple[float, list[float]]:
        """Score and groups of the best free functions added to findings, without some factors."""
        allowed = [k for k in self.free if not self.is_of(k, without)]
        if start is not None:
            start = [0.0 if self.is_of(k, without) else tau for k, tau in enumerate(start)]
        given = self.given(names)
        key = (*given, *(start or ()), *without)
        if key not in self._found:
            self._found[key] = self.account.best_beside(given, allowed, start)
        score, tau = self._found[key]
        return score - sum(self.price(name) for name in names if name in self.places), tau

    def price(self, name: int) -> float:
        """Penalty of a finding next to free functions: for its choice and its size."""
        own = self.account.groups[self.places[name]].alternatives
        return float(np.log(len(self.account.groups) * SIZES * own))

    def beyond(self, sure: Sequence[int]) -> tuple[Array, Array, Array]:
        """Free functions beside findings: their sum, their columns, covariance of these."""
        tau = self.beside(sure)[1]
        model = self.account.any_size(self.given(sure), tau)
        _, mean, covariance = self.account.sums.posterior(model)
        free = self.account.columns_of([k for k in self.free if tau[k] > 0.0])
        columns = self.account.columns[:, free]
        return columns @ mean[free], columns, covariance[np.ix_(free, free)]

    def taken(
        self,
        sure: Sequence[int],
        own: Iterable[int],
        tau: Sequence[float],
        factors: Sequence[str],
    ) -> tuple[float, float]:
        """Variance that findings explain, and that free functions explain of others.

        Of factors, and of products with the findings' lines: the size of a line is one function of
        all that it follows. What is met in one direction only is half of the place.
        """
        given, groups = self.given(sure), self.account.groups
        beside = self.account.any_size(given, tau)
        lines = {0.0} if "place" in factors else set()
        lines |= {m for k in own for m in groups[self.places[k]].orders}
        free = [k for k in self.free if self.is_of(k, factors) or groups[k].is_of_line(lines)]
        mine = sum(self.account.variance(given, [self.places[k]]) for k in own)
        return mine, self.account.variance(beside, [k for k in free if not given[k]])

    def same(self, name: int) -> list[str]:
        """Factors whose functions are columns of a finding in this design: speed at one speed."""
        groups = self.account.groups
        basis = orthonormal_basis(_centred(groups[self.places[name]].columns))
        found = []
        for k in self.free:
            columns = _centred(groups[k].columns)
            left = columns - basis @ (basis.T @ columns)
            if np.abs(left).max() <= _SAME * np.abs(columns).max(initial=0.0):
                found.append(groups[k].factor)
        return found

    def is_of(self, k: int, factors: Sequence[str]) -> bool:
        """A group is of one of the factors."""
        return self.account.groups[k].factor in factors


def _centred(columns: Array) -> Array:
    return np.asarray(columns - columns.mean(axis=0))


def names_by_form(names: NamedForms, findings: Sequence[Finding]) -> list[Finding]:
    """The findings, those not confirmed whose form is not better than the free function.

    One is confirmed where a free function of any factors in its place has at most a log
    Bayes factor of 3 in its favour, and where the free functions of its own factors explain
    at most 5 % of what it and they explain together.
    """
    found = list(findings)
    while True:
        sure = confirmed_names(names, found)
        wrong = _worst(names, found, sure)
        if not wrong:
            return found
        for k, reason in wrong.items():
            found[k] = replace(found[k], status=NOT_CONFIRMED, reason=reason)


def _worst(names: NamedForms, found: Sequence[Finding], sure: Sequence[int]) -> dict[int, str]:
    """The findings, alone or those of related factors together, whose form is least right."""
    if not sure:
        return {}
    score, tau = max(names.beside(sure, start) for start in (None, names.account.tau))
    worst: tuple[float, Sequence[int], Sequence[float]] | None = None
    for asked in [*([k] for k in sure), *sorted(_related(found, sure), key=len)]:
        rest = [j for j in sure if j not in asked]
        freed, free = max(names.beside(rest, start) for start in (tau, names.account.tau))
        if freed > score:
            # What the search has met without them is tried with them, too.
            score, tau = max((score, tau), names.beside(sure, free))
        least = worst[0] if worst else 0.0
        # More names are in question only where fewer do not explain it.
        if freed - score > max(ALIKE, least + ALIKE * (len(asked) > 1)):
            worst = (freed - score, asked, free)
    if worst is not None:
        better, group, other = worst
        what = _followed(names, other, tau)
        reason = f"{what} explains the readings better (log Bayes factor {better:.0f})"
        return dict.fromkeys(group, reason)
    for k in sure:
        follows = [f for f in EFFECTS[found[k].cause].form_of if f != TRANSITION]
        follows += names.same(k)
        freed, free = names.beside([j for j in sure if j != k], tau, follows)
        if follows and freed > score - ALIKE:
            what = _followed(names, free, tau)
            return {k: f"{what} explains the readings as well"}
    for k in sure:
        # Lines of the place that are not its own are no part of an order.
        is_line = found[k].cause == MissingOrder.kind
        own, left = names.taken(sure, [k], tau, () if is_line else EFFECTS[found[k].cause].form_of)
        if own < TAKES * (own + left):
            share = 100.0 * own / (own + left)
            return {k: f"its formula explains {share:.0f} % of what its factors explain"}
    return {}


def _related(found: Sequence[Finding], sure: Sequence[int]) -> list[list[int]]:
    """Sets of several findings: of one cause, or of factors that hold each other's functions.

    A row of bumps is better than nothing one by one, and worse than one function together.
    """
    causes = dict.fromkeys(found[k].cause for k in sure)
    sets = [[k for k in sure if found[k].cause == cause] for cause in causes]
    for family in FAMILIES:
        sets.append([k for k in sure if family & {*EFFECTS[found[k].cause].form_of}])
    return [own for own in sets if len(own) > 1]


def _followed(names: NamedForms, other: Sequence[float], tau: Sequence[float]) -> str:
    """Factors that a model has and another one has not, or else all that it has, in words."""
    own = [k for k in names.free if other[k] > 0.0]
    new = [k for k in own if tau[k] == 0.0] or own
    factors = dict.fromkeys(names.account.groups[k].factor for k in new)
    words = " and ".join(WORDS[factor] for factor in factors)
    return f"an error that depends on {words}" if words else "noise alone"


def confirmed_names(names: NamedForms, findings: Sequence[Finding]) -> list[int]:
    """Places of the findings that are confirmed and have columns."""
    return [k for k, f in enumerate(findings) if f.confirmed and k in names.places]
