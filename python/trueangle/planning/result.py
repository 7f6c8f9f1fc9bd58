"""Plans of arcs, of mounts and without a reference: their tables, words and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult, finite_or_none, plain_value


@dataclass(frozen=True)
class ArcPlan(PlainResult):
    """Places on an arc and readings at each of them.

    Attributes
    ----------
    start_deg, stop_deg : float
    orders : tuple of float
        Output orders, fitted together with a zero of each run.
    places_deg : tuple of float
        Increasing; the same in every run.
    counts : tuple of int
        Readings at each place in one run; half of them from either side with
        ``both_directions``.
    runs : int
    both_directions : bool
    d_efficiency : float
        ``(det M / det M^*)^(1/p)``, M the information of these readings, M* the most that
        as many can have.
    efficiency_of_even_spacing : float
        The same for as many places spread evenly, both ends among them.
    noise_factors : dict of order to float
        How many times a coefficient scatters more than one of as many readings over whole turns.
    even_noise_factors : dict of order to float
        The same for even spacing.
    uncertainty_arcsec : float or None
        Expanded uncertainty (k = 2) of the curve, with its zero, at the worst place of the arc;
        None without the noise of a reading.
    notes : tuple of str
    """

    start_deg: float
    stop_deg: float
    orders: tuple[float, ...]
    places_deg: tuple[float, ...]
    counts: tuple[int, ...]
    runs: int
    both_directions: bool
    d_efficiency: float
    efficiency_of_even_spacing: float
    noise_factors: dict[float, float]
    even_noise_factors: dict[float, float]
    uncertainty_arcsec: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def readings(self) -> int:
        """All readings of all runs."""
        return self.runs * sum(self.counts)

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor."""
        return max(self.noise_factors.values())

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON for an arc."""
        return plain_arc_plan(self, "arc")

    def summary(self) -> str:
        """The plan as text: a table to follow at the rig."""
        each = f": {sum(self.counts)} in each of {self.runs} runs" if self.runs > 1 else ""
        way = ", half from either side" if self.both_directions else ""
        arc = f"{self.start_deg:g} to {self.stop_deg:g} deg"
        lines = [f"{self.readings} readings over {arc}{each}{way}"]
        lines += [f"  note: {note}" for note in self.notes]
        if self.uncertainty_arcsec is not None:
            size = f"{self.uncertainty_arcsec:.3g} arcsec"
            lines.append(f"  uncertainty (k = 2)    {size} at the worst place")
        lines += [
            *place_table(self.places_deg, self.counts),
            f"  D-efficiency           {self.d_efficiency:.3f} of the best possible",
            f"  of even spacing        {self.efficiency_of_even_spacing:.3f}",
            f"  orders to fit          {','.join(f'{k:g}' for k in self.orders)}",
            _FACTOR,
            "  order  these places  even spacing",
        ]
        for order, factor in self.noise_factors.items():
            even = self.even_noise_factors[order]
            lines.append(f"  {order:5g}  {_factor(factor):>12}  {_factor(even):>12}")
        return laid_out(lines)

    def _brief(self) -> str:
        return (
            f"{self.readings} readings at {counted(self.places_deg, 'place')}, "
            f"worst factor {self.worst_noise_factor:.3g}"
        )


#: What a noise factor compares with.
_FACTOR = "  standard error of each order; 1 (ideal): as many readings over whole turns"


def _worst(plan: CalibrationPlan | SelfPlan) -> str:
    """The largest noise factor, after the orders that no reading shows."""
    lost = ", ".join(f"{k:g}" for k, f in plan.noise_factors.items() if not math.isfinite(f))
    size = f"standard error {plan.worst_noise_factor:.2f} times the ideal"
    return "  worst order            " + f"not determined: {lost}; others: " * bool(lost) + size


def _factor(factor: float) -> str:
    """A noise factor, or that the places do not show the order."""
    return f"{factor:.3g}" if math.isfinite(factor) else "undetermined"


@dataclass(frozen=True)
class CalibrationPlan(PlainResult):
    """Where to read, and how well each order will be known.

    Attributes
    ----------
    kind : str
        ``"mounts"``, ``"encoder"`` or ``"tilts"``.
    positions : int
        Positions per mount (or in all, for a free reference encoder).
    mount_offsets_deg : tuple of float
        Offset of the joint from the first mount's positions, per mount or tilt.
    facet_shifts : tuple of int
        By how many facets to turn the artefact at each mount, so that its own errors
        can be separated from the joint's.
    facet_noise_factor : float
        Worst factor of an order of the joint when the artefact's errors are fitted too,
        relative to one mount with a perfect artefact; infinite where they stay mixed.
    noise_factors : dict of order to float
        Factor of each wanted order; infinite for an order that no zero-free reading at
        these positions shows.
    tolerance_deg : float
        Every offset may be off by this much with all factors below 2; it must be known
        to about 0.01 degree (2 degrees of phase at order 202).
    readings : int or None
        Readings that reach the wanted standard error, in whole rounds.
    notes : tuple of str
    """

    kind: str
    positions: int
    mount_offsets_deg: tuple[float, ...]
    facet_shifts: tuple[int, ...]
    facet_noise_factor: float
    noise_factors: dict[float, float]
    tolerance_deg: float
    readings: int | None = None
    notes: tuple[str, ...] = ()

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor of the orders that are identifiable."""
        return max((f for f in self.noise_factors.values() if math.isfinite(f)), default=math.inf)

    @property
    def invisible_orders(self) -> tuple[float, ...]:
        """Wanted orders that fold onto the constant: every zero absorbs them."""
        return tuple(m for m, f in self.noise_factors.items() if not math.isfinite(f))

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON."""
        return {
            **plain_value(vars(self)),
            "worst_noise_factor": finite_or_none(self.worst_noise_factor),
            "invisible_orders": list(self.invisible_orders),
        }

    def summary(self) -> str:
        """The plan as text."""
        offsets = [f"{o:.4g}" for o in self.mount_offsets_deg]
        if self.kind == "encoder":
            lines = [
                f"{self.readings or self.positions} readings at {self.positions} jittered "
                f"positions of a free reference encoder, clamped at {', '.join(offsets)} deg"
            ]
        else:
            each = self.positions * len(offsets)
            rounds = "" if self.readings is None else f", {self.readings // each} times each"
            total = f"{self.readings or each} readings in all{rounds}"
            one = self.kind.removesuffix("s")
            lines = [f"{counted(offsets, one)} of {self.positions} positions: {total}"]
            for k, (at, turned) in enumerate(zip(offsets, self.facet_shifts, strict=True), 1):
                turn = f", turn the polygon by {counted(turned, 'face')}" if turned else ""
                lines.append(f"  {one} {k}: start at {at} deg{turn}")
            if self.tolerance_deg:
                start = f"start within +-{self.tolerance_deg:.2g} deg; note the angle to 0.01 deg"
                lines.append(f"  tolerance              {start}")
        lines += [f"  note: {note}" for note in self.notes]
        lines.append(_worst(self))
        if math.isfinite(self.facet_noise_factor):
            # The attribute is relative to one mount, the ideal to as many readings.
            fitted = math.sqrt(len(self.mount_offsets_deg)) * self.facet_noise_factor
            lines.append(f"  polygon not calibrated standard error {fitted:.2f} times the ideal")
        lines += [_FACTOR, *factor_table(self.noise_factors)]
        return laid_out(lines)

    def _brief(self) -> str:
        mounts = counted(self.mount_offsets_deg, "mount")
        return f"{self.positions} positions, {mounts}, worst factor {self.worst_noise_factor:.3g}"


def place_table(places_deg: Sequence[float], counts: Sequence[int]) -> list[str]:
    """Readings at each place, a line a place under their heads."""
    rows = zip(places_deg, counts, strict=True)
    return ["  place/deg  readings", *(f"  {place:9.3f}  {count:8d}" for place, count in rows)]


def factor_table(factors: dict[float, float]) -> list[str]:
    """Noise factors by order, six on a line."""
    entries = [f"{m:>5g} {f:5.2f}" for m, f in factors.items()]
    return ["  " + "  ".join(entries[i : i + 6]) for i in range(0, len(entries), 6)]


def plain_arc_plan(plan: Any, kind: str) -> dict[str, Any]:
    """The JSON object of a plan of readings at places: lists, and orders as the keys of objects."""
    return {"kind": kind, **plain_value(vars(plan)), "readings": plan.readings}


@dataclass(frozen=True)
class SelfPlan(PlainResult):
    """What to record, and how well each order will be known.

    Attributes
    ----------
    method : str
    orders : tuple of float
    noise_factors : dict of order to float
        Standard error over that of all readings with the true angle known; infinite where
        blind.
    angles_deg : tuple of float
        Best angles of heads or shifts; empty for the others.
    given : dict
        Angles that were given, their ``worst_noise_factor``, ``worse_by`` and
        ``blind_orders``.
    speed_ratio : float or None
        Start over end speed.
    speed_ratio_factors : dict of ratio to float
    turns, readings, seconds : float or int or None
    knots_per_turn : float or None
        At most, in the slowest part.
    notes : tuple of str
    """

    method: str
    orders: tuple[float, ...]
    noise_factors: dict[float, float]
    angles_deg: tuple[float, ...] = ()
    given: dict[str, object] = field(default_factory=dict)
    speed_ratio: float | None = None
    speed_ratio_factors: dict[float, float] = field(default_factory=dict)
    turns: float | None = None
    readings: int | None = None
    seconds: float | None = None
    knots_per_turn: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor of the orders that are identifiable."""
        return max((f for f in self.noise_factors.values() if math.isfinite(f)), default=math.inf)

    @property
    def blind_orders(self) -> tuple[float, ...]:
        """Wanted orders that are not identifiable."""
        return tuple(k for k, f in self.noise_factors.items() if not math.isfinite(f))

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON."""
        return {
            **plain_value(vars(self)),
            "worst_noise_factor": finite_or_none(self.worst_noise_factor),
            "blind_orders": list(self.blind_orders),
        }

    def summary(self) -> str:
        """The plan as text."""
        parts = {
            f"{self.method} at {{}} deg": ", ".join(f"{a:g}" for a in self.angles_deg),
            "coast until {:g} times slower": self.speed_ratio,
            f"record {{:.3g}} turn{'s' * (self.turns != 1.0)}": self.turns,
            "{} readings": self.readings,
            "{:.3g} s": self.seconds,
        }
        steps = ", ".join(text.format(value) for text, value in parts.items() if value)
        lines = [f"{self.method}, without a reference: {steps}"]
        lines += [f"  note: {note}" for note in self.notes]
        if self.speed_ratio is not None:
            table = ", ".join(f"{f:.2g} at {r:g}" for r, f in self.speed_ratio_factors.items())
            lines.append(f"  error by speed ratio   times the ideal: {table}")
            knots = f"at most {self.knots_per_turn:g} knots per turn, in the slowest part"
            lines.append(f"  spline of the motion   {knots}")
        lines.append(_worst(self))
        if self.given:
            given: Any = self.given
            names = ", ".join(f"{k:g}" for k in given["blind_orders"])
            factor = f"{given['worst_noise_factor']:.2f}"
            worse = f"{given['worse_by']:.2f} times the best"
            lines.append(
                f"  the given angles       do not show {names}; standard errors {factor}"
                if names
                else f"  the given angles       standard error {factor}, {worse}"
            )
        lines += [_FACTOR, *factor_table(self.noise_factors)]
        return laid_out(lines)

    def _brief(self) -> str:
        orders = counted(self.orders, "order")
        return f"{self.method}, {orders}, worst factor {self.worst_noise_factor:.3g}"
