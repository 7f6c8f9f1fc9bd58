"""Figures of a page, the unit of their errors and the names of their lines."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Final, TypeAlias

import numpy as np

from ..errors import RankError
from ..fitting.phases import run_phases
from ..plots import curves
from ..plots.amplitudespectrum import draw_spectrum, spectrum_text
from ..plots.curves import Points
from ..plots.diagnosispictures import draw_error_left, draw_factor, factor_title
from ..plots.drawnreadings import draw_panel
from ..plots.orderlines import order_lines
from ..plots.pagechart import page_axes, page_chart
from ..plots.phasesoverruns import draw_phase_of_order
from ..plots.readingpictures import (
    PanelPicture,
    before_after_picture,
    comparison_picture,
    errors_picture,
    residual_picture,
)
from ..plots.simulatedcurves import error_left_of, simulated_points
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit, significant_digits, sine_of_rms
from ..support.layout import counted

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.heldout import HeldOut
    from ..fitting.orders.select import OrderSelection
    from ..fitting.result import FitResult
    from ..joint.joint import Joint
    from ..simulation import Simulation

#: A figure of the report: its alternative text, its charts, and how these are arranged.
Figure: TypeAlias = dict[str, Any]

#: Readings plotted in one chart at most: more do not show, and make the page heavy and slow.
_MOST_POINTS: Final = 3_000
#: Runs up to which as many are plotted; of more, whose tables are long, fewer: a page weighs 1 MB.
_MOST_RUNS: Final = 12
#: Width of a chart that has the page, and of one next to another, inches.
_WIDE, _NARROW = 7.5, 3.4

#: What a line of an output order is called.
LineNames: TypeAlias = Callable[[float], str]


def line_names(joint: Joint | None) -> LineNames:
    """Names by output order: of the shaft of ``joint`` that it is a whole order of.

    Without a joint, and for orders that are none of its shafts', the output's own.

    Examples
    --------
    >>> from trueangle.simulation import Joint
    >>> name = line_names(Joint(100.0, "circular_spline", "motor"))
    >>> name(100.0), name(202.0), name(5.0), line_names(None)(100.0)
    ('motor 1', 'wave generator 2', 'output 5', 'output 100')
    """

    def name(order: float) -> str:
        found = None if joint is None else joint.name_order(order)
        if found is None:
            return f"output {order:g}"
        shaft, k = found
        return f"{shaft.replace('_', ' ')} {k}"

    return name


@dataclass(frozen=True)
class ErrorScale:
    """One unit for every error of a page; results are in arcsec, what is plotted in it.

    Attributes
    ----------
    unit : ErrorUnit
    turn : float or None
        Counts of a turn where the unit is a count.
    """

    unit: ErrorUnit
    turn: float | None = None

    @property
    def name(self) -> str:
        """The unit's name."""
        return self.unit.name

    @property
    def factor(self) -> float:
        """How many of the unit one second of arc is."""
        return self.unit.per_arcsec

    @property
    def defined(self) -> str:
        """What the unit is, for those who do not know it."""
        return {
            "arcsec": "in seconds of arc (1 arcsec = 1/3600 degree)",
            "deg": "in degrees",
            "mrad": "in thousandths of a radian (1 mrad = 0.0573 degree)",
            "count": f"in counts of {self.turn:g} to a turn" if self.turn else "in counts",
        }[self.name]

    def to_dict(self) -> dict[str, Any]:
        """For the content: the unit of the page; numbers of the content stay in arcsec."""
        return {"unit": self.name, "per_arcsec": self.factor, "defined": self.defined}


def error_scale(asked: ErrorsIn, rms: float, runs: Sequence[CalibrationRun]) -> ErrorScale:
    """The scale requested; counts are those of the runs where no number states otherwise.

    Raises
    ------
    ArgumentError
        Another word; counts where nothing states how many a turn has.
    """
    period = runs[0].period
    unit = error_unit(asked, sine_of_rms(rms), period)
    turn = None if unit.name != "count" else period if isinstance(asked, str) else float(asked)
    return ErrorScale(unit, turn)


def figures_of_runs(
    runs: Sequence[CalibrationRun],
    fit: FitResult | None,
    selection: OrderSelection | None,
    held: HeldOut | None,
    name: LineNames,
    scale: ErrorScale,
) -> dict[str, Figure]:
    """Figures of a report on runs: those that the fit, the selection and the gain allow."""
    made = {"errors": panel_figure(errors_picture(runs, fit, scale.unit))}
    # At one place no order can be looked for.
    if fit is not None or (selection is not None and order_lines(selection)):
        made["spectrum"] = spectrum_figure(fit, selection, name, scale)
    if fit is not None and held is not None:
        made["before-after"] = _before_after(held, fit.runs, scale)
    if fit is not None:
        multiples = phase_figure(fit, name, scale)
        if multiples is not None:
            made["phases"] = multiples
        for signal in _signals_present(fit):
            picture = residual_picture(fit, signal, scale.unit)
            made[f"residual-{signal}"] = panel_figure(picture, height="height:16rem")
    return made


def figures_of_diagnosis(
    diagnosis: Diagnosis,
    runs: Sequence[CalibrationRun],
    sim: Simulation,
    scale: ErrorScale,
) -> dict[str, Figure]:
    """Measured against simulated; the residual without each of several causes.

    A chart of one dot shows less than the sentence next to it: it is omitted; so is a simulation
    that expects no error, with which the measured one would be plotted once more.
    """
    pairs = simulated_points(runs, sim)
    expected = max(float(np.ptp(simulated.y)) for _, simulated in pairs)
    found = {}
    # Part of the measured error that a simulation must expect to be plotted with it.
    if expected > 1e-3 * diagnosis.discrepancy.peak_to_peak:
        picture = comparison_picture(pairs, scale.unit, diagnosis.extended)
        arrangement = "stacked" if len(picture.panels) == 2 else "above"
        found["measured-simulated"] = panel_figure(picture, arrangement, "height:16rem")
    if diagnosis.factors:
        found["factors"] = _factors(diagnosis, scale)
    left = error_left_of(diagnosis)
    if left is not None and len(left.rows) > 2:
        ax = page_axes(5.0, 1.0 + 0.3 * len(left.rows))
        # The title says "without each cause".
        rows = tuple((name.removeprefix("without "), rms) for name, rms in left.rows)
        draw_error_left(ax, replace(left, rows=rows), scale.unit)
        chart = page_chart(ax, height=f"height:{3 + 2.2 * len(left.rows):.3g}rem")
        found["error-left"] = {
            "alt": left.told(scale.unit), "charts": [chart], "arrangement": "row",
        }  # fmt: skip
    return found


def _factors(diagnosis: Diagnosis, scale: ErrorScale) -> Figure:
    """One chart for each factor: its function with the band."""
    charts, told = [], []
    # Factors that are shown, the strongest.
    for factor in diagnosis.factors[:9]:
        ax = page_axes(_NARROW, 2.0)
        draw_factor(ax, factor, scale.unit)
        told.append(ax.get_label())
        title = factor_title(factor)
        charts.append(page_chart(ax, title=title[0].upper() + title[1:], height="height:12rem"))
    return {"alt": " ".join(map(str, told)), "charts": charts, "arrangement": "multiples"}


def panel_figure(
    picture: PanelPicture, arrangement: str = "row", height: str = "height:22rem"
) -> Figure:
    """All panels of a picture; the main one is twice as wide as its segment."""
    charts = []
    for number, panel in enumerate(picture.panels):
        grow = 2.0 if number == 0 else 1.0
        ax = page_axes(_NARROW if panel.title and arrangement == "row" else _WIDE)
        runs = len({cloud.run for cloud in panel.clouds})
        most = sum(cloud.points.y.size for cloud in panel.clouds)
        if not panel.title:
            most = min(most, int(_MOST_POINTS * min(1.0, _MOST_RUNS / runs)))
        draw_panel(ax, panel, most)
        charts.append(page_chart(ax, title=panel.title, grow=grow, height=height))
    more = "".join(f" {panel.title} is shown next to it." for panel in picture.panels[1:]
                   if panel.title)  # fmt: skip
    return {"alt": picture.told + more, "charts": charts, "arrangement": arrangement}


def spectrum_figure(
    fit: FitResult | None, selection: OrderSelection | None, name: LineNames, scale: ErrorScale
) -> Figure:
    """Amplitude of every order: candidates of a selection, or the orders of a fit."""
    result = fit if selection is None else selection
    assert result is not None
    lines = order_lines(result)
    ax = page_axes(_WIDE)
    draw_spectrum(ax, lines, scale.unit, fitted=selection is None, name=name)
    alt = spectrum_text(lines, scale.unit, fitted=selection is None)
    return {"alt": alt, "charts": [page_chart(ax)], "arrangement": "row"}


def phase_figure(fit: FitResult, name: LineNames, scale: ErrorScale) -> Figure | None:
    """Phase of every order in every run; None where no run holds them, or there is one."""
    try:
        # Orders whose phases are shown, the largest.
        found = sorted(run_phases(fit), key=lambda p: -float(p.amplitude.mean()))[:12]
    except RankError:
        return None
    if not found or len(found[0].labels) < 2:
        return None
    numbers = {(run.label or str(i + 1)): i for i, run in enumerate(fit.runs)}
    charts = []
    for order in sorted(found, key=lambda p: p.order):
        ax = page_axes(_NARROW, 2.0)
        draw_phase_of_order(ax, order, numbers, scale.unit)
        size = significant_digits(scale.factor * float(order.amplitude.mean()), 3)
        title = f"{name(order.order).capitalize()}: {size} {scale.name}"
        charts.append(page_chart(ax, title=title, height="height:11rem"))
    alt = (
        f"Phases of {counted(charts, 'order')}, a chart for each, one dot per run. Dots of one "
        "order on a level line are a systematic error."
    )
    return {"alt": alt, "charts": charts, "arrangement": "multiples"}


def _before_after(held: HeldOut, runs: Sequence[CalibrationRun], scale: ErrorScale) -> Figure:
    """Error of every held-out run before and after correction."""
    pairs, span = [], curves.travelled_degrees(runs)
    for run in held.runs:
        x = curves.reference_degrees(run.run, span[0])
        number = next(i for i, known in enumerate(runs) if known is run.run)
        pairs.append((number, Points(run.label, x, run.before), Points(run.label, x, run.after)))
    return panel_figure(before_after_picture(pairs, span, scale.unit))


def _signals_present(fit: FitResult) -> list[curves.Signal]:
    """Signals that the residual can be plotted against: those that any run has and that vary."""
    found = []
    for name in curves.SIGNALS:
        values = [v for run in fit.runs if (v := _signal(run, name)) is not None]
        if values and float(np.ptp(np.concatenate(values))) > 0.0:
            found.append(name)
    return found


def _signal(run: CalibrationRun, name: str) -> Array | None:
    value: Array | None = run.reference if name == "angle" else getattr(run, name)
    return value
