r"""One hypothesis for a wrong gear ratio: all lines of the geared shafts stand elsewhere.

Where the lines that the simulation claims of motor and wave generator are not in the readings,
the ratio r is searched that brings all of them together: with orders :math:`m_k(r)` and the
sums of each run :math:`Z_{jk}(r) = \sum_t y_t \exp(-i\,m_k(r)\,\theta_t)`,

.. math:: S(r) = \sum_k |a_k|^2 \sum_j \frac{4 |Z_{jk}(r)|^2}{n_j} \Bigm/
          \sum_k |a_k|^2 \sum_j n_j |a_k|^2

is about 1 at the right ratio and 0 elsewhere. Phases are free, as a ratio that is no whole
number gives each run its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..effects.search import golden_maximum
from ..joint.pattern import Harmonic, Pattern, line_columns
from ..joint.signals import Signals
from ..simulation.simulation import Simulation

__all__ = ["Ratio", "aligned", "find_ratio"]

Array = NDArray[np.float64]

#: Share of the believed power that must be missing at the believed ratio, and be found at
#: another one, for that to be the ratio.
MISSING, FOUND = 0.4, 0.6

#: Ratios searched: within this share of the believed one; and trials per resolution cell.
REACH, OVERSAMPLING = 0.25, 4.0

#: Golden sections of the last search: a thousandth of a thousandth of a resolution cell.
REFINEMENTS = 30

#: Variances of the noise that a plain ratio may explain less: three standard errors.
PLAIN = 9.0

#: Readings used at most for the search, of the first runs.
MOST_READINGS = 6_000


@dataclass(frozen=True)
class Ratio:
    """A gear ratio that the readings show in place of the believed one.

    Attributes
    ----------
    gear_ratio, std : float
    believed : float
    found, left : float
        Share of the believed power of the geared lines at this ratio, and at the believed.
    simulation : Simulation
        The simulation with this ratio.
    """

    gear_ratio: float
    std: float
    believed: float
    found: float
    left: float
    simulation: Simulation


def find_ratio(sim: Simulation, signals: Signals, error: Array) -> Ratio | None:
    """The gear ratio at which the believed lines are, where they are not at the believed one.

    Parameters
    ----------
    sim : Simulation
    signals : Signals
    error : ndarray
        Measured error, arcsec.

    Returns
    -------
    Ratio or None
        None where the believed lines are where they should be, or nowhere.
    """
    geared = [line for line in sim.harmonics if line.shaft != "output" and line.amplitude_arcsec]
    if not geared or sim.joint.gear_ratio == 1.0:
        return None
    here = _share(sim, geared, sim.joint.gear_ratio, *_prepared(sim, signals, error))
    if here > MISSING:
        return None
    y, theta, bounds = _prepared(sim, signals, error)
    believed = sim.joint.gear_ratio
    turns = max(float(np.median([np.ptp(theta[a:b]) for a, b in bounds])) / (2.0 * np.pi), 0.05)
    top = max(float(line.order) for line in geared)
    step = 1.0 / (OVERSAMPLING * turns * top)
    trials = np.arange(believed * (1.0 - REACH), believed * (1.0 + REACH), step)
    shares = np.array([_share(sim, geared, float(r), y, theta, bounds) for r in trials])
    best = int(np.argmax(shares))
    ratio, share = _refined(sim, geared, float(trials[best]), step, y, theta, bounds)
    if share < FOUND:
        return None
    joint = replace(sim.joint, gear_ratio=ratio)
    noise = float(np.var(y)) * max(1.0 - share, 0.05)
    power = sum(line.amplitude_arcsec**2 * float(line.order) ** 2 for line in geared)
    # Frequency of a line of amplitude a in n readings over a span s: sqrt(24 v / n) / (a s).
    spread = np.sqrt(24.0 * noise / max(y.size * power, 1e-300)) / (2.0 * np.pi * turns)
    return Ratio(ratio, float(spread), believed, share, here, replace(sim, joint=joint))


def aligned(sim: Simulation, signals: Signals, error: Array) -> Signals:
    """Signals whose runs start in the turn in which the geared lines have the believed phase.

    At a ratio p/q the lines come back after q turns of the output only, and a reference that
    was wrapped does not say in which of them a run began.
    """
    denominator = next(
        (q for q in _plain_denominators() if abs(sim.joint.gear_ratio * q % 1.0) < 1e-9), 1
    )
    if denominator == 1:
        return signals
    geared = Pattern.of([x for x in sim.harmonics if x.shaft != "output"], sim.joint)
    output = Pattern.of([x for x in sim.harmonics if x.shaft == "output"], sim.joint)
    theta = signals.theta.copy()
    for start, stop in signals.run_bounds():
        y = error[start:stop] - output.value(theta[start:stop])
        y = y - y.mean()
        fits = [
            float(y @ geared.value(theta[start:stop] + 2.0 * np.pi * k)) for k in range(denominator)
        ]
        theta[start:stop] += 2.0 * np.pi * int(np.argmax(fits))
    return replace(signals, theta=theta)


def _prepared(
    sim: Simulation, signals: Signals, error: Array
) -> tuple[Array, Array, list[tuple[int, int]]]:
    """Readings of the first runs without the lines of the output and the runs' zeros."""
    bounds = []
    for start, stop in signals.run_bounds():
        if start >= MOST_READINGS:
            break
        bounds.append((start, min(stop, start + MOST_READINGS)))
    size = bounds[-1][1]
    theta = signals.theta[:size]
    output = [line for line in sim.harmonics if line.shaft == "output"]
    y = error[:size] - Pattern.of(output, sim.joint).value(theta)
    for start, stop in bounds:
        y[start:stop] -= np.median(y[start:stop])
    return y, theta, bounds


def _share(
    sim: Simulation,
    geared: list[Harmonic],
    ratio: float,
    y: Array,
    theta: Array,
    bounds: list[tuple[int, int]],
) -> float:
    """Share of the believed power that the lines have at a ratio."""
    starts = np.array([start for start, _ in bounds])
    sizes = np.array([stop - start for start, stop in bounds], dtype=np.float64)
    joint = replace(sim.joint, gear_ratio=ratio)
    total = wanted = 0.0
    for line in geared:
        z = np.add.reduceat(
            y * np.exp(-1j * joint.output_order(line.shaft, line.order) * theta), starts
        )
        amplitude = line.amplitude_arcsec
        power = 4.0 * np.abs(z) ** 2 / sizes
        # More than is believed counts as much as is believed.
        total += float(np.minimum(power, sizes * amplitude**2).sum())
        wanted += float(sizes.sum()) * amplitude**2
    return total / wanted


def _refined(
    sim: Simulation,
    geared: list[Harmonic],
    ratio: float,
    step: float,
    y: Array,
    theta: Array,
    bounds: list[tuple[int, int]],
) -> tuple[float, float]:
    """The ratio near a trial that explains most, and the share of the believed power there.

    By all lines together: over few turns the sum of one line holds a part of its neighbours.
    """

    def explained(trial: float) -> float:
        joint = replace(sim.joint, gear_ratio=trial)
        orders = sorted({joint.output_order(line.shaft, line.order) for line in geared})
        columns = np.hstack([line_columns(theta, order) for order in orders])
        left = 0.0
        for start, stop in bounds:
            x, run = columns[start:stop], y[start:stop]
            rest = run - x @ np.linalg.lstsq(x, run, rcond=None)[0]
            left += float(rest @ rest)
        return -left

    best, most = golden_maximum(explained, ratio - 2.0 * step, ratio + 2.0 * step, REFINEMENTS)
    ratio = float(best)
    # Ratios are made of teeth: a whole or half number that explains as much is meant.
    limit = most - PLAIN * -most / max(y.size, 1)
    for denominator in _plain_denominators():
        plain = round(ratio * denominator) / denominator
        if abs(plain - ratio) < step and explained(plain) > limit:
            ratio = plain
            break
    return ratio, _share(sim, geared, ratio, y, theta, bounds)


def _plain_denominators() -> Iterator[int]:
    yield from (1, 2, 3, 4, 5, 10)
