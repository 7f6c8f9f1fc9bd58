"""A spring that stiffens with torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.linear import linear_residual
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.load import StiffeningComplianceTerm
from ..support.angles import from_arcsec
from ..support.arrays import distinct
from .ambiguity import OWN_POWER, Ambiguity, share_left
from .drawing import Drawing
from .effect import Effect, Reported
from .search import Array, Fitted, golden_maximum, tangent_covariance
from .shapes import best_shape
from .torsional_compliance import TorsionalCompliance, torque_of, unloaded

#: Knees searched, in shares of the largest torque.
KNEES = (0.2, 0.35, 0.5, 0.65, 0.8)

#: A knee and the slopes on both sides of it fit this many loads exactly, wherever they are: more
#: are needed to detect it.
KNEE_PARAMETERS = 3


@dataclass(frozen=True)
class StiffeningCompliance(Effect):
    """A spring that stiffens: ``ε = c₁τ + c₃τ³ + c_k h(τ)``.

    h is the torque beyond a knee, ``h = sign(τ) max(|τ| - τ_k, 0)``
    (the catalogue's K1, K2).

    Parameters
    ----------
    arcsec_per_Nm, arcsec_per_Nm3 : float
        c_1 and c_3.
    beyond_knee_arcsec_per_Nm, knee_Nm : float
        c_k and the knee.
    gravity_deg : float or NaN
        Where finite, the moment is ``τ sin(θ - θ_g)`` of the load in
        the torque column.
    """

    arcsec_per_Nm: float = 0.0
    arcsec_per_Nm3: float = 0.0
    beyond_knee_arcsec_per_Nm: float = 0.0
    knee_Nm: float = 0.0
    gravity_deg: float | None = None

    kind: ClassVar[str] = StiffeningComplianceTerm.kind
    size_name: ClassVar[str] = "arcsec_per_Nm3"
    sentence: ClassVar[str] = (
        "The gear stiffens under torque, as K1 and K2 of its catalogue state. The wind-up grows "
        "less than proportionally; under gravity this gives orders 1 and 3."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    form_of: ClassVar[tuple[str, ...]] = ("load", "load_sign")
    of_motion: ClassVar[bool] = True
    measure: ClassVar[str] = "repeat the runs at three or more loads of both signs"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        TorsionalCompliance: "three loads or more, of both signs",
    }
    contains: ClassVar[tuple[type[Effect], ...]] = (TorsionalCompliance,)
    acts_on_runs: ClassVar[bool] = True
    located: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        torque = self.moment(signals, self.gravity_deg)
        return np.asarray(
            self.arcsec_per_Nm * torque
            + self.arcsec_per_Nm3 * torque**3
            + self.beyond_knee_arcsec_per_Nm * self.beyond(torque, self.knee_Nm)
        )

    @staticmethod
    def moment(signals: Signals, gravity_deg: float | None) -> Array:
        """The torque itself, or the moment of the load it states."""
        torque = torque_of(signals)
        if gravity_deg is None:
            return torque
        return np.asarray(torque * np.sin(signals.theta - np.radians(gravity_deg)))

    @staticmethod
    def beyond(torque: Array, knee: float) -> Array:
        """Torque beyond a knee, with its sign."""
        return np.asarray(np.sign(torque) * np.maximum(np.abs(torque) - knee, 0.0))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        # At the largest load the cubic part is a quarter of the linear part.
        largest = float(np.abs(torque_of(of.signals)).max())
        return cls(4.0 * size * largest**2, -size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        torque = regression.signals.torque
        if torque is None or not torque.any() or regression.has(cls.kind):
            return None
        loads = np.round(torque / np.abs(torque).max(), 3)
        shapes: list[dict[str, Any]] = []
        if distinct(loads).size >= 3:
            shapes += [{"power": 3, "gravity_deg": None}]
        if distinct(np.abs(loads[loads != 0.0])).size > KNEE_PARAMETERS:
            shapes += cls._knees(regression.signals, None)
        if cls._constant_in_runs(regression.signals):
            gravity = cls._gravity(regression)
            shapes += [
                {"power": 3, "gravity_deg": gravity},
                *cls._knees(regression.signals, gravity),
            ]
        extra = [("knee_Nm" in shape) + (shape["gravity_deg"] is not None) for shape in shapes]
        log_grid = float(np.log(2.0))
        found = best_shape(cls, regression, shapes, [log_grid] * len(shapes), extra)
        if found is None or "knee_Nm" not in found.shape:
            return found
        return cls._refined(found, regression, log_grid)

    @staticmethod
    def _knees(signals: Signals, gravity: float | None) -> list[dict[str, Any]]:
        most = float(np.abs(StiffeningCompliance.moment(signals, gravity)).max())
        return [{"knee_Nm": share * most, "gravity_deg": gravity} for share in KNEES]

    @classmethod
    def _refined(cls, found: Extension, regression: Regression, log_grid: float) -> Extension:
        """The same form with its knee where the readings have it, between those searched."""
        if regression.is_dominated(found.deviance, found.parameters, log_grid):
            return found
        signals, shape = regression.signals, found.shape
        moment = StiffeningCompliance.moment(signals, shape["gravity_deg"])
        step = (KNEES[1] - KNEES[0]) * float(np.abs(moment).max())

        def gain(knee: float) -> float:
            return regression.gain(np.column_stack([moment, cls.beyond(moment, knee)]))[0]

        knee, _ = golden_maximum(gain, shape["knee_Nm"] - step, shape["knee_Nm"] + step)
        shape = {**shape, "knee_Nm": knee}
        columns = cls.columns(signals, regression.around, shape)
        return regression.propose(cls.kind, shape, columns, found.parameters, log_grid)

    @staticmethod
    def _constant_in_runs(signals: Signals) -> bool:
        assert signals.torque is not None
        return all(
            np.ptp(signals.torque[start:stop]) < 1e-6 * np.abs(signals.torque).max()
            for start, stop in signals.run_bounds()
        )

    @staticmethod
    def _gravity(regression: Regression) -> float:
        """Angle of the vertical: where the moment's first order has no phase."""
        assert regression.signals.torque is not None
        columns = regression.signals.torque[:, None] * line_columns(regression.signals.theta, 1.0)
        _, (a, b) = regression.gain(columns)
        return float(-np.degrees(np.arctan2(a, b)))

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        moment = StiffeningCompliance.moment(signals, shape["gravity_deg"])
        if "power" in shape:
            second = moment**3
        else:
            second = StiffeningCompliance.beyond(moment, shape["knee_Nm"])
        return np.column_stack([moment, second])

    @classmethod
    def bends(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        columns = [super().bends(signals, terms)]
        for term, _ in terms:
            moment = cls.moment(signals, term.shape["gravity_deg"])
            top = float(np.abs(moment).max())
            knees = [cls.beyond(moment, share * top) for share in KNEES]
            columns.append(linear_residual(term.columns, np.column_stack([*knees, moment**3])))
        return np.hstack(columns)

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        (extension, (linear, second), covariance) = terms[0]
        shape = extension.shape
        gravity = shape["gravity_deg"]
        if "power" in shape:
            effect = StiffeningCompliance(float(linear), float(second), gravity_deg=gravity)
            names = ["arcsec_per_Nm", "arcsec_per_Nm3"]
        else:
            effect = StiffeningCompliance(
                float(linear), 0.0, float(second), shape["knee_Nm"], gravity
            )
            names = ["arcsec_per_Nm", "beyond_knee_arcsec_per_Nm", "knee_Nm"]
        names += [] if gravity is None else ["gravity_deg"]
        slopes = effect.slopes(regression.signals)
        if slopes.size:
            tangents = np.hstack([extension.columns, slopes])
            covariance = tangent_covariance(regression, terms, tangents)
        std = np.sqrt(np.diag(covariance))
        return {
            name: quantity(getattr(effect, name), error)
            for name, error in zip(names, std, strict=True)
        }, [effect]

    def slopes(self, signals: Signals) -> Array:
        """Derivatives of the signal by the knee and by the vertical, as far as it has them."""
        moment = self.moment(signals, self.gravity_deg)
        beyond = np.abs(moment) > self.knee_Nm
        columns = []
        if self.beyond_knee_arcsec_per_Nm:
            columns.append(-self.beyond_knee_arcsec_per_Nm * np.sign(moment) * beyond)
        if self.gravity_deg is not None:
            slope = self.arcsec_per_Nm + 3.0 * self.arcsec_per_Nm3 * moment**2
            slope += self.beyond_knee_arcsec_per_Nm * beyond
            turned = np.cos(signals.theta - np.radians(self.gravity_deg))
            columns.append(-np.radians(slope * torque_of(signals) * turned))
        return np.column_stack(columns) if columns else np.zeros((len(signals), 0))

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        because = unloaded(regression.signals)
        if because:
            yield cls.blind(because)
            return
        theta = regression.signals.theta
        torque = torque_of(regression.signals)[:, None]
        low = np.hstack([line_columns(theta, k) for k in (1, 2, 3)])
        moments = torque * line_columns(theta, 1)
        if (
            share_left(regression, torque**3, low, torque) < OWN_POWER
            and share_left(regression, moments * line_columns(theta, 2), low, torque, moments)
            < OWN_POWER
        ):
            yield cls.blind(
                "too few loads: the cube of the torque cannot be distinguished from "
                "the torque and the low orders"
            )

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        gravity = self.gravity_deg
        return (
            StiffeningComplianceTerm(
                from_arcsec(self.arcsec_per_Nm, period),
                from_arcsec(self.arcsec_per_Nm3, period),
                from_arcsec(self.beyond_knee_arcsec_per_Nm, period),
                self.knee_Nm,
                None if gravity is None else gravity * (period / 360.0),
            ),
        )
