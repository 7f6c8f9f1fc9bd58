"""Errors of the reference, which turn with its mount."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import ArgumentError
from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from .ambiguity import Ambiguity
from .drawing import Drawing
from .effect import Effect, Reported, Spots
from .missing_order import MissingOrder
from .search import Array, Fitted, is_gear_order, line_parameters, line_quantities
from .shapes import best_shape
from .torsional_compliance import TorsionalCompliance

#: Orders of the reference that are searched.
REFERENCE_ORDERS = range(1, 37)


@dataclass(frozen=True)
class ReferenceLines(Effect):
    """Error of the reference, which turns with its mount: lines in ``θ + ψ``.

    Parameters
    ----------
    orders, amplitudes_arcsec, phases_deg : list of float
        ``C sin(h (theta + psi) + phase)`` with the mount angle psi.
    mount_sign : {1, -1}
        -1 where the mount angle was counted the other way.
    """

    orders: tuple[float, ...]
    amplitudes_arcsec: tuple[float, ...]
    phases_deg: tuple[float, ...]
    mount_sign: float = 1.0

    kind: ClassVar[str] = "reference_error"
    size_name: ClassVar[str] = "amplitudes_arcsec"
    sentence: ClassVar[str] = (
        "The reference (polygon, table, encoder) has its own error or is off centre: the error "
        "turns with the reference's mount and is not the joint's."
    )
    needs: ClassVar[tuple[str, ...]] = ("mount",)
    factor: ClassVar[str] = "mount"
    form_of: ClassVar[tuple[str, ...]] = ("mount_place",)
    of_motion: ClassVar[bool] = True
    measure: ClassVar[str] = (
        "turn the reference on its mount by different angles (0, 130, 250 deg) and repeat"
    )
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        TorsionalCompliance: "a second load and a turned reference",
        MissingOrder: "turn the reference on its mount (0, 130, 250 deg)",
    }
    located: ClassVar[bool] = True
    acts_on_runs: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "the reference has it, not the joint; calibrate the reference"

    def __post_init__(self) -> None:
        if not len(self.orders) == len(self.amplitudes_arcsec) == len(self.phases_deg):
            raise ArgumentError("orders, amplitudes_arcsec and phases_deg must be equally long")

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        lines = tuple(zip(self.orders, self.amplitudes_arcsec, self.phases_deg, strict=True))
        return line_sum(self.angle(signals, self.mount_sign), lines)

    @staticmethod
    def angle(signals: Signals, mount_sign: float) -> Array:
        """Angle on the reference artefact, radians."""
        if signals.mount is None:
            return signals.theta
        return np.asarray(signals.theta + mount_sign * signals.mount)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        order = float(of.whole(1, 5))
        return cls((order,), (size,), (of.phase(),))

    @classmethod
    def alike(cls, other: Effect, around: JointPattern) -> Self | None:
        if not isinstance(other, MissingOrder):
            return None
        order = around.joint.output_order(other.shaft, other.order)
        return cls((order,), (other.amplitude_arcsec,), (other.phase_deg,))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        mount = regression.signals.mount
        if mount is None or np.ptp(mount) == 0.0:
            return None
        # Which way the mount counts is one convention for all lines of the reference.
        signs = {t.shape["mount_sign"] for t in regression.terms if t.cause == cls.kind}
        shapes = [
            {"order": float(h), "mount_sign": sign}
            for h in REFERENCE_ORDERS
            for sign in (signs or (1.0, -1.0))
        ]
        # Low orders are likelier by far, as of any rotary part.
        return best_shape(
            cls, regression, shapes, [float(np.log(4.0 * s["order"])) for s in shapes]
        )

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        both = line_columns(ReferenceLines.angle(signals, shape["mount_sign"]), shape["order"])
        seen = both.any(axis=0)
        return both[:, seen] if seen.any() else both

    @staticmethod
    def _both(
        signals: Signals, shape: dict[str, Any], coefficients: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Cosine and sine, 0 for the one that vanishes at all these positions."""
        angle = ReferenceLines.angle(signals, shape["mount_sign"])
        seen = np.flatnonzero(line_columns(angle, shape["order"]).any(axis=0))
        pair, spread = np.zeros(2), np.zeros((2, 2))
        pair[seen] = coefficients
        spread[np.ix_(seen, seen)] = covariance
        return pair, spread

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        rows = [
            (t.shape["order"], *line_parameters(*cls._both(regression.signals, t.shape, c, v)))
            for t, c, v in terms
        ]
        signs = [t.shape["mount_sign"] for t, _, _ in terms]
        pairs = zip(rows, signs, strict=True)
        effects = [ReferenceLines((m,), (a,), (p,), sign) for (m, a, p, *_), sign in pairs]
        return line_quantities(rows) | {"mount_sign": quantity(signs)}, [*effects]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        mount = regression.signals.mount
        if mount is None:
            yield cls.blind("the mount of the reference was not recorded")
        elif np.ptp(mount) == 0.0:
            spot = cls.blind(
                "the reference was never turned on its mount: its error and the joint's are the "
                "same function of angle",
                MissingOrder,
            )
            yield replace(spot, measure=cls.measure)

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != MissingOrder.kind or regression.signals.mount is None:
            return None
        order = float(extension.shape["output_order"])
        if order <= REFERENCE_ORDERS[-1] and not is_gear_order(regression.belief, order):
            for spot in spots:
                if cls.kind in spot.causes:
                    return MissingOrder.also_from(cls, spot)
        return None
