"""A spring that stiffens with torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import Surroundings, line_columns
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.load import StiffeningCompliance
from .candidate import Array, Candidate, Parameters, quantity

__all__ = ["StiffeningCandidate"]

#: Knees searched, in shares of the largest torque.
KNEES = (0.2, 0.35, 0.5, 0.65, 0.8)


class StiffeningCandidate(Candidate):
    """Torque and its cube, or torque and torque beyond a knee.

    Where the torque column holds the load of an arm and is constant in each run, the
    moment is load times the sine of the angle from the vertical, which is searched.
    """

    cause: ClassVar[str] = "stiffening_compliance"
    family: ClassVar[tuple[str, ...]] = ("torsional_compliance",)
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        torque = regression.signals.torque
        if torque is None or not torque.any() or regression.has(self.cause):
            return None
        shapes: list[dict[str, Any]] = []
        if np.unique(np.round(torque / np.abs(torque).max(), 3)).size >= 3:
            shapes += [{"power": 3, "gravity_deg": None}]
            shapes += [{"knee_share": k, "gravity_deg": None} for k in KNEES]
        if self._constant_in_runs(regression.signals):
            gravity = self._gravity(regression)
            shapes += [{"power": 3, "gravity_deg": gravity}]
            shapes += [{"knee_share": k, "gravity_deg": gravity} for k in KNEES]
        for shape in shapes:
            if "knee_share" in shape:
                moment = StiffeningCompliance.moment(regression.signals, shape["gravity_deg"])
                shape["knee_Nm"] = float(shape.pop("knee_share") * np.abs(moment).max())
        extra = [0 if shape["gravity_deg"] is None else 1 for shape in shapes]
        return self.best(regression, shapes, [float(np.log(2.0))] * len(shapes), extra)

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

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        moment = StiffeningCompliance.moment(signals, shape["gravity_deg"])
        if "power" in shape:
            second = moment**3
        else:
            second = StiffeningCompliance.beyond(moment, shape["knee_Nm"])
        return np.column_stack([moment, second])

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension, coefficients, covariance = terms[0]
        std = np.sqrt(np.diag(covariance))
        shape = extension.shape
        parameters: Parameters = {"arcsec_per_Nm": quantity(coefficients[0], std[0])}
        gravity = shape["gravity_deg"]
        if "power" in shape:
            parameters["arcsec_per_Nm3"] = quantity(coefficients[1], std[1])
            effect = StiffeningCompliance(
                float(coefficients[0]), float(coefficients[1]), gravity_deg=gravity
            )
        else:
            parameters["beyond_knee_arcsec_per_Nm"] = quantity(coefficients[1], std[1])
            parameters["knee_Nm"] = quantity(shape["knee_Nm"])
            effect = StiffeningCompliance(
                float(coefficients[0]), 0.0, float(coefficients[1]), shape["knee_Nm"], gravity
            )
        if gravity is not None:
            parameters["gravity_deg"] = quantity(gravity)
        return parameters, [effect]
