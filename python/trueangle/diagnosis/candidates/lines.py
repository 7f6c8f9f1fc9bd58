"""Missing orders, sidebands, errors of the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import Surroundings, line_columns
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.lines import MissingOrder, ReferenceLines, Sidebands
from .blocks import known_orders
from .candidate import Array, Candidate, Parameters, line_parameters, quantity

__all__ = ["MissingOrderCandidate", "ReferenceCandidate", "SidebandsCandidate"]

#: Orders of the reference that are searched.
REFERENCE_ORDERS = range(1, 37)

#: Periods of the modulation that a run must cover for sidebands to be looked for.
RESOLVED = 0.75

#: Orders closer than this share of one over the turns covered, that explain at least this
#: much of what the best one does, are hardly told apart.
UNRESOLVED, ALIKE = 0.5, 0.9


class MissingOrderCandidate(Candidate):
    """Two regressors: the line of one order, every order searched."""

    cause: ClassVar[str] = "missing_order"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        gains = regression.line_gains()
        lines = regression.lines
        expected = int(lines.plausible.sum())
        prices = 2.0 * np.log(np.where(lines.plausible, 2 * expected, 2 * gains.size))
        best = int(np.argmax(gains - prices))
        if gains[best] <= 0.0:
            return None
        # Over a part of a turn neighbouring orders are hardly told apart: a fast shaft's
        # own order is then the likelier one.
        away = np.abs(lines.orders - lines.orders[best]) * regression.signals.run_turns().max()
        alike = np.flatnonzero((away < UNRESOLVED) & (gains > ALIKE * gains[best]))
        named = [regression.around.joint.name_order(float(lines.orders[k])) for k in alike]
        own = [k for k, name in zip(alike, named, strict=True) if name and name[0] != "output"]
        if best not in own and own:
            best = int(max(own, key=lambda k: gains[k] - prices[k]))
        order = float(lines.orders[best])
        return regression.propose(
            self.cause,
            {
                "output_order": order,
                "alike": [float(lines.orders[k]) for k in alike if k != best],
            },
            line_columns(regression.signals.theta, order),
            log_grid=float(prices[best] / 2.0),
            line=order,
        )

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return line_columns(signals.theta, shape["output_order"])

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension, coefficients, covariance = terms[0]
        output_order = extension.shape["output_order"]
        joint = regression.around.joint
        shaft, order = joint.name_order(output_order) or ("output", output_order)
        amplitude, phase, std, phase_std = line_parameters(coefficients, covariance)
        parameters = {
            "shaft": quantity(shaft),
            "order": quantity(order),
            "output_order": quantity(output_order),
            "amplitude_arcsec": quantity(amplitude, std),
            "phase_deg": quantity(phase, phase_std),
            "explanations": quantity(joint.explanations(output_order)),
        }
        if extension.shape["alike"]:
            parameters["hardly_told_from_output_orders"] = quantity(extension.shape["alike"])
        return parameters, [MissingOrder(shaft, order, amplitude, phase)]


class SidebandsCandidate(Candidate):
    """Lines beside a gear order: its amplitude or its phase modulated, or both freely."""

    cause: ClassVar[str] = "sidebands"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        joint = regression.around.joint
        carriers = []
        for m in known_orders(regression):
            named = joint.name_order(m)
            if named is not None and named[0] != "output":
                carriers.append(m)
        present = {float(m) for m in regression.around.pattern.orders}
        travel = regression.signals.run_turns().max()
        shapes: list[dict[str, Any]] = []
        # Over less than that the pair and the line between them are hardly told apart.
        offsets = [k for k in (1, 2) if k * travel > RESOLVED]
        for m in carriers:
            for k in offsets:
                if m in present:
                    shapes += [{"carrier": m, "offset": k, "form": f} for f in ("AM", "PM")]
                shapes.append({"carrier": m, "offset": k, "form": "free"})
        log_grid = float(np.log(max(len(shapes), 1)))
        return self.best(regression, shapes, [log_grid] * len(shapes))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        theta, carrier, k = signals.theta, shape["carrier"], shape["offset"]
        if shape["form"] == "free":
            return np.hstack([line_columns(theta, carrier - k), line_columns(theta, carrier + k)])
        a, b = self._carrier(around, carrier)
        if shape["form"] == "PM":
            a, b = b, -a
        x = carrier * theta
        line = a * np.cos(x) + b * np.sin(x)
        return np.asarray(line[:, None] * line_columns(theta, k))

    @staticmethod
    def _carrier(around: Surroundings, carrier: float) -> tuple[float, float]:
        pattern = around.pattern
        k = int(np.argmin(np.abs(pattern.orders - carrier)))
        return float(pattern.cosine[k]), float(pattern.sine[k])

    def _bands(
        self, around: Surroundings, extension: Extension, coefficients: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Cosine and sine of the lower and upper line and their covariance."""
        shape = extension.shape
        if shape["form"] == "free":
            return coefficients, covariance
        a, b = self._carrier(around, shape["carrier"])
        if shape["form"] == "PM":
            a, b = b, -a
        # (a cos x + b sin x) cos y and sin y in cosines and sines of x - y and x + y.
        map_ = 0.5 * np.array([[a, -b], [b, a], [a, b], [b, -a]])
        return map_ @ coefficients, map_ @ covariance @ map_.T

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        effects: list[Effect] = []
        rows = []
        for extension, coefficients, covariance in terms:
            pair, spread = self._bands(regression.around, extension, coefficients, covariance)
            k, carrier = extension.shape["offset"], extension.shape["carrier"]
            for j, offset in ((0, -k), (2, k)):
                line = line_parameters(pair[j : j + 2], spread[j : j + 2, j : j + 2])
                rows.append((carrier, offset, *line))
            lower, upper = rows[-2:]
            effects.append(Sidebands(carrier, (-k, k), (lower[2], upper[2]), (lower[3], upper[3])))
        parameters = {
            "carrier": quantity(rows[0][0]),
            "amplitudes": quantity([row[2] for row in rows], [row[4] for row in rows]),
            "orders": quantity([row[0] + row[1] for row in rows]),
            "phases_deg": quantity([row[3] for row in rows], [row[5] for row in rows]),
        }
        if any(row[0] != rows[0][0] for row in rows):
            parameters["carriers"] = quantity([row[0] for row in rows])
        return parameters, effects


class ReferenceCandidate(Candidate):
    """Two regressors: a line in the angle of the reference artefact."""

    cause: ClassVar[str] = "reference_error"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        mount = regression.signals.mount
        if mount is None or np.ptp(mount) == 0.0:
            return None
        shapes = [
            {"order": float(h), "mount_sign": sign}
            for h in REFERENCE_ORDERS
            for sign in (1.0, -1.0)
        ]
        # Low orders are likelier by far, as of any rotary part.
        return self.best(regression, shapes, [float(np.log(4.0 * s["order"])) for s in shapes])

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return line_columns(ReferenceLines.angle(signals, shape["mount_sign"]), shape["order"])

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        rows = [
            (t.shape["order"], *line_parameters(c, v), t.shape["mount_sign"]) for t, c, v in terms
        ]
        parameters = {
            "orders": quantity([row[0] for row in rows]),
            "amplitudes": quantity([row[1] for row in rows], [row[3] for row in rows]),
            "phases_deg": quantity([row[2] for row in rows], [row[4] for row in rows]),
            "mount_sign": quantity([row[5] for row in rows]),
        }
        effects: list[Effect] = [
            ReferenceLines((row[0],), (row[1],), (row[2],), row[5]) for row in rows
        ]
        return parameters, effects
