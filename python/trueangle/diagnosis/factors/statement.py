"""The factors of a diagnosis, and its findings compared with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...effects import EFFECTS
from ...effects.missing_order import MissingOrder
from ...estimation.regression import Regression
from ...estimation.segments import short_segments
from ...joint.signals import Signals
from ...support.arrays import Array
from ..finding import Finding
from ..rounding import unrounded
from .account import MOST_READINGS, factor_account, factors_of
from .factor import Factor
from .groups import factor_groups
from .names import (
    TAKES,
    NamedForms,
    believed_groups,
    confirmed_names,
    name_group,
    names_by_form,
    orders_of,
)

#: Steps whose surroundings are looked at, parts of a run in which its largest is looked for, and
#: readings before and after by which its row is found.
MOST_EVENTS: Final = 8
WINDOWS, NEAREST = 40, 3


def stated_factors(
    chosen: Regression, findings: Sequence[Finding]
) -> tuple[list[Finding], list[Factor], set[float], tuple[Array, Array, Array] | None]:
    """Findings confirmed by their form, and the factors that the readings follow.

    A change of a line of the simulation is a finding as any other.

    Parameters
    ----------
    chosen : Regression
        With the causes chosen, of errors less a delay or another ratio, where there is one.
    findings : sequence of Finding
        Of terms of ``chosen``.

    Returns
    -------
    findings : list of Finding
    factors : list of Factor
    moved : set of float
        Lines of the simulation whose change is a part of what the readings follow.
    beyond : tuple of ndarray, or None
        What the readings of `account_rows` follow without a name, its columns, their covariance.
    """
    rows = account_rows(chosen)
    signals = chosen.signals.take(rows)
    error = _less_what_no_factor_is(unrounded(chosen))[rows]
    groups = factor_groups(
        signals,
        error,
        _lines(chosen),
        _resolved(chosen, _orders(chosen, drawn=True)),
        _frequencies(chosen),
        _steps(signals, error)[:MOST_EVENTS],
        [cycles for cycles in chosen.belief.joint.shafts.values() if abs(cycles) > 1.0],
    )
    count = len(findings)
    named = [name_group(chosen, finding, rows) for finding in findings]
    named += believed_groups(chosen, rows)
    places: dict[int, int] = {}
    for k, group in enumerate(named):
        if group is not None:
            places[k] = len(groups)
            groups.append(group)
    account = factor_account(signals, error, groups)
    if account is None:
        return list(findings), [], set(), None
    names = NamedForms(account, places)
    changes = [Finding(MissingOrder.kind, {}, {}, None, []) for _ in named[count:]]
    found = names_by_form(names, [*findings, *changes])
    lost = [k for k in range(count, len(found)) if not found[k].confirmed]
    moved = {groups[places[k]].orders[0] for k in lost}
    shafts = {name: abs(cycles) for name, cycles in chosen.belief.joint.shafts.items()}
    beyond = names.beyond(confirmed_names(names, found))
    factors = _factors(names, found, count, shafts)
    return found[:count], factors, moved, beyond if beyond[1].size else None


def _factors(
    names: NamedForms, found: Sequence[Finding], count: int, shafts: dict[str, float]
) -> list[Factor]:
    """The factors that the readings follow: those with names, then those beyond all names."""
    account, sure = names.account, confirmed_names(names, found)
    given, tau = names.given(sure), names.beside(sure)[1]
    stated, named = [], set()
    orders = [names.places[k] for k in sure if found[k].cause == MissingOrder.kind]
    lines = {m for k in orders for m in account.groups[k].orders}
    for factor in factors_of(account, shafts, lines):
        own = [k for k in sure if factor.factor in EFFECTS[found[k].cause].form_of]
        if causes := dict.fromkeys(found[k].cause for k in own if k < count):
            stated.append(replace(factor, named_by=tuple(causes)))
            taken, left = names.taken(sure, own, tau, [factor.factor])
            if left < (1.0 - TAKES) * (left + taken):
                named.add(factor.factor)
    rest = replace(account, tau=np.maximum(given, tau).tolist())
    stated += [f for f in factors_of(rest, shafts, lines, given) if f.factor not in named]
    return sorted(stated, key=lambda factor: -factor.rms)


def _less_what_no_factor_is(regression: Regression) -> Array:
    """The error less causes that are forms of no factor, as another joint's motion, or a delay."""
    delay = slice(1 + 2 * regression.belief.pattern.orders.size, regression.base.shape[1])
    error = regression.readings.residual
    error = error - regression.base[:, delay] @ regression.coefficients[delay]
    for term, coefficients in regression.fitted():
        if not EFFECTS[term.cause].form_of and term.run_effect is None:
            error = error - term.columns @ coefficients
    return error


def account_rows(regression: Regression) -> NDArray[np.int64]:
    """Readings that take part: no glitches, and of many only every n-th.

    What lasts is no glitch, nor what other passes of the place show.
    """
    glitches = short_segments(regression.outlying, regression.bounds)
    by_place = np.argsort(regression.signals.degrees % 360.0, kind="stable")
    glitches[by_place] &= short_segments(regression.outlying[by_place], [(0, regression.n)])
    rows = np.flatnonzero(~glitches)
    if rows.size <= MOST_READINGS:
        return rows
    edges = np.linspace(0, rows.size, MOST_READINGS + 1).astype(np.int64)
    rng = np.random.default_rng(0)
    return np.asarray(rows[edges[:-1] + (rng.random(MOST_READINGS) * np.diff(edges)).astype(int)])


def _frequencies(regression: Regression) -> list[float]:
    """Lines in time among the terms, Hz."""
    found = [
        term.shape.get("frequency_hz", term.shape.get("frequency")) for term in regression.terms
    ]
    return [float(np.mean(hertz)) for hertz in found if hertz is not None]


def _steps(signals: Signals, error: Array) -> list[tuple[int, int]]:
    """Run and row of the steps that noise alone does not make, largest first.

    Parts on both sides of a step are looked at for further ones.
    """
    found = []
    parts = [*signals.run_bounds()]
    while parts:
        start, stop = parts.pop()
        own = error[start:stop]
        width = own.size // WINDOWS
        if width < NEAREST:
            continue
        row, size = _largest_step(own, width)
        noise = float(np.median(np.abs(np.diff(own)))) / 0.6745 / np.sqrt(2.0)
        if size**2 * width > 2.0 * noise**2 * 4.0 * np.log(own.size):
            first = row - width
            at = start + first + _largest_step(own[first : row + width], NEAREST)[0]
            found.append((size, (int(signals.run[at]), int(signals.row[at]))))
            parts += [(start, at), (at, stop)]
    return [place for _, place in sorted(found, reverse=True)]


def _largest_step(values: Array, width: int) -> tuple[int, float]:
    """Where means of ``width`` values before and after differ most, and by how much."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    steps = np.abs(sums[2 * width :] - 2.0 * sums[width:-width] + sums[: -2 * width]) / width
    k = int(np.argmax(steps))
    return k + width, float(steps[k])


def _orders(regression: Regression, *, drawn: bool) -> list[float]:
    """Orders of the terms: those that are new in every run, or the others."""
    found: list[float] = []
    for term in regression.terms:
        if (term.run_effect is not None) is drawn:
            found += orders_of(term)
    return found


def _resolved(regression: Regression, orders: Iterable[float]) -> list[float]:
    """Orders, whole ones in the place of those of which they leave as little as a name may.

    ::

        (2 pi (m - k) T)^2 / 12    of an order m over T turns
    """
    turns = max(float(regression.signals.run_turns().max()), 1e-9)
    most = np.sqrt(12.0 * (1.0 - TAKES)) / (2.0 * np.pi * turns)
    return [round(m) if abs(m - round(m)) < most else m for m in orders]


def _lines(regression: Regression) -> list[float]:
    """Orders of the terms, of the simulation's pattern, and of the gear."""
    joint = regression.belief.joint
    found = _orders(regression, drawn=False) + regression.belief.pattern.orders.tolist()
    found += [abs(joint.output_order(name, k)) for name, k in joint.gear_orders()]
    highest = 0.5 * len(regression.signals)
    return [m for m in dict.fromkeys(found) if 0.0 < m < highest][:24]
