"""Pictures of readings and of what a model corrects: all runs, before and after, residuals."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..fitting.summary import fit_error_unit
from ..runs.run import CalibrationRun, as_runs
from ..support.display_units import ErrorsIn, error_unit, significant_digits, sine_of_rms
from ..support.layout import counted
from . import palette
from .canvas import described, grid, legend, marked, new_axes, turn_axis
from .curves import (
    CONFIDENCE,
    ModelCurve,
    Points,
    Signal,
    curve_envelope,
    fitted_degrees,
    held_out_points,
    model_curve,
    rms_amplitude,
    strong_gear_order,
    thinned_points,
)
from .readingpictures import (
    Cloud,
    Panel,
    PanelPicture,
    before_after_picture,
    comparison_picture,
    errors_picture,
    residual_picture,
)
from .simulatedcurves import simulated_points

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.result import FitResult
    from ..model.model import HarmonicModel
    from ..simulation import Simulation

#: Readings plotted in one picture: more do not show.
_MOST: Final = 24_000


def error_curves(fit: FitResult, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Measured error of every run, the fitted model and its 95 % band.

    Every run is shown less its own zero, the model without its constant; gear orders, which
    would fill the picture, as the envelope of the model.

    Parameters
    ----------
    fit : FitResult
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    picture = errors_picture(fit.runs, fit, fit_error_unit(fit, errors_in))
    return _drawn(ax, picture, "Measured error of every run, and the model")


def before_after(
    model: HarmonicModel,
    runs: CalibrationRun | Iterable[CalibrationRun],
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Error of held-out ``runs`` before and after correction by ``model``.

    Every run keeps its own zero: the mean of the residual is subtracted. The legend gives
    root mean square and peak-to-peak of both.

    Parameters
    ----------
    model : HarmonicModel
    runs : CalibrationRun or iterable of them
        That took no part in the fit; runs that did make the picture too good.
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes
    """
    pairs = held_out_points(model, as_runs(runs))
    unit = error_unit(errors_in, rms_amplitude(before for before, _ in pairs), model.period)
    numbered = [(number, *pair) for number, pair in enumerate(pairs)]
    picture = before_after_picture(numbered, fitted_degrees(model), unit)
    return _drawn(ax, picture, "Held-out runs before and after correction")


def residuals(
    fit: FitResult,
    against: Signal = "angle",
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """What the model leaves of every reading, against a signal that it may depend on.

    The black line joins medians of bins: anything but a flat line at zero is an error
    that the model does not hold. For ``"direction"`` the runs are next to each other.

    Parameters
    ----------
    fit : FitResult
    against : {"angle", "time", "speed", "temperature", "direction", "torque"}
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    ArgumentError
        An unknown signal, or one that no run has.
    """
    picture = residual_picture(fit, against, fit_error_unit(fit, errors_in))
    return _drawn(ax, picture, f"Residual against {against}", height=3.4)


def measured_and_simulated(
    runs: CalibrationRun | Iterable[CalibrationRun],
    sim: Simulation,
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Measured error, the simulated one at the same readings, and their difference.

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    sim : Simulation
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes
    """
    found = as_runs(runs)
    ax = new_axes(ax)
    expected = simulated_points(found, sim)
    largest = rms_amplitude(measured for measured, _ in expected)
    unit = error_unit(errors_in, largest, found[0].period)
    picture = comparison_picture(expected, unit)
    both, apart = picture.panels
    # The difference is below the two, on a separate line: nothing hides another.
    rest = np.concatenate([cloud.points.y for cloud in apart.clouds])
    shown = np.concatenate([cloud.points.y for cloud in both.clouds])
    lowest, top = float(shown.min()), float(shown.max())
    down = lowest - 1.15 * float(rest.max()) - 0.05 * float(np.ptp(rest))
    draw_panel(ax, both)
    moved = [
        replace(
            cloud,
            points=Points(cloud.points.label, cloud.points.x, cloud.points.y + down),
            role="after",
            name="difference, moved down",
        )
        for cloud in apart.clouds
    ]
    _draw_clouds(ax, moved)
    ax.axhline(down, color=palette.MUTED, linewidth=0.8, zorder=0)
    # Numbers of the axis belong to the two above; below them is the difference's zero.
    ticks = [float(tick) for tick in ax.get_yticks() if lowest <= tick <= top]
    texts = [f"{tick:g}".replace("-", "\N{MINUS SIGN}") for tick in ticks]
    ax.set_yticks([down, *ticks], ["0", *texts])
    legend(ax)
    return described(ax, picture.told, "Measured and simulated error")


def _drawn(ax: Axes | None, picture: PanelPicture, title: str, height: float = 4.0) -> Axes:
    """The first panel of a picture with its legend, sentence and title."""
    ax = new_axes(ax, height=height)
    draw_panel(ax, picture.panels[0])
    legend(ax)
    return described(ax, picture.told, title)


def draw_panel(ax: Axes, panel: Panel, most: int = _MOST) -> None:
    """Readings, at most ``most``, model and medians, with titles of the axes."""
    _draw_clouds(ax, panel.clouds, most)
    if panel.zero:
        ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    if panel.model is not None:
        draw_panel_curve(ax, panel.model, panel.dense)
    if panel.medians is not None:
        x, y = panel.medians
        ink = palette.ink(ax)
        ax.plot(x, y, color=ink, linewidth=1.4, marker=".", label="median")
    if panel.angles and panel.span is not None:
        turn_axis(ax, *panel.span)
    elif panel.span is not None:  # directions
        ax.set_xlim(*panel.span)
        ax.set_xticks([-1.0, 0.0, 1.0], ["backward", "at rest", "forward"])
    grid(ax)
    ax.set_xlabel(panel.x)
    ax.set_ylabel(panel.y)


def _draw_clouds(ax: Axes, clouds: Sequence[Cloud], most: int = _MOST) -> None:
    """Dots of every cloud; each name once for the legend."""
    # Readings plotted of each run at least.
    share = max(6, most // len(clouds))
    # Readings from which on dots are small and faint.
    dense = sum(min(cloud.points.y.size, share) for cloud in clouds) > 2_000
    named: set[str] = set()
    for cloud in clouds:
        part = thinned_points(cloud.points, share, cloud.run)
        (line,) = ax.plot(
            part.x,
            part.y,
            linestyle="none",
            label=None if cloud.name in named else cloud.name,
            **_style(ax, cloud, dense),
        )
        marked(line, run=cloud.run, ring=cloud.role == "measured")
        named.add(cloud.name)


def _style(ax: Axes, cloud: Cloud, dense: bool) -> dict[str, Any]:
    size, alpha = (2.0, 0.4) if dense else (3.5, 0.75)
    if cloud.role == "measured":
        ring = {"markerfacecolor": "none", "markeredgewidth": 0.7}
        return {"marker": "o", "markersize": 4.0, "color": palette.BEFORE, **ring}
    colour, marker = {
        "run": (palette.run_colour(cloud.run), palette.run_marker(cloud.run)),
        "before": (palette.BEFORE, "s"),
        "after": (palette.AFTER, "o"),
        "simulated": (palette.ink(ax), "."),
    }[cloud.role]
    if cloud.role == "simulated":  # within the rings of what was measured
        size, alpha = 2.5, 1.0
    faint = {"alpha": alpha, "markeredgewidth": 0.0}
    return {"marker": marker, "markersize": size, "color": colour, **faint}


def draw_panel_curve(ax: Axes, curve: ModelCurve, dense: bool) -> None:
    """A model's curve with its band; its envelope where gear orders fill the picture."""
    if dense:
        ax.fill_between(
            *curve_envelope(curve),
            color=palette.MUTED,
            alpha=0.35,
            linewidth=0.0,
            zorder=0.5,
            label="envelope of the model",
        )
        return
    ax.plot(curve.angle, curve.error, color=palette.ink(ax), zorder=3.0, label="model")
    if curve.std is None:
        return
    half = CONFIDENCE * curve.std
    ax.fill_between(
        curve.angle,
        curve.error - half,
        curve.error + half,
        color=palette.ink(ax),
        alpha=0.2,
        linewidth=0.0,
        zorder=0.5,
        label="95 % band",
    )


def model_error(model: HarmonicModel, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
    """Error of a model over the angle, less its constant, with its 95 % band.

    What depends on more than the angle (backlash, lag and other terms) is named in the text
    alternative and not plotted; gear orders, which would fill the picture, are plotted as envelope.

    Parameters
    ----------
    model : HarmonicModel
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.

    Examples
    --------
    >>> import trueangle as ta
    >>> model = ta.HarmonicModel((ta.Shaft("output", 1.0, (2,), (0.01,), (0.0,)),), period=360.0)
    >>> ta.plots.text_alternative(model.plot())
    'Error of the model over the angle: 72.0 arcsec peak-to-peak in 1 order.'
    """
    ax = new_axes(ax)
    pattern = model.replace(terms=())
    curve = model_curve(pattern)
    unit = error_unit(errors_in, sine_of_rms(float(np.std(curve.error))), model.period)
    curve = curve.scaled(unit.per_arcsec)
    low, high = fitted_degrees(model)
    dense = strong_gear_order(pattern.orders, pattern.amplitudes, high - low) is not None
    draw_panel_curve(ax, curve, dense)
    turn_axis(ax, low, high)
    ax.set_xlabel(f"{model.argument} angle / deg")
    ax.set_ylabel(f"error / {unit.name}")
    legend(ax)
    terms = ", ".join(term.kind for term in model.terms)
    return described(
        ax,
        f"Error of the model over the angle: {significant_digits(float(np.ptp(curve.error)), 3)} "
        f"{unit.name} peak-to-peak in {counted(len(model.orders), 'order')}"
        + (f"; not shown: {terms}" if terms else "")
        + ".",
        "Error of the model",
    )
