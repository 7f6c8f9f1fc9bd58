"""A periodic line that the simulation lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ..estimation.extension import Extension
from ..estimation.lines import LEAST_ORDERS, LineBasis
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from ..runs.aliasing import may_pass
from .ambiguity import Ambiguity
from .drawing import Drawing
from .effect import Effect, Reported, Spots
from .scale_error import ScaleError
from .search import Array, Fitted, known_orders, line_parameters, shows_line
from .torsional_compliance import TorsionalCompliance

FREE_ANGLES = (
    "readings at jittered or free angles, or one more round with the artefact clamped "
    "off the grid (`ta.plan_mounts(...)` proposes them; about 2.14 deg for 36 positions)"
)

#: Orders up to which an alias is reported at least, whatever lines the joint is known for.
HIGHEST = 100.0

#: Orders closer than this share of one over the turns covered, that explain at least this
#: much of what the best one does, are hardly separated.
UNRESOLVED, ALIKE = 0.5, 0.9


@dataclass(frozen=True)
class MissingOrder(Effect):
    """A periodic line: ``C sin(k f θ + φ)`` of a shaft that turns f times.

    Parameters
    ----------
    shaft : str
    order : float
    amplitude_arcsec, phase_deg : float
    """

    shaft: str
    order: float
    amplitude_arcsec: float
    phase_deg: float = 0.0

    kind: ClassVar[str] = "missing_order"
    title: ClassVar[str] = "periodic error"
    size_name: ClassVar[str] = "amplitude_arcsec"
    sentence: ClassVar[str] = "A periodic error of one shaft that the simulation does not have."
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    measure: ClassVar[str] = FREE_ANGLES
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        TorsionalCompliance: "a second load, or the base turned by 180 deg",
        ScaleError: "more than one turn in a run",
    }
    located: ClassVar[bool] = True
    is_separate: ClassVar[bool] = True
    of_motion: ClassVar[bool] = True
    is_doubted: ClassVar[bool] = False

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        order = around.joint.output_order(self.shaft, self.order)
        return line_sum(signals.theta, ((order, self.amplitude_arcsec, self.phase_deg),))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        shaft, order, _ = of.free_line()
        return cls(shaft, order, size, of.phase())

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        gains = regression.line_gains()
        lines = regression.lines
        expected = int(lines.plausible.sum())
        penalties = 2.0 * np.log(np.where(lines.plausible, 2 * expected, 2 * gains.size))
        gains = np.where(shows_line(regression.signals, lines.orders), gains, 0.0)
        # At equal steps higher orders are the same numbers as low ones, but for the error by
        # which the angles miss the steps: what distinguishes them there is the noise.
        # At few places lower orders make up any pattern, and what they leave is no noise: a higher
        # one explains more than one of these that may pass for it there, and than it would by
        # chance if each place were one reading, or is there for what is known of the gear.
        signals = regression.signals
        positions = signals.places if signals.grid is None else signals.grid.positions
        hidden = 2.0 * lines.orders > positions
        if signals.grid is None and hidden.any():
            passing = regression.cache.of_motion("lower", 0, lambda: _lower_alike(signals, lines))
            lower = np.where(passing, gains[: passing.shape[1]], 0.0).max(axis=1, initial=0.0)
            chance = penalties + 2.0 * np.log(signals.places)
            hidden &= gains < lower + chance * len(signals) / signals.places
            known = np.round(known_orders(regression.belief), 9)
            hidden &= np.isin(np.round(lines.orders, 9), known, invert=True)
        gains = np.where(hidden, 0.0, gains)
        best = int(np.argmax(gains - penalties))
        if gains[best] <= 0.0:
            return None
        # Over a part of a turn neighbouring orders are hardly separated: a fast shaft's
        # own order is then the likelier one.
        away = np.abs(lines.orders - lines.orders[best]) * regression.signals.run_turns().max()
        alike = np.flatnonzero((away < UNRESOLVED) & (gains > ALIKE * gains[best]))
        named = [regression.around.joint.name_order(float(lines.orders[k])) for k in alike]
        own = [k for k, name in zip(alike, named, strict=True) if name and name[0] != "output"]
        if best not in own and own:
            best = int(max(own, key=lambda k: gains[k] - penalties[k]))
        order = float(lines.orders[best])
        others = [float(lines.orders[k]) for k in alike if k != best]
        return cls.at(regression, order, float(penalties[best] / 2.0), others)

    @classmethod
    def at(
        cls,
        regression: Regression,
        order: float,
        log_grid: float = 0.0,
        alike: Sequence[float] = (),
    ) -> Extension:
        """A line at one output order; ``log_grid`` of the search, none where it is declared."""
        return regression.propose(
            cls.kind,
            {"output_order": order, "alike": list(alike)},
            line_columns(regression.signals.theta, order),
            log_grid=log_grid,
            line=order,
        )

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        return line_columns(signals.theta, shape["output_order"])

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
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
        grid = regression.signals.grid
        if grid is not None:
            most = max(HIGHEST, float(regression.lines.orders.max()))
            aliases = [m for m in grid.aliases(output_order, 3) if m <= most]
            parameters |= {"aliases": quantity(aliases)} if aliases else {}
        if extension.shape["alike"]:
            parameters["hardly_told_from_output_orders"] = quantity(extension.shape["alike"])
        return parameters, [MissingOrder(shaft, order, amplitude, phase)]

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != cls.kind:
            return None
        order = float(extension.shape["output_order"])
        torque = regression.signals.torque
        grid = regression.signals.grid
        gear = [] if grid is None else known_orders(regression.belief)
        for spot in spots:
            # The lowest order is meant, but where one that the gear has looks the same.
            if spot.factor == "grid" and grid is not None:
                alike = [m for m in gear if m != order and grid.folded(m) == grid.folded(order)]
                if order == grid.folded(order) and not alike:
                    continue
                both = [*dict.fromkeys([*alike, *grid.aliases(order, 3)])]
                aliases = ", ".join(f"{m:g}" for m in both[:3])
                because = (
                    f"order {order:g} looks like {aliases} at these {grid.positions} positions; "
                    f"{spot.because}"
                )
                return replace(spot, because=because)
        if order == 1.0 and len(regression.belief.joint.shafts) > 1:
            for spot in spots:
                if spot.causes == (TorsionalCompliance.kind,) and (torque is None or torque.any()):
                    because = f"{spot.because}: order 1 may be gravity's"
                    return cls.also_from(TorsionalCompliance, replace(spot, because=because))
        return None

    @classmethod
    def also_from(cls, other: type[Effect], spot: Ambiguity) -> Ambiguity:
        """That ``other`` may make a line for the reason of ``spot``: a line it is in any case."""
        return replace(spot, causes=(cls.kind, other.kind), common=cls.kind)

    def to_lines(self) -> Sequence[tuple[str, float]]:
        return ((self.shaft, self.order),)


def _lower_alike(signals: Signals, lines: LineBasis) -> NDArray[np.bool_]:
    """Which lower orders, that the places resolve, may pass for each order at these."""
    turns = np.mod(signals.theta / (2.0 * np.pi), 1.0)
    orders = np.round(lines.orders).astype(int)[:, None]
    low = np.arange(1, min(signals.places // 2, LEAST_ORDERS) + 1)
    apart = may_pass(turns, int(orders.max()) + low.size)
    return np.asarray((apart[np.abs(orders - low)] | apart[orders + low]) & (low < orders))
