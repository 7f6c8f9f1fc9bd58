"""What of a model a table of the angle alone can hold: the pattern, in turns."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

import numpy as np

from ..errors import ArgumentError, NotInvertibleError
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.terms import LocalDefect
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array


class TurnPattern:
    """The part of a model that follows the angle alone, with every angle in turns.

    ::

        g(r) = r - C₀ - θ(r),    r = θ + ε(θ)

    is what a device subtracts from its reading r. The constant ``C₀`` is kept out:
    it is the zero, which a device sets by other means.

    Parameters
    ----------
    model : HarmonicModel

    Attributes
    ----------
    left_out : tuple of Term
        Terms of the model that no table of the angle can hold.
    """

    def __init__(self, model: HarmonicModel) -> None:
        held = [term for term in model.terms if isinstance(term, LocalDefect)]
        self.left_out = tuple(term for term in model.terms if not isinstance(term, LocalDefect))
        self.source = model
        #: Without the record of the fit: a table covers the turn, and warns in words.
        self.model = model.replace(terms=tuple(held), fit=None, covariance=None)
        self.period = model.period
        self.zero = model.constant / model.period
        self._defects = tuple(held)

    # -- the functions --------------------------------------------------------------

    def correction(self, indicated: Array) -> Array:
        """``g`` at readings in turns."""
        corrected = np.asarray(self.model.correct(indicated * self.period)) / self.period
        return np.asarray(indicated - corrected - self.zero)

    def taken_off(self, indicated: Array) -> Array:
        """All that a correction subtracts from readings in turns: ``g`` and the constant."""
        return self.correction(indicated) + self.zero

    def error(self, theta: Array) -> Array:
        """The error without its constant at true angles in turns (or the model's argument)."""
        return np.asarray(self.model.error(theta * self.period)) / self.period - self.zero

    def reading(self, theta: Array) -> Array:
        """What the device indicates at true angles, the constant included."""
        if self.model.argument == "reference":
            return theta + self.error(theta) + self.zero
        # Brackets to a turn, and to a wave of the highest order.
        points = max(1024, math.ceil(64.0 * max(self.lines, default=1.0)))
        return inverse_rising(lambda r: r - self.error(r) - self.zero, theta, points)

    def directed(self, theta: Array, direction: int) -> Array:
        """The error without its constant far from a reversal, travelling one way.

        ``theta`` is one turn or more of increasing angles: what winds up with travel is
        taken as wound up.
        """
        model = self.source.replace(
            fit=None,
            covariance=None,
            terms=tuple(
                t for t in self.source.terms if isinstance(t, LocalDefect) or of_direction(t)
            ),
        )
        way = theta if direction > 0 else theta[::-1]
        ahead = np.sign(direction) * np.ceil(np.ptp(theta) + 1.0)
        travelled = np.concatenate([way - ahead, way]) * self.period
        error = np.asarray(model.error(travelled, direction=float(direction)))[len(way) :]
        error = error / self.period - self.zero
        return error if direction > 0 else error[::-1]

    @property
    def has_direction(self) -> bool:
        """Whether some of the omitted terms follow the direction of travel alone."""
        return any(of_direction(term) for term in self.source.terms)

    # -- what it consists of ----------------------------------------------------------

    @property
    def lines(self) -> dict[float, float]:
        """Amplitude in turns of every output order."""
        return {order: abs(wave) for order, wave in self.waves.items()}

    @property
    def waves(self) -> dict[float, complex]:
        """``C exp(iφ)`` of every output order ``C sin(kθ + φ)``, in turns."""
        model = self.model
        found: dict[float, complex] = {}
        for order, size, phase in zip(model.orders, model.amplitudes, model.phases, strict=True):
            found[order] = found.get(order, 0j) + complex(size / self.period * np.exp(1j * phase))
        return dict(sorted(found.items()))

    @property
    def uncertainty_arcsec(self) -> float | None:
        """Standard deviation of the model over a turn without its zero, where it is known."""
        covariance = self.source.covariance
        if covariance is None or len(covariance) < 2:
            return None
        variance = float(np.sum(np.diag(covariance)[1:])) / 2.0
        return math.sqrt(max(variance, 0.0)) / self.period * ARCSEC_PER_TURN

    @property
    def is_empty(self) -> bool:
        """Whether nothing in it follows the angle."""
        return not any(self.lines.values()) and not self._defects

    @property
    def is_periodic(self) -> bool:
        """Whether the error is periodic in one turn of the output."""
        return self.model.is_periodic

    def least_entries(self) -> int:
        """Entries to a turn with which a table holds all orders."""
        return 2 * math.ceil(max(self.lines, default=0.0)) + 1

    def check_orders(self, entries: int, target: str, allowed: Iterable[int] = ()) -> None:
        """Refuse orders at or above the Nyquist order of a table.

        Of the numbers that the target takes one is advised that keeps the order: four to a wave
        keep 98.5 % of it, two the half.

        Raises
        ------
        ArgumentError
            Names the orders and what can hold them.
        """
        limit = (entries - 1) // 2
        beyond = [order for order in self.lines if order > limit]
        if beyond:
            least, most = self.least_entries(), 4.0 * max(beyond)
            held = [n for n in allowed if n >= least]
            kept = min((n for n in held if n >= most), default=max(held, default=0))
            raise ArgumentError(
                f"{target}: {entries} entries hold orders up to {limit}, the model has "
                f"{_orders(beyond)}: use "
                + (f"`entries={kept}` or more" if held else '`target="c"`')
            )

    def check_one_turn(self, target: str) -> None:
        """Refuse shafts that do not come back to their start after one output turn.

        Raises
        ------
        ArgumentError
            Names the shafts.
        """
        if not self.is_periodic:
            strangers = [s.name for s in self.model.shafts if s.cycles_per_turn % 1.0]
            raise ArgumentError(
                f"{target} holds one turn of the output, and shaft {', '.join(strangers)} is not "
                "periodic in it. Export its model from the shaft's own "
                'encoder, or use `target="c"`, which writes one function per shaft'
            )

    def shafts(self) -> list[tuple[str, float, TurnPattern]]:
        """``(name, cycles, pattern in turns of that shaft)``, slow shafts first.

        The pattern of a shaft is inverted as a function of the shaft's own reading; its
        corrections are in turns of the shaft.
        """
        parts = []
        ordered = sorted(self.model.shafts, key=lambda shaft: shaft.cycles_per_turn)
        cycles = {shaft.cycles_per_turn for shaft in ordered}
        for defect in self._defects:
            if defect.cycles_per_turn not in cycles:
                ordered.append(Shaft("defect", defect.cycles_per_turn, (), (), ()))
                cycles.add(defect.cycles_per_turn)
        for shaft in sorted(ordered, key=lambda shaft: shaft.cycles_per_turn):
            f = shaft.cycles_per_turn
            alone = HarmonicModel(
                (
                    Shaft(
                        shaft.name,
                        1.0,
                        shaft.orders,
                        tuple(a * f / self.period for a in shaft.cosine),
                        tuple(b * f / self.period for b in shaft.sine),
                    ),
                ),
                period=1.0,
                argument=self.model.argument,
                terms=tuple(
                    type(t)(
                        t.place / self.period, t.width / self.period, t.height * f / self.period
                    )
                    for t in self._defects
                    if t.cycles_per_turn == f
                ),
            )
            parts.append((shaft.name, f, TurnPattern(alone)))
        return parts


def of_direction(term: Term) -> bool:
    """Whether two tables, one for each direction of travel, hold a term."""
    return term.follows_travel and set(term.needs) <= {"direction"}


def _orders(orders: list[float]) -> str:
    shown = ", ".join(f"{order:g}" for order in orders[:8])
    return f"order{'s'[: len(orders) != 1]} {shown}{', ...' if len(orders) > 8 else ''}"


def inverse_rising(rising: Callable[[Array], Array], wanted: Array, points: int) -> Array:
    """``x`` with ``rising(x) = wanted``, for a function that gains one turn per turn.

    Parameters
    ----------
    rising : callable
        Of angles in turns, ``rising(x + 1) = rising(x) + 1``.
    wanted : ndarray
        Its values, over any number of turns.
    points : int
        Brackets to a turn; corners of the function should be between two of them.

    Raises
    ------
    NotInvertibleError
        It decreases somewhere: several angles would give one value.

    Examples
    --------
    >>> def steep(x):
    ...     return x + 0.99 / (2 * np.pi) * np.sin(2 * np.pi * x)
    >>> x = inverse_rising(steep, np.array([-0.6, 0.0, 2.4]), 64)
    >>> bool(np.max(np.abs(steep(x) - [-0.6, 0.0, 2.4])) < 1e-12)
    True
    """
    at = np.arange(points + 1) / points
    values = rising(at)
    rise = np.diff(values)
    if np.min(rise) <= 0.0:
        k = int(np.argmin(rise))
        raise NotInvertibleError(
            f"it is not monotone between {at[k] * 360.0:.4g} and {at[k + 1] * 360.0:.4g} deg: "
            "several readings would give one corrected angle",
            float(1.0 - rise[k] * points),
        )
    turn = np.floor(wanted - values[0])
    wanted = wanted - turn
    i = np.clip(np.searchsorted(values, wanted, side="right") - 1, 0, points - 1)
    low, high = at[i], at[i + 1]
    below, above = values[i] - wanted, values[i + 1] - wanted
    found = low
    # Steps of regula falsi. A bracket with a straight function needs one; with a curved one each
    # step leaves a share of the error equal to its relative curvature, a hundredth or less.
    for _ in range(8):
        found = low - below * ((high - low) / (above - below))
        left = rising(found) - wanted
        # Turns: the rounding of a double.
        if not np.any(np.abs(left) > 1e-15):
            break
        short = left < 0.0
        low, below = np.where(short, found, low), np.where(short, left, below)
        high, above = np.where(short, high, found), np.where(short, above, left)
        flat = above - below <= 0.0  # a bracket of one step of the function's own rounding
        above = np.where(flat, below + 1.0, above)
    return np.asarray(found + turn)
