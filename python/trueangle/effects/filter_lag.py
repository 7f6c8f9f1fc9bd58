"""A filter in the encoder: the pattern low-passed with speed, without a ramp."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..estimation.extension import Extension
from ..estimation.linear import pseudo_inverse
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, Pattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.motion import FilterLagTerm
from ..support.arrays import quantile
from .ambiguity import Ambiguity
from .drawing import Drawing
from .effect import Effect, Reported, Spots
from .latency import UNTIMED, Latency
from .missing_order import MissingOrder
from .search import Array, Fitted, golden_maximum, is_gear_order

#: Cutoffs searched, in multiples of the highest frequency at which a line passes.
CUTOFFS = np.geomspace(0.2, 3000.0, 12)

#: The coarse search must promise some of what a new cause needs to be worth refining.
REFINED_FROM = 3.0

#: Damping ratios of a second-order loop.
DAMPING = (0.4, 0.7, 1.1)

#: Steps by which cutoff and damping are made exact, and the change of their logarithms by
#: which slopes are taken.
NEWTON_STEPS = 8
STEP = 0.01

#: Change of a logarithm below which it is settled, and of the deviance: a tenth of a standard
#: error away it would be as large.
ENOUGH = 1e-4
ENOUGH_DEVIANCE = 0.01


@dataclass(frozen=True)
class FilterLag(Effect):
    """Low-pass on the pattern without a ramp error (type-2 tracking loop).

    A line of order m at v turns per second is multiplied by
    ``1/(1 + j m v/f_c)`` or, with a damping ratio ``ζ``, by

    ::

        1 / (1 - w² + 2 j ζ w),    w = m v / f_n,    f_n = 2 ζ f_c

    so that far below the cutoff both delay by ``1/(2π f_c)``.

    Parameters
    ----------
    cutoff_hz : float
        f_c.
    damping : float, optional
        zeta: a filter of second order.
    """

    cutoff_hz: float
    damping: float | None = None

    kind: ClassVar[str] = FilterLagTerm.kind
    size_grows: ClassVar[bool] = False
    sentence: ClassVar[str] = (
        "A filter or tracking loop in the encoder follows the ramp but smooths the pattern: "
        "fast lines shrink and trail in proportion to speed."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    form_of: ClassVar[tuple[str, ...]] = ("speed_place",)
    measure: ClassVar[str] = (
        "record moving at two or more speeds in both directions, densely enough for gear lines"
    )
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Latency: "three speeds, the fastest with the gear lines above a tenth of the cutoff",
        MissingOrder: "both directions or two speeds",
    }
    located: ClassVar[bool] = True
    changes_lines: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        pattern = around.pattern
        seen = pattern.passed(
            signals.theta, signals.turns_per_s, lambda f: _low_pass(f, self.cutoff_hz, self.damping)
        )
        return np.asarray(seen - pattern.value(signals.theta))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        return None if of.around.pattern.orders.size == 0 else cls(size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        signals, pattern = regression.signals, regression.around.pattern
        if signals.velocity is None or pattern.orders.size == 0 or regression.has(cls.kind):
            return None
        top = float(pattern.orders.max() * np.abs(signals.turns_per_s).max())
        if top == 0.0:
            return None
        waves, frequency = regression.of_pattern(
            "waves",
            None,
            lambda: (
                _waves(pattern, signals.theta),
                pattern.orders * signals.turns_per_s[:, None],
            ),
        )

        def gain(cutoff_hz: float, damping: float | None) -> float:
            column = _lagged(waves, frequency, cutoff_hz, damping)
            return float(regression.fixed_gains(column[:, None])[0])

        cutoffs = top * CUTOFFS

        def grid(damping: float | None) -> Array:
            columns = regression.of_pattern(
                f"lagged {damping}",
                None,
                lambda: np.column_stack(
                    [_lagged(waves, frequency, float(c), damping) for c in cutoffs]
                ),
            )
            return regression.fixed_gains(columns)

        grids: dict[float | None, Array] = {None: grid(None)}
        coarse = float(grids[None].max())
        unlikely = regression.is_pruned(coarse, 1, REFINED_FROM)
        if not (unlikely or regression.is_dominated(coarse, 1, REFINED_FROM)):
            grids |= {damping: grid(damping) for damping in DAMPING}
        step = float(np.log(CUTOFFS[1] / CUTOFFS[0]))
        best: Extension | None = None
        for order in (1, 2):
            if order == 2 and len(grids) == 1:
                break
            damping = None if order == 1 else max(DAMPING, key=lambda d: float(grids[d].max()))
            cutoff = float(cutoffs[int(np.argmax(grids[damping]))])
            deviance = float(grids[damping].max())
            if deviance <= 0.0:
                continue
            for width in (step, 0.3 * step) if len(grids) > 1 else ():
                f = partial(gain, damping=damping)
                x, deviance = golden_maximum(
                    lambda x, f=f: f(float(np.exp(x))),  # type: ignore[misc]
                    np.log(cutoff) - width,
                    np.log(cutoff) + width,
                    10,
                )
                cutoff = float(np.exp(x))
                if damping is None:
                    break
                damping, deviance = golden_maximum(
                    partial(gain, cutoff), 0.7 * damping, 1.4 * damping, 8
                )
            shape: dict[str, Any] = {"cutoff_hz": cutoff, "damping": damping}
            if len(grids) > 1:
                # Cutoff and damping delay equally: together they go where each alone stops.
                shape = _settled(regression, waves, frequency, shape, cls.kind)
                deviance = max(deviance, gain(**shape))
            extension = regression.propose(
                cls.kind,
                shape,
                _lagged(waves, frequency, **shape)[:, None],
                parameters=order,
                deviance=deviance,
            )
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        return best

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        waves = _waves(around.pattern, signals.theta)
        frequency = around.pattern.orders * signals.turns_per_s[:, None]
        return _lagged(waves, frequency, **shape)[:, None]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension = terms[0][0]
        cutoff, damping = extension.shape["cutoff_hz"], extension.shape["damping"]
        waves = _waves(regression.around.pattern, regression.signals.theta)
        frequency = regression.around.pattern.orders * regression.signals.turns_per_s[:, None]
        slopes = _slopes(waves, frequency, cutoff, damping)
        others = regression.with_terms(term for term in regression.terms if term is not extension)
        x, _ = others.projected(slopes)
        covariance = regression.variance * pseudo_inverse(x.T @ x)
        # Far below the cutoff both delay by 1/(2 pi f_c) and 2 zeta/(2 pi f_n).
        delay = np.array([1.0] if damping is None else [1.0, -1.0])
        equivalent = cutoff if damping is None else cutoff / (2.0 * damping)
        relative = float(np.sqrt(delay @ covariance @ delay))
        parameters = {"cutoff_hz": quantity(equivalent, equivalent * relative)}
        if damping is not None:
            std = np.sqrt(np.diag(covariance))
            parameters["natural_frequency_hz"] = quantity(cutoff, cutoff * std[0])
            parameters["damping"] = quantity(damping, damping * std[1])
        return parameters, [FilterLag(equivalent, damping)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.velocity is None:
            yield cls.blind(UNTIMED)
        elif np.ptp(signals.direction) == 0.0:
            speed = np.abs(signals.velocity)
            # One direction at one speed filters every line by one factor: another line.
            if quantile(speed, 0.9) < 1.5 * max(float(quantile(speed, 0.1)), 1e-12):
                yield cls.blind(
                    "one speed in one direction (or at rest): a filtered pattern is only another "
                    "pattern"
                )
        elif not signals.velocity.any() or not regression.belief.pattern.orders.size:
            yield cls.blind("nothing moved, or no line is known to filter")

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != MissingOrder.kind:
            return None
        order = float(extension.shape["output_order"])
        known = order in regression.belief.pattern.orders
        if known and is_gear_order(regression.belief, order):
            for spot in spots:
                if spot.causes == (cls.kind,):
                    return MissingOrder.also_from(cls, spot)
        return None

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (FilterLagTerm(self.cutoff_hz, self.damping),)


def _low_pass(frequency: Array, cutoff: float, damping: float | None) -> NDArray[np.complex128]:
    """Gain of a low-pass of first or second order at a signed frequency, both in Hz."""
    if damping is None:
        return np.asarray(1.0 / (1.0 + 1j * (frequency / cutoff)))
    w = frequency / (2.0 * damping * cutoff)
    return np.asarray(1.0 / (1.0 - w**2 + 2j * damping * w))


def _waves(pattern: Pattern, theta: Array) -> NDArray[np.complex128]:
    """Complex lines of a pattern, shape (n, k): their real parts add up to it."""
    amplitudes = pattern.cosine - 1j * pattern.sine
    waves = _core.line_columns(np.ascontiguousarray(theta), np.ascontiguousarray(pattern.orders))
    return np.asarray(amplitudes * waves.view(np.complex128))


def _slopes(
    waves: NDArray[np.complex128], frequency: Array, cutoff_hz: float, damping: float | None
) -> Array:
    """Slopes of `_lagged` by the logarithms of the cutoff and, of second order, the damping."""

    def at(x: float, y: float) -> Array:
        d = None if damping is None else damping * float(np.exp(y))
        return _lagged(waves, frequency, cutoff_hz * float(np.exp(x)), d)

    steps = ((STEP, 0.0),) if damping is None else ((STEP, 0.0), (0.0, STEP))
    return np.column_stack([(at(x, y) - at(-x, -y)) / (2.0 * STEP) for x, y in steps])


def _settled(
    regression: Regression,
    waves: NDArray[np.complex128],
    frequency: Array,
    shape: dict[str, Any],
    kind: str,
) -> dict[str, Any]:
    """Cutoff and damping after Gauss-Newton steps on both together.

    The filter is in the model at every step, so that what it explains is not clipped.
    """
    best, lowest, before = shape, math.inf, math.inf
    for _ in range(NEWTON_STEPS):
        column = _lagged(waves, frequency, **shape)[:, None]
        extension = regression.propose(kind, shape, column)
        full = regression.with_terms([*regression.terms, extension])
        # With the coefficient 1: far below the cutoff a free one is collinear with it.
        left = regression.whiten(full.target - column[:, 0])
        left -= regression.q @ (regression.q.T @ left)
        rest = float(left @ left)
        if rest < lowest:
            best, lowest = shape, rest
        if abs(before - rest) * regression.n < ENOUGH_DEVIANCE * rest:
            return best
        before = rest
        x, _ = regression.projected(_slopes(waves, frequency, **shape))
        moves = np.linalg.lstsq(x, left, rcond=1e-10)[0]
        if np.abs(moves).max() < ENOUGH:
            return shape
        factors = np.exp(np.clip(moves, -0.5, 0.5)).tolist()
        shape = {
            "cutoff_hz": shape["cutoff_hz"] * factors[0],
            "damping": None if shape["damping"] is None else shape["damping"] * factors[1],
        }
    return best


def _lagged(
    waves: NDArray[np.complex128], frequency: Array, cutoff_hz: float, damping: float | None
) -> Array:
    """Change of the pattern by a low-pass of first or second order."""
    return _core.lagged(waves.view(np.float64), frequency, cutoff_hz, damping)
