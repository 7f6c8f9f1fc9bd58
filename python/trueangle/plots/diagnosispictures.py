"""Pictures of a diagnosis: gains of its findings, what each leaves, what the error follows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..effects.effect import title_of
from ..errors import ArgumentError
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import order_ranges
from . import palette
from .canvas import described, grid, legend, marked, new_axes, new_figure, plain_logarithms
from .simulatedcurves import ErrorLeft, error_left_of, gain_bars

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..diagnosis import Diagnosis
    from ..diagnosis.factors.factor import Factor

_NO_GAIN = "no finding of this diagnosis has a gain that carries over to new runs"


#: What the values of a factor are, by their unit.
_AXES = {
    "deg": "place / deg",
    "sign": "direction or sign",
    "deg/s": "speed / deg/s",
    "Nm": "load / Nm",
    "C": "temperature / °C",
    "A": "current / A",
    "s": "time / s",
    "Hz": "frequency / Hz",
    "run": "run",
    "reading": "reading",
}


def gains(diagnosis: Diagnosis, ax: Axes | None = None) -> Axes:
    """Share of the reducible error that each cause takes away, with 95 % intervals.

    Reducible is what is above the noise; 100 % leaves noise alone. Causes that are
    random in each run (a slipped zero) have no such gain and are not plotted.

    Parameters
    ----------
    diagnosis : Diagnosis
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        No finding has a gain to draw.
    """
    bars = gain_bars(diagnosis)
    if not bars:
        raise ArgumentError(_NO_GAIN)
    ax = new_axes(ax, height=1.4 + 0.4 * len(bars))
    place = np.arange(len(bars))
    share = np.array([bar.share for bar in bars])
    below = share - [min(bar.low, bar.share) for bar in bars]
    above = np.array([max(bar.high, bar.share) for bar in bars]) - share
    ax.barh(place, share, height=0.6, color=palette.AFTER)
    ax.errorbar(share, place, xerr=[below, above], fmt="none", ecolor=palette.ink(ax), capsize=4.0)
    ax.axvline(100.0, color=palette.MUTED, linestyle="--", linewidth=1.0)
    ax.set_yticks(place, [bar.cause for bar in bars])
    ax.invert_yaxis()
    ax.set_xlim(min(0.0, float((share - below).min())), max(105.0, float((share + above).max())))
    ax.set_xlabel("share of the reducible error removed on held-out runs / %")
    told = ", ".join(f"{b.cause} {b.share:.0f} % ({b.low:.0f} to {b.high:.0f})" for b in bars)
    told = f"Share of the reducible error that each cause removes: {told}."
    return described(ax, told, "Gain of each cause")


def error_left(diagnosis: Diagnosis, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Rms left of held-out readings: with all causes in place, and with each one removed.

    The numbers are those of the findings' gains, so that the two cannot disagree.

    Parameters
    ----------
    diagnosis : Diagnosis
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        No finding has a gain that carries over to new runs.
    """
    left = error_left_of(diagnosis)
    if left is None:
        raise ArgumentError(_NO_GAIN)
    unit = error_unit(errors_in, max(left.noise, *(rms for _, rms in left.rows)))
    ax = new_axes(ax, height=1.4 + 0.4 * len(left.rows))
    draw_error_left(ax, left, unit)
    legend(ax)
    return described(ax, left.told(unit), "Held-out error with all causes, and without each")


def draw_error_left(ax: Axes, left: ErrorLeft, unit: ErrorUnit) -> None:
    """On a logarithmic axis: one cause may leave a hundred times what another does."""
    sizes = unit.per_arcsec * np.array([rms for _, rms in left.rows])
    noise = unit.per_arcsec * left.noise
    place = np.arange(len(sizes))
    for chosen, colour in ((slice(0, 1), palette.AFTER), (slice(1, None), palette.BEFORE)):
        (dots,) = ax.plot(
            sizes[chosen], place[chosen], linestyle="none", marker="o", markersize=8.0, color=colour
        )
        marked(dots, titles=[f"{name}: {unit.text(rms)} rms" for name, rms in left.rows[chosen]])
    for (_, rms), size, level in zip(left.rows, sizes, place, strict=True):
        ax.annotate(
            unit.number(rms), (size, level), xytext=(0, 6), textcoords="offset points",
            ha="center", fontsize="small",
        )  # fmt: skip
    label = f"noise of one reading, {unit.text(left.noise)}"
    ax.axvline(noise, color=palette.ink(ax), linestyle="--", linewidth=1.0, label=label)
    ax.set_xscale("log")
    ax.set_xlim(0.6 * min(sizes.min(), noise), 1.5 * max(sizes.max(), noise))
    plain_logarithms(ax, "x")
    ax.set_yticks(place, [name for name, _ in left.rows])
    ax.set_ylim(len(sizes) - 0.4, -0.6)
    ax.set_xlabel(left.axis(unit))
    grid(ax)


def factors(diagnosis: Diagnosis, errors_in: ErrorsIn = "auto") -> Figure:
    """What measured minus simulated follows: a small picture for each factor.

    The line is the function that was estimated, the area its 95 % band; of a product with the
    place it is the amplitude of its orders. The title states whether a cause has that form.

    Parameters
    ----------
    diagnosis : Diagnosis
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    ArgumentError
        The readings follow no factor: there is nothing to draw.
    """
    shown = diagnosis.factors
    if not shown:
        raise ArgumentError("the readings follow no factor beyond the simulation: nothing to draw")
    unit = error_unit(errors_in, max(factor.rms for factor in shown))
    # Small pictures side by side.
    columns = min(3, len(shown))
    rows = -(-len(shown) // columns)
    width, height = 3.0 * columns + 0.4, 2.4 * rows + 0.3
    figure, axes = new_figure(rows, columns, width=width, height=height, sharey=False)
    for ax, factor in zip(axes, shown, strict=False):
        draw_factor(ax, factor, unit)
        ax.set_title(factor_title(factor).replace(": ", "\n"), fontsize="small")
    for ax in axes[len(shown) :]:
        ax.remove()
    return figure


def factor_title(factor: Factor) -> str:
    """The factor and its name, or that it has none."""
    what = factor.factor.replace("_place", " times the place").replace("reversal_time", "reversal")
    what += "" if factor.shaft in (None, "output") else f" of the {factor.shaft}"
    what = what.replace("_", " ")
    if factor.orders:
        what += f" (order{'s' * (len(factor.orders) > 1)} {order_ranges(factor.orders)})"
    names = ", ".join(map(title_of, factor.named_by))
    return f"{what}: {names or 'cause not determined'}"


def draw_factor(ax: Axes, factor: Factor, unit: ErrorUnit) -> None:
    """The function and its band; the two values of a sign as points."""
    curve, scale = factor.curve, unit.per_arcsec
    value, low, high = (scale * y for y in (curve.value, curve.low, curve.high))
    if factor.factor == "place" and factor.shaft not in (None, "output"):
        # An envelope: the places of the output are too far apart for the cycles of that shaft.
        high = np.full(value.size, np.abs(value).max())
        value, low = 0.0 * value, -high
    if curve.at.size > 2 and curve.unit != "run":
        ax.fill_between(curve.at, low, high, color=palette.AFTER, alpha=0.25, linewidth=0.0)
        ax.plot(curve.at, value, color=palette.AFTER, linewidth=1.4)
    else:
        ends = np.maximum([value - low, high - value], 0.0)
        ax.errorbar(curve.at, value, yerr=ends, fmt="o", color=palette.AFTER, capsize=3.0)
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8)
    known = _AXES | {"deg": "travel / deg"} if factor.factor == "reversal_time" else _AXES
    ax.set_xlabel(known.get(curve.unit, curve.unit), fontsize="small")
    what = "amplitude" if factor.factor.endswith("_place") else "error"
    ax.set_ylabel(f"{what} / {unit.name}", fontsize="small")
    grid(ax)
    least, most = (unit.number(float(end(curve.value))) for end in (np.min, np.max))
    told = f"What follows the {factor_title(factor)}; {unit.text(factor.rms)} rms"
    described(ax, f"{told}, from {least} to {most}.")
