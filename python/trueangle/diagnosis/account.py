"""Account of readings: data prepared, and causes chosen, against the simulation or nearly it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.blindspots import blind_spots
from ..effects.effect import ScatterFinding
from ..effects.noiselaw import NEW_SCATTER
from ..estimation.regression import Regression
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.arrays import Array
from ..support.deadline import current_deadline
from .delay import Delay, error_before_delay, find_delay
from .exchange import exchanged_causes
from .gearedlines import GearedLines, GearedLinesRatio
from .gearratio import find_ratio, near_ratio, signals_at_ratio
from .identifiability import in_common_form
from .judgedbeliefs import effects_as_measured
from .penalty import NEW_CAUSE, misfit_of_scatter, total_penalty
from .rounding import account_beyond_rounding, is_rounding_only, unrounded
from .selection import select_causes
from .unevennoise import uneven_noise

#: Readings used at most: beyond, one of every n in a row is taken at random.
MOST_READINGS = 40_000


#: Weight below which a reading is put aside as an outlier.
ASIDE = 1e-3


@dataclass(frozen=True)
class CauseSelection:
    """What was chosen for readings against a simulation.

    Attributes
    ----------
    start, chosen : Regression
    scatter : list of ScatterFinding
    spots : list of Blindness
    """

    start: Regression
    chosen: Regression
    scatter: list[ScatterFinding]
    spots: list[Ambiguity]


@dataclass(frozen=True)
class PreparedData:
    """Readings as they are compared with a simulation.

    Attributes
    ----------
    sim : Simulation
        As stated, but with the ratio of the readings.
    ratio : Ratio or None
        A gear ratio that is not the stated one.
    delay : Delay or None
        Where the readings are so old that their pattern moves with it.
    every, signals : Signals
        All readings, and those that are used: at the angle of that time before.
    error : ndarray
        Of those that are used, arcsec.
    rows : ndarray or None
        Places of the latter among the former; None where all are used.
    before : float
        Deviance of the readings as they are, where a delay is subtracted.
    """

    sim: Simulation
    ratio: GearedLinesRatio | None
    delay: Delay | None
    every: Signals
    signals: Signals
    error: Array
    rows: NDArray[np.int64] | None
    before: float = 0.0

    @classmethod
    def of(
        cls,
        every: Signals,
        error: Array,
        sim: Simulation,
        ratio: GearedLinesRatio | None = None,
        delay: Delay | None = None,
    ) -> PreparedData:
        """With another gear ratio or with that of the simulation, and with the delay subtracted."""
        if ratio is not None:
            sim = ratio.simulation
            every = signals_at_ratio(sim, every, error)
        then = every
        if delay is not None:
            then, error = error_before_delay(every, error, delay.seconds)
        rows = _directed(every)
        rows = rows[_subsample(rows.size)]
        if rows.size == len(every):
            return cls(sim, ratio, delay, every, then, error, None)
        return cls(sim, ratio, delay, every, then.take(rows), error[rows], rows)


@dataclass(frozen=True)
class Account:
    """What was chosen, and what it was chosen against.

    Attributes
    ----------
    seen : Seen
    choice : Choice
    believed : Simulation
        The simulation with the effects it claims as the readings show them.
    first : Regression
        The readings as they are, without any cause.
    """

    seen: PreparedData
    choice: CauseSelection
    believed: Simulation
    first: Regression


def account_of(every: Signals, error: Array, sim: Simulation) -> Account:
    """Choose the causes that make readings differ from a simulation.

    Parameters
    ----------
    every : Signals
    error : ndarray
        Measured error, arcsec.
    sim : Simulation

    Returns
    -------
    Account
        The better one where the ratio may be another one.
    """
    geared = GearedLines.of(sim, every, error)
    ratio = None if geared is None else find_ratio(geared)
    account = _believed(PreparedData.of(every, error, sim, ratio))
    near = None if geared is None or ratio else near_ratio(geared)
    if near is not None and not current_deadline().over:
        seen = PreparedData.of(every, error, sim, near)
        if _helps(seen, account.choice.chosen):
            account = _better(account, _believed(seen), NEW_CAUSE)
    delay = (
        None if current_deadline().over else find_delay(account.seen.every, error, account.seen.sim)
    )
    if delay is None or current_deadline().over:
        return account
    then = PreparedData.of(every, error, sim, account.seen.ratio, delay)
    other = _believed(replace(then, before=account.first.start))
    return _better(account, other, NEW_CAUSE + account.choice.chosen.log_n)


def _better(account: Account, other: Account, price: float) -> Account:
    """The other account where it is better by a ``price``."""
    chosen, others = account.choice.chosen, other.choice.chosen
    if total_penalty(others) < total_penalty(chosen) - price:
        return replace(other, first=account.first)
    return account


def _helps(seen: PreparedData, chosen: Regression) -> bool:
    """Whether another ratio helps, alone or with the chosen causes; a whole account is slower."""
    start = _start(seen, seen.sim)
    hopes = (start, start.with_terms(chosen.terms))
    return min(map(total_penalty, hopes)) < total_penalty(chosen)


def _believed(seen: PreparedData) -> Account:
    """The account, and the simulation with the effects it claims as the readings show them."""
    choice, believed = _chosen(seen, seen.sim), seen.sim
    # Twice each: what one was confused with is only known once the others are right.
    for _ in range(2 * len(seen.sim.effects)):
        others = [] if current_deadline().over else _corrections(choice, believed, seen.sim)
        tried = [(_chosen(seen, other), other) for other in others]
        best = min(tried, key=lambda each: total_penalty(each[0].chosen), default=None)
        if best is None or total_penalty(best[0].chosen) >= total_penalty(choice.chosen):
            break
        choice, believed = best
    return Account(seen, choice, believed, choice.start)


def _corrections(
    choice: CauseSelection, believed: Simulation, stated: Simulation
) -> list[Simulation]:
    """With one refuted effect as the readings show it, with the chosen causes or without them.

    Another size of an assumed effect is tried before further causes that compensate for it.
    """
    settled = [choice.chosen, choice.start] if choice.chosen.terms else [choice.start]
    found = (effects_as_measured(each, believed, stated, choice.spots) for each in settled)
    return [other for other in found if other is not None]


def _start(seen: PreparedData, sim: Simulation) -> Regression:
    """The readings against a simulation, without any cause.

    A delay stays free in every fit: what follows the direction, for example, is tested jointly
    with it.
    """
    error = seen.error - sim.predict(seen.signals)
    if seen.delay is None:
        return Regression.of(seen.signals, error, sim.surroundings)
    beside = seen.delay.columns(seen.signals)
    start = Regression.of(seen.signals, error, sim.surroundings, beside=beside)
    # Its form leaves a share of what it explains, as that of any cause.
    return replace(start, start=max(start.start, seen.before))


def _chosen(seen: PreparedData, sim: Simulation) -> CauseSelection:
    """Choose the causes that make readings differ from a simulation."""
    start = _start(seen, sim)
    # What is always free is no blind spot.
    spots = blind_spots(start if seen.delay is None else _start(replace(seen, delay=None), sim))
    chosen = (
        start if is_rounding_only(start) else account_beyond_rounding(start, select_causes(start))
    )
    scatter: list[ScatterFinding] = []
    if current_deadline().over:
        return CauseSelection(start, chosen, scatter, spots)  # the residual is not yet scatter
    least = NEW_SCATTER + misfit_of_scatter(start, chosen)
    uneven = [item for item in _uneven(start, chosen) if item.bic_gain > least]
    if uneven:
        scatter += uneven
        start = start.weighted(uneven[0].weights)
        chosen = select_causes(start, chosen.terms)
    chosen = account_beyond_rounding(start, in_common_form(exchanged_causes(chosen), spots))
    scatter += [i for i in _unweighing(chosen) if i.bic_gain > NEW_CAUSE]
    return CauseSelection(start, chosen, scatter, spots)


def _uneven(start: Regression, chosen: Regression) -> list[ScatterFinding]:
    """Causes of uneven noise, strongest first, with outliers (bursts above all) rejected."""
    found = uneven_noise(unrounded(chosen))
    if not found:
        return []
    limit = max(found[0].bic_gain, NEW_CAUSE)
    aside = [i.weights < ASIDE for i in _unweighing(chosen) if i.bic_gain > limit]
    rows = np.any(aside, axis=0)
    if not rows.any():
        return found
    cleaned = start.of_readings(start.readings.less(np.where(rows, chosen.left, 0.0)))
    return uneven_noise(unrounded(cleaned.with_terms(chosen.terms)))


def _unweighing(regression: Regression) -> list[ScatterFinding]:
    """Causes of the scatter of those that give readings no weights, strongest first."""
    before = unrounded(regression)
    found = [
        item
        for effect in EFFECTS.values()
        if not effect.weighs
        and (item := effect.find_scatter(regression if effect.rounds else before)) is not None
    ]
    return sorted(found, key=lambda item: -item.bic_gain)


def _directed(signals: Signals) -> NDArray[np.int64]:
    """Readings but those at a turning point: which way the joint went there is not known.

    One that hardly moves has none to speak of, and all of its readings count.
    """
    turning = ~signals.segment_first[signals.segment] & (signals.travel == 0.0)
    return np.arange(len(signals)) if 2 * turning.sum() > turning.size else np.flatnonzero(~turning)


def _subsample(n: int) -> NDArray[np.int64]:
    """One reading of every n in a row, at random within each; all where they are few enough."""
    if n <= MOST_READINGS:
        return np.arange(n)
    edges = np.linspace(0, n, MOST_READINGS + 1).astype(np.int64)
    rng = np.random.default_rng(0)
    return edges[:-1] + (rng.random(MOST_READINGS) * np.diff(edges)).astype(np.int64)
