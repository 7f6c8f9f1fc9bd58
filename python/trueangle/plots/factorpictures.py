"""Pictures of what an error follows: the function of each factor with its band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from . import palette
from .canvas import described, grid, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..diagnosis import Diagnosis
    from ..diagnosis.factors.factor import Factor

#: Small pictures side by side.
COLUMNS = 3

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


def factors(diagnosis: Diagnosis, errors_in: ErrorsIn = "auto") -> Figure:
    """What measured minus simulated follows: a small picture for each factor.

    The line is the function that was estimated, the area its 95 % band; of a product with the
    place it is the amplitude of its orders. The title says whether a cause has that form.

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
    columns = min(COLUMNS, len(shown))
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
    what = factor.factor.replace("_place", " times the place").replace("_", " ")
    if factor.orders:
        what += f" ({_orders(factor.orders)})"
    return f"{what}: {', '.join(factor.named_by).replace('_', ' ') or 'no named form'}"


def draw_factor(ax: Axes, factor: Factor, unit: ErrorUnit) -> None:
    """The function and its band; the two values of a sign as points."""
    curve, scale = factor.curve, unit.per_arcsec
    value, low, high = (scale * y for y in (curve.value, curve.low, curve.high))
    if curve.at.size > 2 and curve.unit != "run":
        ax.fill_between(curve.at, low, high, color=palette.AFTER, alpha=0.25, linewidth=0.0)
        ax.plot(curve.at, value, color=palette.AFTER, linewidth=1.4)
    else:
        ends = np.maximum([value - low, high - value], 0.0)
        ax.errorbar(curve.at, value, yerr=ends, fmt="o", color=palette.AFTER, capsize=3.0)
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8)
    ax.set_xlabel(_AXES.get(curve.unit, curve.unit), fontsize="small")
    what = "amplitude" if factor.factor.endswith("_place") else "error"
    ax.set_ylabel(f"{what} / {unit.name}", fontsize="small")
    grid(ax)
    described(
        ax,
        f"What follows the {factor_title(factor)}; {unit.text(factor.rms)} rms, from "
        f"{unit.number(float(curve.value.min()))} to {unit.number(float(curve.value.max()))}.",
    )


def _orders(orders: tuple[float, ...]) -> str:
    first = ", ".join(f"{order:.6g}" for order in orders[:2])
    return f"order {first}" if len(orders) == 1 else f"orders {first}{' …' * (len(orders) > 2)}"
