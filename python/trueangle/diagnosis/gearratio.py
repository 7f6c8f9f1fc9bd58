"""One hypothesis for a wrong gear ratio: all lines of the geared shafts are elsewhere.

Where the lines that the simulation claims of motor and wave generator are not in the readings,
the ratio is searched that brings all of them together (`find_ratio`). One that is wrong by less
than the travel of a run resolves leaves them nearly where they were, out of step at both ends of
a run: that is only a candidate (`near_ratio`), since other causes leave much the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..joint.pattern import Pattern
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.arrays import Array
from .gearedlines import OVERSAMPLING, PLAIN, GearedLines, GearedLinesRatio, gear_denominators

#: Share of the assumed lines up to which they are missing at the assumed ratio, and share of
#: their power that must be found at another one for that to be the ratio: where less is found,
#: further lines would make it up.
MISSING, FOUND = 0.5, 0.9

#: Ratios searched: within this share of the assumed one.
REACH = 0.25

#: Standard errors from which on a near ratio is tried at all. Correlated noise and other causes
#: make some of their own: which it is, two whole accounts decide.
OUT_OF_STEP = 6.0

#: Turns of the output at most after which the lines of a near ratio come back.
MOST_TURNS = 64

#: Variances of the noise by which another turn must fit better than the stated one.
ANOTHER_TURN = 9.0


def find_ratio(geared: GearedLines) -> GearedLinesRatio | None:
    """The gear ratio at which the assumed lines are, where they are not at the assumed one.

    None where the assumed lines are where they should be, or nowhere. At even steps several
    ratios give the same numbers: the nearest to the assumed one is meant, and the others are
    reported.
    """
    believed = geared.sim.joint.gear_ratio
    # Each line counts equally: at the assumed order of one another may be, as that of the wave
    # generator at the motor's if the ratio is a tooth less. Next to a large line a small one is
    # found in any case: the large one decides.
    there = float(np.mean(geared.shares(believed)))
    if there > MISSING and geared.together(believed) > MISSING:
        return None
    low, high = sorted((believed * (1.0 - REACH), believed * (1.0 + REACH)))
    step = geared.step
    # From beyond either end, where there may be a peak.
    trials = np.arange(low - step, high + 2.0 * step, step)
    shares = np.array([geared.share(trial) for trial in trials.tolist()])
    best = geared.refined(float(trials[np.argmax(shares)]), common=False)
    alike = _alike(geared, trials, shares, best)
    nearest = min([best, *alike], key=lambda ratio: abs(ratio - believed))
    found = geared.at(nearest, common=False)
    if found.found < FOUND or float(np.mean(geared.shares(nearest))) < there:
        return None
    return replace(found, alike=tuple(sorted({best, *alike} - {nearest})))


def _alike(geared: GearedLines, trials: Array, shares: Array, best: float) -> list[float]:
    """Ratios of other peaks that explain as much as the best."""
    inner = shares[1:-1]
    tops = (inner >= shares[:-2]) & (inner >= shares[2:]) & (inner > FOUND * shares.max())
    limit = geared.left(best, common=False) * (1.0 + PLAIN / max(geared.y.size, 1))
    found: list[float] = []
    for trial in trials[1:-1][tops].tolist():
        ratio = geared.refined(trial, common=False)
        is_new = min(abs(ratio - other) for other in (best, *found)) > OVERSAMPLING * geared.step
        if is_new and geared.left(ratio, common=False) <= limit:
            found.append(ratio)
    return found


def near_ratio(geared: GearedLines) -> GearedLinesRatio | None:
    """A ratio near the assumed one at which the geared lines stay in step, to be tried.

    None where they stay in step at the assumed ratio, or are not there.
    """
    believed = geared.sim.joint.gear_ratio
    apart, together = (abs(geared.out_of_step(common)) > OUT_OF_STEP for common in (False, True))
    if not apart and not together:
        return None
    found = geared.at(geared.refined(believed, common=False), common=False)
    common = geared.in_phase(found.gear_ratio, found.std)
    if geared.keeps_phase(common):
        found = geared.at(common, common=True)
    elif not apart:
        return None
    return found if abs(found.gear_ratio - believed) > OUT_OF_STEP * found.std else None


def signals_at_ratio(sim: Simulation, signals: Signals, error: Array) -> Signals:
    """Signals whose runs start in the turn in which the geared lines have the assumed phase.

    Where the ratio is not a whole number the lines come back after several turns of the output
    only, and a reference that was wrapped does not show in which of them a run began.
    """
    turns = _turns_until_back(sim.joint.gear_ratio)
    if turns == 1:
        return signals
    geared = Pattern.of([x for x in sim.harmonics if x.shaft != "output"], sim.joint)
    output = Pattern.of([x for x in sim.harmonics if x.shaft == "output"], sim.joint)
    theta = signals.theta.copy()
    for start, stop in signals.run_bounds():
        y = error[start:stop] - output.value(theta[start:stop])
        y = y - y.mean()
        lines = [geared.value(theta[start:stop] + 2.0 * np.pi * k) for k in range(turns)]
        left = np.array([float(np.sum((y - line) ** 2)) for line in lines])
        best = int(np.argmin(left))
        if left[0] - left[best] > ANOTHER_TURN * left[best] / max(stop - start, 1):
            theta[start:stop] += 2.0 * np.pi * best
    return replace(signals, theta=theta)


def _turns_until_back(ratio: float) -> int:
    """Turns of the output after which the geared lines are back in phase, or nearly so."""
    plain = (q for q in gear_denominators() if abs(ratio * q % 1.0) < 1e-9)
    away = abs(ratio - round(ratio))
    return next(plain, min(round(1.0 / away), MOST_TURNS) if away > 0.0 else 1)
