"""Interactive figures of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..plots import palette
from ..plots.simulatedcurves import gain_bars, simulated_points
from .figures import Figure, figure, run_trace, turn_axis

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..runs import CalibrationRun
    from ..simulation import Simulation

__all__ = ["figures_of"]

#: Causes from the top down.
_CAUSES = {"autorange": "reversed", "type": "category"}


def figures_of(
    diagnosis: Diagnosis,
    runs: Sequence[CalibrationRun],
    sim: Simulation,
    left: Sequence[tuple[str, float]],
) -> dict[str, Figure]:
    """Measured against simulated, what is left after each cause, gains."""
    found = {"measured-simulated": _compared(runs, sim)}
    if diagnosis.findings:
        found["error-left"] = _left(diagnosis, left)
    if gain_bars(diagnosis):
        found["gains"] = _gains(diagnosis)
    return found


def _compared(runs: Sequence[CalibrationRun], sim: Simulation) -> Figure:
    traces = []
    pairs = simulated_points(runs, sim)
    for name, colour, size in (
        ("measured", palette.BEFORE, 4),
        ("simulated", palette.MUTED, 3),
        ("difference", palette.AFTER, 4),
    ):
        for number, (measured, simulated) in enumerate(pairs):
            points = simulated if name == "simulated" else measured
            if name == "difference":
                points = type(measured)(measured.label, measured.x, measured.y - simulated.y)
            trace = run_trace(number, points, 3 * len(runs))
            trace |= {"name": name, "legendgroup": name, "showlegend": number == 0}
            trace["marker"] = {"size": size, "color": colour, "opacity": 0.7}
            trace["hovertemplate"] = (
                f"run {measured.label}, {name}: %{{y:.2f}} arcsec at %{{x:.2f}}°<extra></extra>"
            )
            traces.append(trace)
    alt = (
        f"Measured error of {len(runs)} runs, the error that the simulation expects at the same "
        "readings, and their difference, in arcsec over one turn."
    )
    return figure(alt, "", "error / arcsec", traces, xaxis=turn_axis(None))


def _left(diagnosis: Diagnosis, left: Sequence[tuple[str, float]]) -> Figure:
    names = [name for name, _ in left]
    bars = {
        "type": "bar",
        "orientation": "h",
        "name": "left",
        "showlegend": False,
        "y": names,
        "x": [rms for _, rms in left],
        "texttemplate": "%{x:.2f}",
        "textposition": "auto",
        "hovertemplate": "%{y}: %{x:.2f} arcsec rms<extra></extra>",
        "marker": {"color": [palette.BEFORE] + [palette.AFTER] * (len(left) - 1)},
    }
    noise = {
        "type": "scatter",
        "mode": "lines",
        "name": "noise of one reading",
        "x": [diagnosis.noise] * 2,
        "y": [0, 1],
        "yaxis": "y2",
        "line": {"dash": "dash", "width": 1.5},
        "hovertemplate": "noise %{x:.2f} arcsec<extra></extra>",
        "meta": {"role": "model"},
    }
    alt = (
        "Rms of measured less simulated error as each cause joins the simulation: "
        + ", ".join(f"{name} {rms:.2f} arcsec" for name, rms in left)
        + f". Noise of one reading {diagnosis.noise:.2f} arcsec."
    )
    # The second axis lets the line of the noise run over the whole height.
    over = {"overlaying": "y", "range": [0, 1], "visible": False, "fixedrange": True}
    title = "rms of the difference / arcsec"
    made = figure(alt, title, "", [bars, noise], yaxis=_CAUSES, yaxis2=over)
    return made | {"rows": len(names)}


def _gains(diagnosis: Diagnosis) -> Figure:
    bars: list[Any] = gain_bars(diagnosis)
    trace = {
        "type": "bar",
        "orientation": "h",
        "y": [bar.cause for bar in bars],
        "x": [bar.share for bar in bars],
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": [max(0.0, bar.high - bar.share) for bar in bars],
            "arrayminus": [max(0.0, bar.share - bar.low) for bar in bars],
        },
        "hovertemplate": "%{y}: %{x:.1f} %<extra></extra>",
        "marker": {"color": palette.AFTER},
    }
    alt = "Share of the reducible error that each cause takes away on held-out runs: " + ", ".join(
        f"{bar.cause} {bar.share:.0f} % ({bar.low:.0f} to {bar.high:.0f} %)" for bar in bars
    )
    title = "share of the reducible error taken away / %"
    return figure(alt, title, "", [trace], yaxis=_CAUSES) | {"rows": len(bars)}
