"""The result of looking at a fleet, and its file: verdicts, common pattern, a prior."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple, TypeAlias

from ..fitting.prior import Prior
from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.files import FLEET, written_atomically
from ..support.layout import counted, laid_out
from ..support.plainresult import Angle, PlainResult, plain_row, pretty_json, result_picture
from .history import HistoryRow
from .tolerance import Tolerance

Verdict: TypeAlias = Literal["fine", "outlier", "recalibrate", "changed", "zero_moved"]

#: The most urgent first.
VERDICTS: Final[tuple[Verdict, ...]] = ("changed", "outlier", "recalibrate", "zero_moved", "fine")


class UnitOrder(NamedTuple):
    """One order of a unit.

    ``amplitude`` and ``std`` in the unit of the fleet's period; ``z`` is the distance from the
    other units' mean in standard deviations between units, of cosine and sine together.
    """

    order: float
    amplitude: Angle
    phase_deg: float
    std: Angle
    z: float


@dataclass(frozen=True)
class FleetUnit:
    """A unit against the fleet.

    Attributes
    ----------
    unit : str
    verdict : {"fine", "outlier", "recalibrate", "changed", "zero_moved"}
    because : str
        What deviates, and its likely cause; empty where nothing does.
    orders : tuple of UnitOrder
        Of the last calibration.
    peak_to_peak : float
        Of the pattern over a turn, in the unit of the fleet's period.
    left : float
        Standard deviation of the readings about the unit's own pattern.
    p : float
        Probability that a sound unit deviates or, where it moved, changes this much, allowing for
        the number of its orders and its residual.
    limit : float
        At or below which ``p`` is reported: in 1 % of sound fleets, for all units together.
    """

    unit: str
    verdict: Verdict
    because: str
    orders: tuple[UnitOrder, ...]
    peak_to_peak: Angle
    left: Angle
    p: float
    limit: float


if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TESTED = (
    "  p: probability that a sound unit deviates, or changes, this much. A unit with p below "
    "the limit is reported; 1 % of sound fleets have such a unit"
)

#: Units that are fine of which the sizes are listed.
_LISTED = 12

FORMAT: Final = "trueangle-fleet"
VERSION: Final = 1


class CommonOrder(NamedTuple):
    """One order of the pattern that the units share, in the unit of the fleet's period."""

    order: float
    shaft: str
    amplitude: Angle
    phase_deg: float
    std: Angle

    @property
    def cosine(self) -> float:
        """``amplitude sin(phase)``."""
        return self.amplitude * math.sin(math.radians(self.phase_deg))

    @property
    def sine(self) -> float:
        """``amplitude cos(phase)``."""
        return self.amplitude * math.cos(math.radians(self.phase_deg))


class BetweenOrder(NamedTuple):
    """Standard deviation of cosine and sine of one order.

    ``std`` between units; ``repeatability`` of one run about its unit (None where no unit has
    two runs).
    """

    order: float
    std: Angle
    repeatability: Angle | None


@dataclass(frozen=True, eq=False, repr=False)
class Fleet(PlainResult):
    """Many units of one design.

    ::

        b_u = μ + d_u,    d_u ~ N(0, T),    T = diag(τ_k² I₂)

    Angles, amplitudes and standard deviations are in the unit of the runs; ``to_dict`` has arcsec.

    Attributes
    ----------
    units : tuple of FleetUnit
        The most urgent first.
    common : tuple of CommonOrder
        ``μ``; zero where the units share no direction.
    between : tuple of BetweenOrder
        ``τ_k`` and what repeated runs differ by.
    tolerance : Tolerance
        What bounds the peak-to-peak of a share of all units.
    history : tuple of HistoryRow
        Of units calibrated again.
    aligned_probability : float
        That the units share a mounting zero, and so a mean; `aligned` above one half.
    prior : Prior
        For a further unit: ``trueangle.fit(runs, prior=fleet)``.
    notes : tuple of str
    """

    units: tuple[FleetUnit, ...]
    common: tuple[CommonOrder, ...]
    between: tuple[BetweenOrder, ...]
    tolerance: Tolerance
    history: tuple[HistoryRow, ...]
    aligned_probability: float
    prior: Prior
    notes: tuple[str, ...] = ()

    @property
    def aligned(self) -> bool:
        """Whether ``common`` is the mean of the units; else the units rather share none."""
        return self.aligned_probability > 0.5

    @property
    def period(self) -> float:
        """One turn in the unit of the runs."""
        return self.prior.period

    @property
    def orders(self) -> tuple[float, ...]:
        """Output orders."""
        return tuple(row.order for row in self.common)

    def verdicts(self) -> dict[str, str]:
        """Verdict by unit."""
        return {unit.unit: unit.verdict for unit in self.units}

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle fleet`` prints as JSON; angles in arcsec."""

        def plain(rows: Iterable[Any]) -> list[dict[str, Any]]:
            return [plain_row(row, arcsec(1.0, self.period)) for row in rows]

        return {
            "units": plain(self.units),
            "common": {
                "aligned": self.aligned,
                "probability": self.aligned_probability,
                "orders": plain(self.common),
            },
            "between": {"orders": plain(self.between)},
            "tolerance": plain([self.tolerance])[0],
            "history": plain(self.history),
            "notes": list(self.notes),
        }

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The fleet as text: who needs what, the common pattern, the spread, tolerance limits.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors.
        """
        return _fleet_summary(self, errors_in)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the fleet as JSON: a prior for further units (`trueangle.load_fleet`).

        Raises
        ------
        FileError
            The ending names another format.
        """
        _save_fleet(self.prior, self.to_dict(), path)

    def plot(self, kind: str = "overview", **options: Any) -> Axes:
        """A picture of the fleet (needs matplotlib).

        Parameters
        ----------
        kind : {"overview", "patterns", "phasors", "sizes", "history"}
            Sizes with the tolerance band and phasors of the orders in which units differ most;
            the error over a turn of each unit; phasors of one order (``order=``) with the circle
            that holds 95 % of the units; sizes; control charts of one unit (``unit=``).
        **options
            Those of `trueangle.plots.fleet_overview` and its like; ``errors_in`` for all.

        Returns
        -------
        matplotlib Axes
            The first, where a figure has several.
        """
        axes: Axes = result_picture(self, kind, **options)
        return axes

    def _brief(self) -> str:
        odd = sum(unit.verdict != "fine" for unit in self.units)
        return f"{counted(self.units, 'unit')}, {odd} not fine, {counted(self.common, 'order')}"


def _fleet_summary(fleet: Fleet, errors_in: ErrorsIn = "auto") -> str:
    """See `Fleet.summary`."""
    scale = arcsec(1.0, fleet.period)
    largest = scale * max((unit.peak_to_peak for unit in fleet.units), default=0.0)
    shown = error_unit(errors_in, largest, fleet.period)
    odd = [unit for unit in fleet.units if unit.verdict != "fine"]
    verb = "needs" if len(odd) <= 1 else "need"
    lines = [f"{counted(fleet.units, 'unit')}; {len(odd) or 'none'} {verb} attention", ""]
    width = max(map(len, ("unit", *(unit.unit for unit in fleet.units))))
    told = [unit for unit in fleet.units if unit.because]
    for unit in told:
        lines.append(f"  {unit.unit:<{width}}  {unit.verdict:<11}  {shown.spoken(unit.because)}")
    if told:
        lines.append("")
    lines += [
        f"  {'unit':<{width}}  verdict      peak-to-peak  residual        p    limit",
        f"  {'':<{width}}  {'':<11}  {shown.name:>12} {shown.name:>9}",
    ]
    listed = fleet.units[: len(odd) + _LISTED]
    for unit in listed:
        sizes = (shown.number(scale * v) for v in (unit.peak_to_peak, unit.left))
        size, left = sizes
        lines.append(
            f"  {unit.unit:<{width}}  {unit.verdict:<11}  {size:>12} {left:>9}  {unit.p:7.2g} "
            f"{unit.limit:8.2g}"
        )
    if len(listed) < len(fleet.units):
        lines.append(f"  and {len(fleet.units) - len(listed)} that are fine")
    lines += ["", _TESTED, "", *_orders(fleet, shown, scale), "", _tolerance(fleet, shown, scale)]
    lines += _calendar(fleet, shown, scale, width)
    if fleet.notes:
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(fleet.notes, 1))]
    return laid_out(lines)


def _orders(fleet: Fleet, shown: ErrorUnit, scale: float) -> list[str]:
    shared = "the mean of the units" if fleet.aligned else "none (random phases)"
    shared += f", probability {0.5 + abs(fleet.aligned_probability - 0.5):.2g}"
    lines = [f"  common pattern: {shared}", "   order      common  between units  repeatability"]
    for common, between in zip(fleet.common, fleet.between, strict=True):
        again = (
            "-" if between.repeatability is None else shown.number(scale * between.repeatability)
        )
        lines.append(
            f"  {common.order:6g}  {shown.number(scale * common.amplitude):>10}  "
            f"{shown.number(scale * between.std):>13}  {again:>13}"
        )
    return [*lines, f"  (amplitude; then standard deviations of cosine and sine, {shown.name})"]


def _tolerance(fleet: Fleet, shown: ErrorUnit, scale: float) -> str:
    bound = fleet.tolerance
    if bound.method == "none":
        return "  tolerance limits need two units at least"
    how = (
        "by ranks, for any distribution"
        if bound.method == "wilks"
        else f"for a log-normal distribution, factor {bound.factor:.4g}"
    )
    return (
        f"  {100 * bound.share:g} % of units stay below {shown.text(scale * bound.peak_to_peak)} "
        f"peak-to-peak and {shown.text(scale * bound.left)} residual after correction, with "
        f"{100 * bound.confidence:g} % confidence ({how})"
    )


def _calendar(fleet: Fleet, shown: ErrorUnit, scale: float, width: int) -> list[str]:
    """When the units are due, the first first; those far off in one line."""
    due = sorted(
        (row for row in fleet.history if row.next_calibration is not None),
        key=lambda row: row.next_calibration or "",
    )
    if not due:
        return []
    lines = ["", "  next calibration (a drift at its 95 % bound reaches the permitted error)"]
    for row in due:
        if not row.extrapolated:
            bound = shown.text(scale * (row.bound or 0.0))
            lines.append(
                f"  {row.unit:<{width}}  {row.next_calibration}  changed by {bound} at most until "
                f"{row.when[:10]}"
            )
    far = [row for row in due if row.extrapolated]
    if far:
        lines.append(
            f"  {counted(far, 'unit')} from {far[0].next_calibration} ({far[0].unit}) on: "
            "extrapolated beyond twice the measured time"
        )
    return lines


def _save_fleet(prior: Prior, told: dict[str, Any], path: str | PathLike[str]) -> None:
    """Write a fleet: its prior, and its results as plain values; see `Fleet.save`."""
    runs = prior.run_variance
    content = {
        "format": FORMAT,
        "version": VERSION,
        "prior": {
            "period": prior.period,
            "shafts": [{**s._asdict(), "orders": list(s.orders)} for s in prior.shafts],
            "mean": prior.mean.tolist(),
            "variance": prior.variance.tolist(),
            "freedom": prior.freedom,
            "noise_variance": prior.noise_variance,
            "noise_freedom": None if math.isinf(prior.noise_freedom) else prior.noise_freedom,
            "units": prior.units,
            **({} if runs is None else {"run_variance": runs.tolist()}),
        },
        **told,
    }
    with written_atomically(path, kind=FLEET) as file:
        file.write(pretty_json(content) + "\n")
