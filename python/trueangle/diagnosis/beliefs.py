"""Verdicts on what a simulation already claims: its lines and its effects.

Every assumed line is in the regression with two free coefficients, every assumed effect
that can be predicted with a factor; the statistic of the readings about them is

::

    p̂ = p_believed + δ,    δ ± s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..estimation.linear import wald_statistic
from ..support.arrays import Array
from ..support.distributions import chi_squared_tail, normal_tail
from ..support.plainresult import ShownResult, plain_fields

#: Probability with which one of many correct assumptions is refuted.
LEVEL = 1e-4

#: Share of the assumed amplitude below which a line is absent, where it is no larger than
#: three standard errors.
ABSENT = 0.15

#: Share of the amplitude by which an assumed value may be off and is still confirmed: nothing that
#: a simulation states is exact, and good data detect a thousandth.
CLOSE = 0.03

#: Degrees of phase within which only the amplitude is wrong.
SAME_PHASE = 20.0


@dataclass(frozen=True)
class Belief(ShownResult):
    """One claim of the simulation, judged.

    Attributes
    ----------
    what : str
        A line by shaft and order, or an effect by its kind.
    verdict : str
        confirmed, absent, overestimated, underestimated, wrong_phase, wrong_place.
    believed, measured : dict of str to float
        ``amplitude_arcsec`` and ``phase_deg`` of a line, ``factor`` of an effect.
    std : dict of str to float
        Standard deviations of what is measured.
    gain : Gain or None
        Gain of the correction on held-out runs; None where it is confirmed.
    """

    what: str
    verdict: str
    believed: dict[str, float]
    measured: dict[str, float]
    std: dict[str, float]
    gain: Any = None

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``beliefs``."""
        return plain_fields(self, "what verdict believed measured std gain")


def judge_line(what: str, believed: Sequence[float], change: Array, covariance: Array) -> Belief:
    """Verdict on a line ``A cos + B sin`` that is assumed, from the change that was fitted.

    Examples
    --------
    >>> judge_line("output 1", (0.0, 10.0), np.array([0.0, -5.0]), 0.01 * np.eye(2)).verdict
    'overestimated'
    >>> judge_line("output 1", (0.0, 10.0), np.array([0.0, -10.0]), 0.01 * np.eye(2)).verdict
    'absent'
    """
    old = np.asarray(believed, dtype=np.float64)
    new = old + change
    size, found = float(np.hypot(*old)), float(np.hypot(*new))
    along = new / found if found > 0.0 else np.array([1.0, 0.0])
    across = np.array([along[1], -along[0]])
    std = float(np.sqrt(max(float(along @ covariance @ along), 0.0)))
    turn = np.degrees(np.sqrt(max(float(across @ covariance @ across), 0.0)) / max(found, 1e-300))
    off = float(np.hypot(*change))
    phases = [float(np.degrees(np.arctan2(v[0], v[1])) % 360.0) for v in (old, new)]
    away = abs((phases[1] - phases[0] + 180.0) % 360.0 - 180.0)
    if not is_changed(change, covariance) or off < CLOSE * size:
        verdict = "confirmed"
    elif found < max(ABSENT * size, 3.0 * std) and found < 0.5 * size:
        verdict = "absent"
    elif away > max(SAME_PHASE, 3.0 * float(turn)) or abs(found - size) < CLOSE * size:
        verdict = "wrong_phase"
    else:
        verdict = "overestimated" if found < size else "underestimated"
    return Belief(
        what,
        verdict,
        {"amplitude_arcsec": size, "phase_deg": phases[0]},
        {"amplitude_arcsec": found, "phase_deg": phases[1]},
        {"amplitude_arcsec": std, "phase_deg": float(min(turn, 180.0))},
    )


def is_changed(change: Array, covariance: Array) -> bool:
    """Whether a fitted change of a line is more than its errors."""
    return chi_squared_tail(wald_statistic(change, covariance), 2.0) <= LEVEL


def verdict_of_factor(factor: float, std: float) -> str:
    """Verdict on an effect that shows ``factor`` times as strong as it is assumed.

    Examples
    --------
    >>> verdict_of_factor(1.01, 0.02), verdict_of_factor(0.0, 0.1), verdict_of_factor(2.1, 0.1)
    ('confirmed', 'absent', 'underestimated')
    """
    z = abs(factor - 1.0) / max(std, 1e-300)
    if 2.0 * normal_tail(z) > LEVEL or abs(factor - 1.0) < CLOSE:
        return "confirmed"
    if abs(factor) < max(ABSENT, 3.0 * std) and factor < 0.5:
        return "absent"
    if factor < 0.0:
        return "wrong_phase"
    return "overestimated" if factor < 1.0 else "underestimated"
