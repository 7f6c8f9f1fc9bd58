"""A fit as text and as plain values."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..support.angles import arcsec, zero_text
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit, rounded_phase, sine_of_rms
from ..support.distributions import student_quantile
from ..support.layout import counted, laid_out
from ..support.plainresult import finite_or_none, plain_fields
from .model import FittedCoefficients
from .orders.table import FIRST, UNDETERMINED


def fit_summary(fit: FittedCoefficients, errors_in: ErrorsIn = "auto") -> str:
    """See `FitResult.summary`."""
    model = fit.model
    runs = len(fit.problem.runs)
    shown = fit_error_unit(fit, errors_in)
    left, freedom = "none left: as many unknowns as readings", fit.degrees_of_freedom
    if math.isfinite(fit.residual_variance):
        left = f"{_residual(fit, shown)} standard deviation"
    head = [
        ("readings", f"{fit.readings} in {runs} run{'s' if runs > 1 else ''}"),
        ("argument", f"{model.argument} angle"),
        ("zero", zero_text(model.constant, model.period) + _spread(fit, shown)),
        ("residual", f"{left}, {freedom:.6g} degree{'s' * (freedom != 1)} of freedom"),
    ]
    if model.covariance is not None:
        head.append(("intervals", _intervals(fit)))
    if model.indicated_sign < 0:
        head.append(("indicated", "minus what the sensor reads"))
    before, after = _sizes(fit)
    sizes = f"{shown.number(before)} -> {shown.text(after)} rms in the readings fitted"
    lines = [note for note in fit.notes if note.startswith(UNDETERMINED)]
    lines.append(f"{counted(model.orders, 'order')} fitted: error {sizes}.")
    if not freedom:
        lines.append("No reading tests it: as many unknowns as readings; read at more positions.")
    lines += [*(note for note in fit.notes if note.startswith(FIRST[1])), ""]
    if model.shafts or model.channels is None:
        lines += [*_table(fit, shown), ""]
    if model.channels is not None:
        lines += [*(f"  {line}" for line in model.channels.constant_lines()), ""]
    lines += [f"  {label:<10} {text}" for label, text in head]
    notes = [note for note in fit.notes if note not in lines]
    if notes:
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(notes, 1))]
    return laid_out(lines)


def fit_error_unit(fit: FittedCoefficients, errors_in: ErrorsIn = "auto") -> ErrorUnit:
    """One unit for tables and plots of a fit, by the rms of pattern and residual."""
    return error_unit(errors_in, sine_of_rms(_sizes(fit)[0]), fit.model.period)


def _sizes(fit: FittedCoefficients) -> tuple[float, float]:
    """Rms of the errors about the zeros of their runs, and of the residual, arcsec."""
    left = fit.residual_std if math.isfinite(fit.residual_std) else 0.0
    return arcsec(fit.rms_before, fit.model.period), arcsec(left, fit.model.period)


def _residual(fit: FittedCoefficients, shown: ErrorUnit) -> str:
    """The residual to the digits that its degrees of freedom leave, with its unit."""
    size = arcsec(fit.residual_std, fit.model.period)
    std = size / math.sqrt(2.0 * max(1.0, fit.degrees_of_freedom))
    return f"{shown.number(size, std)} {shown.name}"


def _spread(fit: FittedCoefficients, shown: ErrorUnit) -> str:
    if len(fit.problem.runs) < 2:
        return ""
    return (
        f", circular mean of {len(fit.problem.runs)} runs that differ by "
        f"{shown.text(arcsec(fit.offset_spread, fit.model.period))} (standard deviation)"
    )


def _intervals(fit: FittedCoefficients) -> str:
    """By how many standard errors 95 % intervals reach, and whose covariance it is."""
    found = fit.uncertainty
    least, most = float(found.freedom.min()), float(found.freedom.max())
    near, far = (student_quantile(0.975, v) for v in (most, least))
    times = f"{far:.3g}" if far < near + 0.05 else f"{near:.3g} to {far:.3g}"
    held = ", with the bias of the ridge" if fit.ridge > 0.0 else ""
    return f"95 % are {times} times the +- shown, {_KINDS[found.kind]}{held}"


_KINDS = {
    "white": "for white noise",
    "evidence": "with correlated noise and the choice of orders allowed for",
    "cluster": "by the scatter between runs",
    "correlated": "with noise that is correlated in time",
}


def _table(fit: FittedCoefficients, shown: ErrorUnit) -> list[str]:
    model = fit.model
    with_std = model.covariance is not None
    amplitudes, phases = model.amplitudes, model.phases
    amplitude_std = fit.amplitude_std if with_std else np.full(amplitudes.size, np.nan)
    phase_std = fit.phase_std if with_std else np.full(amplitudes.size, np.nan)
    width = max([5, *(len(shaft.name) for shaft in model.shafts)])
    table = f"  {{:<{width}}}  {{:>5}}  {{:>10}} {{:>7}}  {{:>8}} {{:>6}}"
    lines = [table.format("shaft", "order", "amplitude", "+-", "phase", "+-")]
    lines += [table.format("", "", shown.name, shown.name, "deg", "deg")]
    rows = ((shaft, i) for shaft in model.shafts for i in range(len(shaft.orders)))
    for n, (shaft, i) in enumerate(rows):
        size, spread = shown.pair(
            arcsec(float(amplitudes[n]), model.period),
            arcsec(float(amplitude_std[n]), model.period),
        )
        phase, phase_std_text = rounded_phase(math.degrees(phases[n]), math.degrees(phase_std[n]))
        lines.append(table.format(shaft.name, shaft.orders[i], size, spread, phase, phase_std_text))
    return lines


def plain_fit(found: FittedCoefficients) -> dict[str, Any]:
    """The fit with the same names for every method; angles in arcsec."""
    period = found.model.period
    record = found.model.fit
    return {
        "readings": found.readings,
        "missing": found.missing,
        "runs": 0 if record is None else record.runs,
        "residual_arcsec": finite_or_none(arcsec(found.residual_std, period)),
        "condition_number": finite_or_none(found.condition_number),
        "method": found.method,
        "argument": found.model.argument,
        "ridge": found.ridge,
        "offset_spread_arcsec": arcsec(found.offset_spread, period),
        "covariance": found.uncertainty.kind,
        "intervals_hold": [
            "noise",
            *(["ridge"] if found.ridge > 0.0 else []),
            *(["prior"] if found.posterior is not None else []),
        ],
        "prior": None
        if found.posterior is None
        else {"units": found.posterior.units, "own_share": found.posterior.share},
        "wild": [list(place) for place in found.wild],
        "orders": [
            {
                "shaft": shaft,
                "order": order,
                "amplitude_arcsec": arcsec(float(found.amplitudes[n]), period),
                "phase_deg": math.degrees(float(found.phases[n])) % 360.0,
                **_standard_error(found, n),
            }
            for n, (shaft, order) in enumerate(
                (shaft.name, order) for shaft in found.model.shafts for order in shaft.orders
            )
        ],
        "evidence": _evidence(found),
        **({} if found.model.channels is None else {"channels": found.model.channels.to_dict()}),
        "notes": list(found.notes),
    }


def _evidence(found: FittedCoefficients) -> list[dict[str, Any]]:
    """The evidence for every order that was looked at; empty where the orders were given."""
    scale = arcsec(1.0, found.model.period)
    return [
        {
            "shaft": "output",
            **plain_fields(row, "order retained probability"),
            "amplitude_arcsec": finite_or_none(scale * row.amplitude),
            "std_arcsec": finite_or_none(scale * row.standard_error),
            "phase_deg": finite_or_none(row.phase_deg % 360.0),
            **plain_fields(row, "holdout_gain reason"),
        }
        for row in (() if found.selection is None else found.selection.table)
    ]


def _standard_error(found: FittedCoefficients, n: int) -> dict[str, Any]:
    """Standard error and 95 % interval of one amplitude; null where they are not known."""
    if found.model.covariance is None:
        return {"std_arcsec": None, "interval_arcsec": None}
    period = found.model.period
    return {
        "std_arcsec": finite_or_none(arcsec(float(found.amplitude_std[n]), period)),
        "interval_arcsec": [arcsec(v, period) for v in found.amplitude_interval()[n].tolist()],
    }
