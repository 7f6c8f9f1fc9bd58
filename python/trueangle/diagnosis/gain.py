"""Gain of a finding on runs, and on levels of its factor, that took no part in choosing it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..estimation.linear import least_squares
from ..estimation.regression import Regression
from ..joint.signals import Signals
from ..support.arrays import Array
from ..support.deadline import current_deadline
from ..support.plainresult import ShownResult
from .holdout import (
    HoldOutModel,
    error_numbers,
    held_out_residuals,
    rebuilt_term,
    reducible_share,
    residual_at_held_out,
)
from .levels import LEAST_SHARE, LevelGain, gains_by_level

Rows = NDArray[np.bool_]

#: Parts of the runs held out in turn; shuffles.
FOLDS = 5
SHUFFLES = 3

#: Parts and shuffles are the same for the same readings.
_SEED = 0


@dataclass(frozen=True)
class Gain(ShownResult):
    """What a finding gains on held-out runs.

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
        Gain with the factor's labels shuffled over runs, as a share of what the finding
        subtracts from the same readings: should be at most 0 (given as -1 where it is below).
    note : str
    by_level : LevelGain or None
        The same with whole levels of the cause's factor held out (all runs at one speed,
        temperature, load or mount); None where the cause has no such factor or it did
        not change from run to run.
    """

    holdout: str
    before: tuple[float, float, float]
    after: tuple[float, float, float]
    reducible_share: float | None
    interval: tuple[float, float] | None
    control_share: float | None
    note: str
    by_level: LevelGain | None = None

    def _brief(self) -> str:
        share = "" if self.reducible_share is None else f", share {self.reducible_share:.3g}"
        return f"rms {self.before[0]:.4g} -> {self.after[0]:.4g} arcsec{share}, {self.holdout}"

    def to_dict(self) -> dict[str, Any]:
        """The ``gain`` object of a finding."""
        found: dict[str, Any] = {"holdout": self.holdout}
        for when, values in (("before", self.before), ("after", self.after)):
            for name, value in zip(("rms", "peak_to_peak", "max_abs"), values, strict=True):
                found[f"{name}_{when}_arcsec"] = value
        found["reducible_share"] = self.reducible_share
        found["reducible_share_interval"] = None if self.interval is None else [*self.interval]
        found["control_share"] = self.control_share
        found["note"] = self.note
        found["by_level"] = None if self.by_level is None else self.by_level.to_dict()
        return found


def _acts_within(regression: Regression, before: Array, after: Array) -> bool:
    """Whether zeros of the runs make most of an error, and little of what a finding subtracts.

    A pattern is then tested about the zero of each run, which no pattern can subtract.
    """
    clean = ~regression.outlying
    whole, taken = (
        float(np.sum(_about_zeros(regression, e)[clean] ** 2) / max(np.sum(e[clean] ** 2), 1e-300))
        for e in (before, before - after)
    )
    return whole < 0.5 < taken


def _about_zeros(regression: Regression, e: Array) -> Array:
    """Residuals about the mean of each run, computed without outliers."""
    found = e.copy()
    for start, stop in regression.bounds:
        used = ~regression.outlying[start:stop]
        found[start:stop] -= e[start:stop][used].mean() if used.any() else 0.0
    return found


def measure_gain(regression: Regression, groups: Sequence[Sequence[int]]) -> list[Gain] | None:
    """Gain of every finding (its terms' indices) in addition to the others, by holding out runs.

    In every fold the model is fitted to the other runs alone, and what was searched for
    (orders, lengths, places) is searched there again, for the first `SEARCHED` findings.
    A single run is held out in segments of its record. Causes of a factor with levels
    are measured on held-out levels as well. None where the time is up before
    (`trueangle.support.deadline`).
    """
    rng, unit, parts, holdout = _parts(regression)
    own_zero = any(EFFECTS[term.cause].draws_zeros for term in regression.terms)
    left = np.zeros((len(groups) + 1, regression.n))
    at = current_deadline()
    for fold, test in enumerate(parts):
        at.at("holding out parts", fold, len(parts))
        if at.over:
            return None
        for k, values in enumerate(held_out_residuals(regression, groups, test, own_zero)):
            left[k, test] = values
    if at.over:
        return None
    clean = ~regression.outlying
    by_level = gains_by_level(regression, groups, own_zero, unit, rng)
    found = []
    for k, group in enumerate(groups):
        cause = regression.terms[group[0]].cause
        both = left[k + 1], left[0]
        within = own_zero or _acts_within(regression, *both)
        if within and not own_zero:
            both = _about_zeros(regression, both[0]), _about_zeros(regression, both[1])
        before, after = both[0][clean], both[1][clean]
        transfers = EFFECTS[cause].transfers
        share = interval = control = None
        if transfers:
            share, interval = reducible_share(before, after, unit[clean], regression.variance, rng)
            control = _control(regression, group, unit, rng)
        numbers = error_numbers(before), error_numbers(after)
        told = holdout + ", each held-out run with its own zero" * within
        note, levels = _note(share), by_level.get(k)
        found.append(Gain(told, *numbers, share, interval, control, note, levels))
    return found


def measure_delay_gain(without: Regression, delayed: Regression) -> Gain:
    """Gain of an account at the angle of a time before, against the same one without that.

    Both are fitted to the other runs alone; ``delayed`` has the change that these make of the
    delay among its columns.
    """
    rng, unit, parts, holdout = _parts(delayed)
    own_zero = any(EFFECTS[term.cause].draws_zeros for term in delayed.terms)
    before, after = np.zeros(delayed.n), np.zeros(delayed.n)
    for test in parts:
        for values, regression in ((before, without), (after, delayed)):
            values[test] = held_out_residuals(regression, (), test, own_zero, search=False)[0]
    clean = ~delayed.outlying
    return _gain(holdout, before[clean], after[clean], unit[clean], delayed.variance, rng)


def measure_belief_gains(
    regression: Regression,
    columns: Sequence[slice],
    changes: Sequence[tuple[Array, Array]] = (),
) -> list[Gain]:
    """Gain of measured lines and effects in place of assumed ones, by holding out runs.

    ``columns`` are those of the lines among the regressors of the simulation's own pattern;
    ``changes`` are the errors of effects as assumed and as measured, at every reading. The
    strength of an effect is measured again in the other runs.
    """
    rng, unit, parts, holdout = _parts(regression)
    own_zero = any(EFFECTS[term.cause].draws_zeros for term in regression.terms)
    count = len(columns) + len(changes)
    before, after = np.zeros((count, regression.n)), np.zeros((count, regression.n))
    for test in parts:
        fitted = regression.of_rows(~test).with_terms(
            rebuilt_term(t, ~test) for t in regression.terms
        )
        left = residual_at_held_out(
            HoldOutModel.of(fitted),
            regression.signals.take(test),
            regression.base[test],
            regression.residual[test],
            own_zero,
        )
        after[:, test] = before[:, test] = left
        for k, where in enumerate(columns):
            before[k, test] += regression.base[test, where] @ fitted.coefficients[where]
        for k, (old, new) in enumerate(changes, len(columns)):
            own = old - old.mean()
            before[k, test] += (new - old - (new - old).mean())[test]
            after[k, test] -= fitted.gain(own[~test, None])[1][0] * own[test]
    clean = ~regression.outlying
    return [
        _gain(holdout, was, is_now, unit[clean], regression.variance, rng)
        for was, is_now in zip(before[:, clean], after[:, clean], strict=True)
    ]


def _gain(
    holdout: str,
    before: Array,
    after: Array,
    unit: NDArray[np.int64],
    variance: float,
    rng: np.random.Generator,
) -> Gain:
    """Gain by errors of held-out readings, without a control."""
    share, interval = reducible_share(before, after, unit, variance, rng)
    numbers = error_numbers(before), error_numbers(after)
    return Gain(holdout, *numbers, share, interval, None, _note(share))


def _note(share: float | None) -> str:
    """What is to be thought of a share on held-out readings."""
    if share is None:
        return (
            "it differs in every run, so no correction can remove it: add it to the uncertainty "
            "of a single run"
        )
    if share <= 0.0:
        return (
            "held-out readings are no better with it: do not correct it before more runs confirm it"
        )
    return ""


def _parts(
    regression: Regression,
) -> tuple[np.random.Generator, NDArray[np.int64], list[Rows], str]:
    """What is held out as a whole, the runs or segments of the one run there is, and with which.

    Also given is the generator that the parts were drawn by.
    """
    # Not by `np.unique`, which would import `numpy.ma`.
    present = np.flatnonzero(np.bincount(regression.signals.run))
    unit, what = np.searchsorted(present, regression.signals.run), "whole runs"
    if present.size == 1:
        unit = (np.arange(regression.n) * 2 * FOLDS) // regression.n
        what = "segments of the one run"
    rng, count = np.random.default_rng(_SEED), int(unit.max()) + 1
    parts = min(FOLDS, count)
    fold = (rng.permutation(count) % parts)[unit]
    return rng, unit, [fold == k for k in range(parts)], f"{what} ({parts} parts)"


def _control(
    regression: Regression, group: Sequence[int], unit: NDArray[np.int64], rng: np.random.Generator
) -> float:
    """Gain with the labels shuffled over runs, as a share of what the finding subtracts."""
    cause = regression.terms[group[0]].cause
    rest = regression.with_terms(t for k, t in enumerate(regression.terms) if k not in group)
    y = _within_runs(rest, regression.outlying)
    test = unit % 2 == 0
    # What the finding subtracts from the same readings: against the variance of all readings the
    # scatter of one half would be in the denominator of a small finding.
    reducible = np.mean(y[test] ** 2 - _within_runs(regression, regression.outlying)[test] ** 2)
    least = 1e-3 * regression.variance
    shares = []
    for _ in range(SHUFFLES):
        signals = _shuffled(regression.signals, EFFECTS[cause].factor, unit, rng)
        columns = np.hstack(
            [
                EFFECTS[cause].columns(signals, regression.around, regression.terms[k].shape)
                for k in group
            ]
        )
        # What the training half does not show (a bump that it never passes) has no size.
        seen = np.linalg.norm(columns[~test], axis=0) > 1e-6 * np.linalg.norm(columns, axis=0)
        columns = columns[:, seen]
        after = y[test] - columns[test] @ least_squares(columns[~test], y[~test])
        gained = float(np.mean(y[test] ** 2 - after**2))
        shares.append(max(gained / max(reducible, least), -1.0))
    return float(np.mean(shares))


def _within_runs(regression: Regression, outlying: NDArray[np.bool_]) -> Array:
    """The residual of the readings less the zeros of their runs."""
    left = regression.left_within_runs
    return np.where(outlying, 0.0, left)


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
        scale = _level(np.abs(signals.torque), run)
        # Loads that are equal in all runs are no other labels where they are exchanged.
        if np.ptp(scale) <= LEAST_SHARE * float(scale.max()):
            return replace(signals, torque=signals.torque * sign)
        size = np.where(scale > 0.0, scale, 1.0)
        shape = np.where(scale[run] > 0.0, signals.torque / size[run], sign)
        return replace(signals, torque=shape * scale[other][run])
    if factor == "mount" and signals.mount is not None:
        return replace(signals, mount=_level(signals.mount, run)[other][run])
    if factor == "coupled":
        moved = {joint: angle * sign for joint, angle in signals.coupled.items()}
        for start, stop in signals.run_bounds():
            by = int((stop - start) * rng.uniform(0.25, 0.75))
            for angle in moved.values():
                angle[start:stop] = np.roll(angle[start:stop], by)
        return replace(signals, coupled=moved)
    turned = rng.uniform(0.0, 2.0 * np.pi, int(unit.max()) + 1)[unit]
    return replace(signals, theta=signals.theta + turned)


def _level(values: Array, run: NDArray[np.int64]) -> Array:
    count = np.maximum(np.bincount(run), 1)
    return np.asarray(np.bincount(run, weights=values) / count)


def _exchanged(values: Array, run: NDArray[np.int64], other: NDArray[np.int64]) -> Array:
    level = _level(values, run)
    return np.asarray(values - level[run] + level[other][run])
