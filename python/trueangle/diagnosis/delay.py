"""A delay of readings, estimated jointly with the pattern that it shifts.

The error of a joint that answers ``τ`` late is

::

    ε = θ(t - τ) - θ(t) + p(θ(t - τ))

so that a delay moves the argument of the pattern itself. With a large pattern neither can be
estimated without the other: the delay is found with all low orders free (Gauss and Newton), and
the whole account refers to the angle at which the joint was read.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..effects import EFFECTS
from ..effects.latency import Latency
from ..estimation.extension import Extension
from ..estimation.factor import orthonormal_basis
from ..estimation.linear import least_squares
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.earlier import earlier_signals
from ..joint.pattern import ARCSEC_PER_RAD, Pattern, lines_columns
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.angles import ARCSEC_PER_DEG, ARCSEC_PER_TURN
from ..support.arrays import Array, distinct
from .confirmation import confirmation_status
from .factors.account import BAND
from .factors.factor import Factor, FactorCurve
from .factors.group import GRID
from .finding import Finding
from .gain import measure_delay_gain
from .goodness import Unexplained
from .penalty import NEW_CAUSE

#: Orders of the output that are fitted jointly with the delay, where the travel resolves them.
ORDERS = 32

#: Readings used at most: of more, every n-th.
MOST_READINGS = 4_000

#: Steps at most, and the share of a standard error at which a step ends the search; the last of
#: them may be larger: a reading that turned there counts on either side by turns, and steps go to
#: and fro.
STEPS, SETTLED, TO_AND_FRO = 20, 0.01, 0.3

#: Standard errors from which on a delay is tried at all.
TRIED = 6.0

#: Share of its run beyond which a delay is none.
LONGEST = 0.05


@dataclass(frozen=True)
class Delay:
    """A delay that moves the argument of the pattern.

    Attributes
    ----------
    seconds, std : float
        Of the joint's reading behind the reference.
    pattern : Pattern
        Of the joint, that moves with it.
    """

    seconds: float
    std: float
    pattern: Pattern

    def columns(self, then: Signals) -> Array:
        """What one second more would add, arcsec, at readings as they were the delay before."""
        slope = self.pattern.value_and_slope(then.theta)[1]
        return np.asarray(-(then.turns_per_s * ARCSEC_PER_TURN * (1.0 + slope))[:, None])


def error_before_delay(signals: Signals, error: Array, delay_s: float) -> tuple[Signals, Array]:
    """Signals and error (arcsec) at the angle of a time before each reading."""
    then = earlier_signals(signals, delay_s)
    return then, error + (signals.theta - then.theta) * ARCSEC_PER_RAD


def find_delay(signals: Signals, error: Array, sim: Simulation) -> Delay | None:
    """The delay of readings whose pattern moves with it by more than a line can follow.

    None where a delay with an unmoved pattern explains as much (it is then one cause among
    others), or where speed was not recorded or does not change.
    """
    if signals.velocity is None or signals.time is None or np.ptp(signals.velocity) == 0.0:
        return None
    rows = np.arange(0, len(signals), max(1, -(-len(signals) // MOST_READINGS)))
    orders = _orders(signals, sim)
    longest = LONGEST * min(float(np.ptp(signals.time[a:b])) for a, b in signals.run_bounds())
    delay, linear = 0.0, np.inf
    for step in range(STEPS):
        then, moved = error_before_delay(signals, error, delay)
        y = (moved - sim.predict(then))[rows]
        then = then.take(rows)
        change, std, left, unmoved, pattern = _newton(then, y, orders, sim)
        if not np.isfinite(std):
            return None
        if step == 0 and abs(change) < TRIED * std:
            return None
        linear = left if step == 0 else linear
        settled = SETTLED if step < STEPS - 1 else TO_AND_FRO
        if step > 0 and abs(change) < settled * std:
            told = rows.size * float(np.log(max(linear / max(unmoved, 1e-300), 1e-300)))
            is_told = abs(delay) > TRIED * std and told > NEW_CAUSE
            return Delay(delay, std, pattern) if is_told else None
        delay += change
        if abs(delay) > longest:
            return None
    return None


def _orders(signals: Signals, sim: Simulation) -> Array:
    travel = float(signals.run_turns().max())
    low = [float(m) for m in range(1, ORDERS + 1) if m * travel >= 1.0]
    return np.array(sorted({*low, *sim.pattern.orders.tolist()}), dtype=np.float64)


def _newton(
    then: Signals, y: Array, orders: Array, sim: Simulation
) -> tuple[float, float, float, float, Pattern]:
    """Change of the delay with its standard error; sums of squares with it and without; pattern."""
    runs = (then.run[:, None] == distinct(then.run)).astype(np.float64)
    lines = lines_columns(then.theta, orders)
    known = orthonormal_basis(np.hstack([runs, then.direction[:, None], lines]))
    rest = y - known @ (known.T @ y)
    fitted = least_squares(np.hstack([runs, lines]), y)[runs.shape[1] :]
    known_lines = sim.pattern
    pattern = Pattern(
        np.concatenate([known_lines.orders, orders]),
        np.concatenate([known_lines.cosine, fitted[0::2]]),
        np.concatenate([known_lines.sine, fitted[1::2]]),
    )
    column = Delay(0.0, 0.0, pattern).columns(then)[:, 0]
    column = column - known @ (known.T @ column)
    power, freedom = float(column @ column), y.size - known.shape[1] - 1
    left = float(rest @ rest)
    if power <= 1e-9 * y.size or freedom <= 0:
        return 0.0, np.inf, left, left, pattern
    change = float(column @ rest) / power
    with_it = left - change**2 * power
    std = float(np.sqrt(max(with_it, 1e-300) / freedom / power))
    return change, std, with_it, left, pattern


def _at_the_time(regression: Regression, plain: Regression) -> Iterator[Extension]:
    """The terms of a delayed account as they are without the delay."""
    for term, coefficients in regression.fitted():
        effect = EFFECTS[term.cause]
        if coefficients.size and effect.transfers:
            columns = effect.columns(plain.signals, regression.around, term.shape)
            yield replace(term, columns=columns)
        else:
            yield term


def delay_finding(
    delay: Delay, chosen: Regression, plain: Regression, with_gain: bool, unexplained: Unexplained
) -> Finding:
    """The delay as a finding in addition to the ``chosen`` causes; ``plain`` is without it.

    Its change is the last of the columns that are always free in ``chosen``.
    """
    where = np.array([chosen.base.shape[1] - 1])
    std = float(np.sqrt(chosen.robust(where)[0, 0]))
    seconds = delay.seconds + float(chosen.coefficients[where[0]])
    without = plain.with_terms(_at_the_time(chosen, plain))
    saved = without.deviance - chosen.deviance
    weight = {
        "bic_gain": float(saved - chosen.log_n),
        "deviance": float(saved),
        "parameters": 1.0,
        "log_grid": 0.0,
    }
    gain = measure_delay_gain(without, chosen) if with_gain else None
    parameters = {"delay_s": quantity(seconds, std)}
    status = confirmation_status(Latency.kind, gain, None, (), unexplained)
    return Finding(Latency.kind, parameters, weight, gain, [], [Latency(seconds)], *status)


def delay_factor(finding: Finding, signals: Signals, total: float) -> Factor:
    """The speed; the error of a delay is a straight line in it: ``ε = -v τ``.

    Parameters
    ----------
    finding : Finding
        As of `delay_finding`.
    signals : Signals
    total : float
        Variance of the readings' error.
    """
    speed = 360.0 * signals.turns_per_s
    seconds, std = (
        float(x) for x in (finding.parameters["delay_s"].value, finding.parameters["delay_s"].std)
    )
    each = ARCSEC_PER_DEG * float(np.std(speed))
    rms, half = each * abs(seconds), BAND * each * std
    at = np.linspace(speed.min(), speed.max(), GRID)
    value, apart = -ARCSEC_PER_DEG * seconds * at, BAND * ARCSEC_PER_DEG * std * np.abs(at)
    return Factor(
        "speed",
        None,
        None,
        rms,
        max(rms - half, 0.0),
        rms + half,
        rms**2 / max(total, rms**2),
        0.5 * finding.evidence["bic_gain"],
        (finding.cause,) if finding.confirmed else (),
        (),
        FactorCurve(at, "deg/s", value, value - apart, value + apart),
    )
