"""Lines next to a gear order: its amplitude or phase is modulated."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from .missing_order import FREE_ANGLES, MissingOrder
from .search import Array, Fitted, known_orders, line_parameters, line_quantities
from .shapes import best_shape

#: Periods of the modulation that a run must cover for sidebands to be looked for.
RESOLVED = 0.75


#: What distinguishes a sideband from a line of another shaft at the same order.
TURNED = (
    "clamp the output turned against the gear and repeat: the phase of a sideband turns with it, "
    "that of a shaft's own line does not"
)


@dataclass(frozen=True)
class Sidebands(Effect):
    """Lines next to a gear order: its amplitude or phase is modulated once or twice a turn.

    Parameters
    ----------
    carrier : float
        Output order of the modulated line.
    offsets, amplitudes_arcsec, phases_deg : list of float
        Lines at ``carrier + offset``.
    """

    carrier: float
    offsets: tuple[float, ...]
    amplitudes_arcsec: tuple[float, ...]
    phases_deg: tuple[float, ...]

    kind: ClassVar[str] = "sidebands"
    size_name: ClassVar[str] = "amplitudes_arcsec"
    sentence: ClassVar[str] = (
        "Eccentricity or tilt at the output changes the depth of mesh as it turns: a gear line "
        "is modulated and has neighbours one or two orders away."
    )
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    measure: ClassVar[str] = FREE_ANGLES
    confused_with: ClassVar[Mapping[type[Effect], str]] = {MissingOrder: FREE_ANGLES}
    located: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not len(self.offsets) == len(self.amplitudes_arcsec) == len(self.phases_deg):
            raise ArgumentError("offsets, amplitudes_arcsec and phases_deg must be equally long")

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        lines = zip(self.offsets, self.amplitudes_arcsec, self.phases_deg, strict=True)
        return line_sum(signals.theta, tuple((self.carrier + o, a, p) for o, a, p in lines))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        carrier = of.carrier()
        if carrier is None:
            return None
        return cls(carrier, (-1.0, 1.0), (size, size), (of.phase(), of.phase()))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        joint = regression.around.joint
        carriers = []
        for m in known_orders(regression.around):
            named = joint.name_order(m)
            if named is not None and named[0] != "output":
                carriers.append(m)
        present = {float(m) for m in regression.around.pattern.orders}
        travel = regression.signals.run_turns().max()
        known = set(known_orders(regression.around))
        shapes: list[dict[str, Any]] = []
        # Over less than that the pair and the line between them are hardly separated.
        offsets = [k for k in (1, 2) if k * travel > RESOLVED]
        grid = regression.signals.grid
        for m in carriers:
            for k in offsets:
                if grid is not None and 2.0 * (m + k) > grid.positions:
                    continue  # the same numbers as low orders
                forms = ["free"]
                if not {m - k, m + k} & known:
                    forms = ["AM", "PM", "free"] if m in present else ["free"]
                # A line of another shaft at the same order, where it is known, explains the
                # sideband: only the other one is detected.
                elif {m - k, m + k} & present:
                    forms = [f for f, x in (("lower", m - k), ("upper", m + k)) if x not in known]
                shapes += [{"carrier": m, "offset": k, "form": form} for form in forms]
        log_grid = float(np.log(max(len(shapes), 1)))
        while shapes:
            best = best_shape(cls, regression, shapes, [log_grid] * len(shapes))
            if best is None or not _is_one_line(best):
                return best
            shapes.remove(best.shape)
        return None

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        theta, carrier, k = signals.theta, shape["carrier"], shape["offset"]
        if shape["form"] in _SEEN:
            lines = [line_columns(theta, carrier + s * k) for s in _SEEN[shape["form"]]]
            return np.hstack(lines)
        a, b = cls._carrier(around, carrier)
        if shape["form"] == "PM":
            a, b = b, -a
        x = carrier * theta
        line = a * np.cos(x) + b * np.sin(x)
        return np.asarray(line[:, None] * line_columns(theta, k))

    @classmethod
    def bends(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        """Modulation that is deep, or no sine, has further pairs and changes the carrier."""
        columns = []
        for term, _ in terms:
            carrier, k = term.shape["carrier"], term.shape["offset"]
            for order in carrier + k * np.array([-3.0, -2.0, 0.0, 2.0, 3.0]):
                if order > 0.0:
                    columns.append(line_columns(signals.theta, float(order)))
        return np.hstack(columns)

    @staticmethod
    def _carrier(around: JointPattern, carrier: float) -> tuple[float, float]:
        pattern = around.pattern
        k = int(np.argmin(np.abs(pattern.orders - carrier)))
        return float(pattern.cosine[k]), float(pattern.sine[k])

    @classmethod
    def _bands(
        cls, around: JointPattern, extension: Extension, coefficients: Array, covariance: Array
    ) -> tuple[Array, Array]:
        """Cosine and sine of the lines that are detected and their covariance."""
        shape = extension.shape
        if shape["form"] in _SEEN:
            return coefficients, covariance
        a, b = cls._carrier(around, shape["carrier"])
        if shape["form"] == "PM":
            a, b = b, -a
        # (a cos x + b sin x) cos y and sin y in cosines and sines of x - y and x + y.
        map_ = 0.5 * np.array([[a, b], [b, -a], [a, -b], [b, a]])
        return map_ @ coefficients, map_ @ covariance @ map_.T

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        effects: list[Effect] = []
        rows = []
        for extension, coefficients, covariance in terms:
            pair, spread = cls._bands(regression.around, extension, coefficients, covariance)
            k, carrier = extension.shape["offset"], extension.shape["carrier"]
            signs = _SEEN.get(extension.shape["form"], _SEEN["free"])
            for j, sign in zip((0, 2), signs, strict=False):
                line = line_parameters(pair[j : j + 2], spread[j : j + 2, j : j + 2])
                rows.append((carrier, sign * k, *line))
            own = rows[-len(signs) :]
            _, seen, sizes, phases, *_ = zip(*own, strict=True)
            effects.append(Sidebands(carrier, seen, sizes, phases))
        parameters = {
            "carrier": quantity(rows[0][0]),
            **line_quantities((carrier + k, *line) for carrier, k, *line in rows),
        }
        if any(row[0] != rows[0][0] for row in rows):
            parameters["carriers"] = quantity([row[0] for row in rows])
        return parameters, effects

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != cls.kind:
            return None
        carrier, k = extension.shape["carrier"], extension.shape["offset"]
        shared = [f"order {m:g} is {name}" for m, name in _shared(regression, carrier, k)]
        if not shared:
            return None
        because = f"{', '.join(shared)} as well as a sideband of order {carrier:g}"
        causes = (cls.kind, MissingOrder.kind)
        return Ambiguity(causes, because, TURNED, factor="angle", common=cls.kind)

    def to_lines(self) -> Sequence[tuple[str, float]]:
        return tuple(("output", self.carrier + offset) for offset in self.offsets)


#: Sides of the carrier on which a form has lines of their own.
_SEEN = {"free": (-1, 1), "lower": (-1,), "upper": (1,)}


def _shared(regression: Regression, carrier: float, offset: float) -> Iterator[tuple[float, str]]:
    """Sidebands at orders that another shaft is known to have, with its name."""
    for order in (carrier - offset, carrier + offset):
        named = regression.belief.joint.name_order(order)
        if named is not None and order in known_orders(regression.belief):
            yield order, f"{named[0].replace('_', ' ')} order {named[1]}"


def _is_one_line(extension: Extension) -> bool:
    """A free pair with one line only: that is a line, no modulation."""
    if extension.shape["form"] != "free":
        return False
    sizes = np.hypot(extension.coefficients[0::2], extension.coefficients[1::2])
    # Share of the larger line below which the other of a pair is none: a modulation makes both.
    return bool(sizes.min() < 0.1 * sizes.max())
