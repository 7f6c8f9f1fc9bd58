"""Gain of a finding on runs that took no part in choosing it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..simulation.effects import EFFECTS
from ..simulation.signals import Signals
from .candidates import CANDIDATES
from .space import Proposal, Space
from .whitening import RunEffect

__all__ = ["Gain", "measure_gain"]

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

#: Parts of the runs held out in turn; resamples of runs for the interval; shuffles.
FOLDS = 5
RESAMPLES = 1000
SHUFFLES = 3

#: Findings, in the order found, for which every fold searches again.
SEARCHED = 4

#: Causes that leave each run with a zero of its own, which held-out runs then get too.
OWN_ZERO = ("zero_slip", "drift_within_run", "missed_counts")


@dataclass(frozen=True)
class Gain:
    """What a finding is worth on held-out runs.

    Attributes
    ----------
    holdout : str
        What was held out.
    rms_before, rms_after, peak_to_peak_before, ..., max_abs_after : float
        Arcsec, without and with the finding, all other findings in place.
    reducible_share : float or None
        (rms0^2 - rms1^2)/(rms0^2 - noise^2); None where nothing can transfer.
    interval : (float, float) or None
        95 % of its bootstrap over runs.
    control_share : float or None
        The same share with the factor's labels shuffled over runs: should be at most 0
        (given as -1 where it is below).
    note : str
    """

    holdout: str
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    reducible_share: float | None
    interval: tuple[float, float] | None
    control_share: float | None
    note: str

    def to_json(self) -> dict[str, Any]:
        """The ``gain`` object of a finding."""
        found: dict[str, Any] = {"holdout": self.holdout}
        for when, values in (("before", self.before), ("after", self.after)):
            for name, value in zip(("rms", "peak_to_peak", "max_abs"), values, strict=True):
                found[f"{name}_{when}_arcsec"] = value
        found["reducible_share"] = self.reducible_share
        found["reducible_share_interval"] = None if self.interval is None else [*self.interval]
        found["control_share"] = self.control_share
        found["note"] = self.note
        return found


def measure_gain(space: Space, groups: Sequence[Sequence[int]], seed: int = 0) -> list[Gain]:
    """Gain of every finding (its terms' indices) beside the others, by leaving out runs.

    In every fold the model is fitted to the other runs alone, and what was searched for
    (orders, lengths, places) is searched there again, for the first `SEARCHED` findings.
    A single run is left out in stretches of its record.
    """
    rng = np.random.default_rng(seed)
    unit, what = _units(space)
    count = int(unit.max()) + 1
    folds = rng.permutation(count) % min(FOLDS, count)
    own_zero = any(term.cause in OWN_ZERO for term in space.terms)
    left = np.zeros((len(groups) + 1, space.n))
    for fold in range(int(folds.max()) + 1):
        test = folds[unit] == fold
        for k, values in enumerate(_held_out(space, groups, test, own_zero)):
            left[k, test] = values
    clean = ~space.wild
    found = []
    for k, group in enumerate(groups):
        cause = space.terms[group[0]].cause
        before, after = left[k + 1][clean], left[0][clean]
        transfers = EFFECTS[cause].transfers
        share = interval = control = None
        if transfers:
            share, interval = _share(before, after, unit[clean], space.variance, rng)
            control = _control(space, group, unit, rng)
        found.append(
            Gain(
                f"{what} ({int(folds.max()) + 1} parts)"
                + (", zero of each held-out run taken from itself" if own_zero else ""),
                _numbers(before),
                _numbers(after),
                share,
                interval,
                control,
                ""
                if transfers
                else "no transferable gain: a new run draws it anew; what is gained is an "
                "honest uncertainty",
            )
        )
    return found


def _units(space: Space) -> tuple[NDArray[np.int64], str]:
    """What is held out as a whole: the runs, or stretches of the one run there is."""
    present = np.unique(space.signals.run)
    if present.size > 1:
        return np.searchsorted(present, space.signals.run), "whole runs"
    return (np.arange(space.n) * 2 * FOLDS) // space.n, "stretches of the one run"


def _numbers(e: Array) -> tuple[float, float, float]:
    return (
        float(np.sqrt(np.mean(e**2))),
        float(np.ptp(e)),
        float(np.abs(e).max()),
    )


def _held_out(
    space: Space, groups: Sequence[Sequence[int]], test: Rows, own_zero: bool
) -> list[Array]:
    """Residuals of the held-out readings with every finding, then without each."""
    train = _part(space, ~test)
    terms = [_rebuilt(term, train, space, ~test) for term in space.terms]
    full = train.with_terms(terms)
    for group in groups[:SEARCHED]:
        cause = space.terms[group[0]].cause
        if CANDIDATES[cause].located and EFFECTS[cause].transfers:
            full = _searched_again(full, group)
    signals = space.signals.take(test)
    results = [_residual(full, signals, space.residual[test], own_zero)]
    for group in groups:
        rest = full.with_terms(t for k, t in enumerate(full.terms) if k not in group)
        results.append(_residual(rest, signals, space.residual[test], own_zero))
    return results


def _part(space: Space, rows: Rows) -> Space:
    return Space(
        space.signals.take(rows),
        space.residual[rows],
        space.belief,
        None if space.weights is None else space.weights[rows],
        space.lines.take(rows),
        rho=space.whiten.rho,
    )


def _rebuilt(term: Proposal, train: Space, space: Space, rows: Rows) -> Proposal:
    effect = term.run_effect
    if effect is not None:
        effect = RunEffect(effect.columns[rows], effect.ratio)
    return replace(term, columns=term.columns[rows], run_effect=effect)


def _searched_again(full: Space, group: Sequence[int]) -> Space:
    """The finding's searched terms chosen anew in this part of the runs."""
    terms = list(full.terms)
    kept = [term for k, term in enumerate(terms) if k not in group]
    current = full.with_terms(kept)
    found: list[Proposal] = []
    for k in group:
        proposal = CANDIDATES[terms[k].cause].propose(current)
        if proposal is None or proposal.cause != terms[k].cause:
            break
        found.append(proposal)
        current = full.with_terms([*kept, *found])
    if len(found) < len(group):
        return full
    for k, proposal in zip(group, found, strict=True):
        terms[k] = proposal
    return full.with_terms(terms)


def _residual(fitted: Space, signals: Signals, residual: Array, own_zero: bool) -> Array:
    """Residual at other readings: lines and every regressor that can be rebuilt there."""
    from ..simulation.effects.effect import line_columns

    base = np.column_stack(
        [
            np.ones(len(signals)),
            *(line_columns(signals.theta, m) for m in fitted.belief.pattern.orders),
        ]
    )
    left = residual - base @ fitted.coefficients[: base.shape[1]]
    for term, coefficients in fitted.fitted():
        if coefficients.size and EFFECTS[term.cause].transfers:
            columns = CANDIDATES[term.cause].columns(signals, fitted.around, term.shape)
            left = left - columns @ coefficients
    if own_zero:
        for start, stop in signals.run_bounds():
            left[start:stop] -= np.median(left[start:stop])
    return np.asarray(left)


def _share(
    before: Array, after: Array, unit: NDArray[np.int64], variance: float, rng: np.random.Generator
) -> tuple[float, tuple[float, float]]:
    """Reducible share and its bootstrap interval over the units held out."""
    count = np.bincount(unit).astype(np.float64)
    power0 = np.bincount(unit, weights=before**2)
    power1 = np.bincount(unit, weights=after**2)

    def share(weights: Array) -> Array:
        n = weights @ count
        p0, p1 = weights @ power0 / n, weights @ power1 / n
        reducible = np.maximum(p0 - variance, 1e-3 * variance)
        return np.asarray((p0 - p1) / reducible)

    draws = rng.multinomial(count.size, np.full(count.size, 1.0 / count.size), RESAMPLES)
    low, high = np.quantile(share(draws.astype(np.float64)), [0.025, 0.975])
    return float(share(np.ones((1, count.size)))[0]), (float(low), float(high))


def _control(
    space: Space, group: Sequence[int], unit: NDArray[np.int64], rng: np.random.Generator
) -> float:
    """Share that the finding reaches with its factor's labels shuffled over runs."""
    cause = space.terms[group[0]].cause
    rest = space.with_terms(t for k, t in enumerate(space.terms) if k not in group)
    y = rest.left - rest.whiten.run_part(rest.left)
    y = np.where(space.wild, 0.0, y)
    test = unit % 2 == 0
    shares = []
    for _ in range(SHUFFLES):
        signals = _shuffled(space.signals, EFFECTS[cause].factor, unit, rng)
        columns = np.hstack(
            [CANDIDATES[cause].columns(signals, space.around, space.terms[k].shape) for k in group]
        )
        coefficients = np.linalg.lstsq(columns[~test], y[~test], rcond=None)[0]
        after = y[test] - columns[test] @ coefficients
        p0, p1 = float(np.mean(y[test] ** 2)), float(np.mean(after**2))
        share = (p0 - p1) / max(p0 - space.variance, 1e-3 * space.variance)
        shares.append(max(share, -1.0))
    return float(np.mean(shares))


def _shuffled(
    signals: Signals, factor: str, unit: NDArray[np.int64], rng: np.random.Generator
) -> Signals:
    """The labels of ``factor`` given to other runs (or turned round at random)."""
    runs = signals.runs
    run = signals.run
    sign = rng.permutation(np.resize([1.0, -1.0], runs))[run]
    if factor == "direction":
        first = np.zeros(signals.segment_direction.size)
        first[signals.segment] = sign
        return replace(
            signals,
            direction=signals.direction * sign,
            segment_direction=signals.segment_direction * first,
        )
    if factor == "velocity" and signals.velocity is not None:
        return replace(signals, velocity=signals.velocity * sign)
    other = rng.permutation(runs)
    if factor == "temperature" and signals.temperature is not None:
        return replace(signals, temperature=_exchanged(signals.temperature, run, other))
    if factor == "torque" and signals.torque is not None:
        if np.ptp(np.bincount(run, np.abs(signals.torque)) / np.bincount(run)) == 0.0:
            return replace(signals, torque=signals.torque * sign)
        scale = _level(np.abs(signals.torque), run)
        size = np.where(scale > 0.0, scale, 1.0)
        shape = np.where(scale[run] > 0.0, signals.torque / size[run], sign)
        return replace(signals, torque=shape * scale[other][run])
    if factor == "mount" and signals.mount is not None:
        return replace(signals, mount=_level(signals.mount, run)[other][run])
    turned = rng.uniform(0.0, 2.0 * np.pi, int(unit.max()) + 1)[unit]
    return replace(signals, theta=signals.theta + turned)


def _level(values: Array, run: NDArray[np.int64]) -> Array:
    count = np.maximum(np.bincount(run), 1)
    return np.asarray(np.bincount(run, weights=values) / count)


def _exchanged(values: Array, run: NDArray[np.int64], other: NDArray[np.int64]) -> Array:
    level = _level(values, run)
    return np.asarray(values - level[run] + level[other][run])
