"""Is a finding's form right? It is compared with the free functions of all factors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...effects import EFFECTS
from ...effects.missing_order import MissingOrder
from ...effects.time_periodic import TimePeriodic
from ...estimation.factor import orthonormal_basis
from ...estimation.regression import Regression
from ...support.arrays import Array
from ..confirmation import NOT_CONFIRMED
from ..finding import Finding
from ..judgedbeliefs import believed_columns
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

    A finding that describes the noise has none: the account has its own noise.
    """
    effect, fitted = EFFECTS[finding.cause], regression.fitted()
    own = [fitted[k] for k in finding.group if not effect.describes_noise(regression.terms[k])]
    fixed = [pair for pair in own if pair[0].run_effect is None]
    parts = [effect.form_columns(regression.signals, fixed)] if fixed else []
    runs = regression.signals.run[:, None, None] == np.arange(regression.signals.runs)[:, None]
    for drawn in (term.run_effect for term, _ in own if term.run_effect is not None):
        parts.append((drawn.columns[:, None, :] * runs).reshape(regression.n, -1))
    if not parts:
        return None
    sought = 0.5 * len(rows) if finding.cause == TimePeriodic.kind else 1.0
    columns = np.hstack(parts)[rows]
    # Places and lengths that were fitted with the columns (Schwarz).
    searched = sum(term.parameters for term, _ in own) - columns.shape[1]
    return _group(columns, sought * len(rows) ** (0.5 * max(searched, 0)))


def base_group(regression: Regression, rows: NDArray[np.int64]) -> Group | None:
    """What is free with any findings, except zeros, as a group; None where nothing is.

    Low orders over an arc whose belief holds are not: a function of the place would be taken for
    a change of them.
    """
    return _group(regression.readings.base[rows][:, ~believed_columns(regression)], 1.0)


def _group(columns: Array, sought: float) -> Group | None:
    spread = np.std(columns, axis=0)
    columns = columns[:, spread > 0.0] / spread[spread > 0.0]
    if not columns.size:
        return None
    scale = float(np.sqrt(columns.shape[1]))
    return Group(NAME, columns / scale, (), np.zeros(1), None, "", sought)


class NamedForms:
    """Findings as groups in addition to the free functions of an account.

    Parameters
    ----------
    account : FactorAccount
        With a group for each finding.
    places : dict of int to int
        Group of a finding by its place in the list of findings.
    base : int or None
        Group that is in every model.
    """

    def __init__(
        self, account: FactorAccount, places: dict[int, int], base: int | None = None
    ) -> None:
        self.account, self.places, self.base = account, places, base
        self._found: dict[tuple[object, ...], tuple[float, list[float]]] = {}
        self.free = [k for k, g in enumerate(account.groups) if g.factor != NAME]
        sizes = [0.0] * len(account.groups)
        own = [0.0] * len(account.groups)
        for k in places.values():
            own[k] = 0.5
        if places:
            sizes = account.sums.search(sizes, own, sizes)[1]
        least = 1e-4 * account.total
        self.sizes = [max(size, least) if own[k] else 0.0 for k, size in enumerate(sizes)]
        if base is not None:
            self.sizes[base] = account.total

    def given(self, names: Sequence[int]) -> list[float]:
        """The model of these findings alone."""
        inside = {self.base, *(self.places[name] for name in names if name in self.places)}
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

    def taken(
        self,
        sure: Sequence[int],
        own: Iterable[int],
        tau: Sequence[float],
        factors: Sequence[str],
    ) -> tuple[float, float]:
        """Variance that findings explain, and that free functions of factors explain of others."""
        given = self.given(sure)
        rest = self.account.less(given, tau)
        free = [k for k in self.free if self.is_of(k, factors)]
        mine = sum(self.account.variance(given, [self.places[k]]) for k in own)
        return mine, rest.variance(rest.tau, free)

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

    def factors(self, tau: Sequence[float]) -> set[str]:
        """Factors of the free functions of a model."""
        return {self.account.groups[k].factor for k in self.free if tau[k] > 0.0}

    def is_of(self, k: int, factors: Sequence[str]) -> bool:
        """A group is of one of the factors."""
        return self.account.groups[k].factor in factors


def _centred(columns: Array) -> Array:
    return np.asarray(columns - columns.mean(axis=0))


def names_by_form(
    names: NamedForms, findings: Sequence[Finding], regression: Regression
) -> list[Finding]:
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
        reason = (
            f"a free function of {_followed(names, other, tau)} explains the readings better "
            f"(log Bayes factor {better:.0f})"
        )
        return dict.fromkeys(group, reason)
    for k in sure:
        follows = [f for f in EFFECTS[found[k].cause].form_of if f != TRANSITION]
        follows += names.same(k)
        freed, free = names.beside([j for j in sure if j != k], tau, follows)
        # What is there without a name may be all of it.
        as_well = ALIKE * (names.factors(free) <= names.factors(tau))
        if follows and freed > score - as_well:
            what = _followed(names, free, tau)
            return {k: f"a function of {what} explains the readings as well"}
    for k in sure:
        if found[k].cause == MissingOrder.kind:
            continue
        own, left = names.taken(sure, [k], tau, EFFECTS[found[k].cause].form_of)
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
    """Factors that a model has and another one has not, in words."""
    new = [k for k in names.free if other[k] > 0.0 and tau[k] == 0.0]
    factors = dict.fromkeys(names.account.groups[k].factor for k in new)
    return " and ".join(WORDS[factor] for factor in factors) or "its factor"


def confirmed_names(names: NamedForms, findings: Sequence[Finding]) -> list[int]:
    """Places of the findings that are confirmed and have columns."""
    return [k for k, f in enumerate(findings) if f.confirmed and k in names.places]


def names_of(names: NamedForms, findings: Sequence[Finding], factor: str) -> tuple[str, ...]:
    """Confirmed causes that are forms of a factor."""
    causes = [findings[k].cause for k in confirmed_names(names, findings)]
    return tuple(dict.fromkeys(c for c in causes if factor in EFFECTS[c].form_of))


def takes_all(names: NamedForms, findings: Sequence[Finding], factor: str) -> bool:
    """Confirmed causes leave less than 5 % of a factor to its free functions."""
    sure = confirmed_names(names, findings)
    _, tau = names.beside(sure)
    own = [k for k in sure if factor in EFFECTS[findings[k].cause].form_of]
    taken, left = names.taken(sure, own, tau, [factor])
    return bool(left < (1.0 - TAKES) * (left + taken))
