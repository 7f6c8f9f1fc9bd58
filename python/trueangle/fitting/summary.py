"""Results as text. Errors are printed in arcsec, angles of phases in degrees."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..angles import arcsec, unit_name
from ..distributions import student_quantile

if TYPE_CHECKING:
    from .result import FitResult

__all__ = ["fit_summary"]


def fit_summary(fit: FitResult) -> str:
    """See `FitResult.summary`."""
    model = fit.model
    period = model.period
    readings = sum(len(run) for run in fit.runs)
    unit = unit_name(period)
    head = [
        ("readings", f"{readings} in {len(fit.runs)} run{'s' if len(fit.runs) > 1 else ''}"),
        ("argument", f"{model.argument} angle"),
        ("zero", f"{model.constant:.6g} {unit}" + _spread(fit)),
        ("residual", f"{arcsec(fit.residual_std, period):.2f} arcsec standard deviation, ")
        if math.isfinite(fit.residual_variance)
        else ("residual", "none left: as many unknowns as readings, "),
        ("solved by", f"{fit.method}, condition number {fit.condition_number:.3g}"),
    ]
    label, text = head[3]
    head[3] = (label, text + f"{fit.degrees_of_freedom:.6g} degrees of freedom")
    if model.covariance is not None:
        head.append(("intervals", _intervals(fit)))
    lines = ["Harmonic model of the angle error (error = indicated - reference)", ""]
    lines += [f"  {label:<10} {text}" for label, text in head]
    lines += ["", *_table(fit)]
    if fit.notes:
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(fit.notes, 1))]
    return "\n".join(lines)


def _spread(fit: FitResult) -> str:
    if len(fit.runs) < 2:
        return ""
    return (
        f", circular mean of {len(fit.runs)} runs that differ by "
        f"{arcsec(fit.offset_spread, fit.model.period):.2f} arcsec (standard deviation)"
    )


def _intervals(fit: FitResult) -> str:
    """By how many standard errors 95 % intervals reach, and whose covariance it is."""
    found = fit.uncertainty
    least, most = float(found.freedom.min()), float(found.freedom.max())
    near, far = (student_quantile(0.975, v) for v in (most, least))
    times = f"{far:.3g}" if far < near + 0.05 else f"{near:.3g} to {far:.3g}"
    return f"95 % within {times} standard errors, {_KINDS[found.kind]}"


_KINDS = {
    "white": "white noise",
    "cluster": "by the scatter between runs",
    "hac": "by the scatter of stretches of the readings",
}


def _table(fit: FitResult) -> list[str]:
    model = fit.model
    with_std = model.covariance is not None
    amplitude_std = fit.amplitude_std if with_std else np.full(model.amplitudes.size, np.nan)
    phase_std = fit.phase_std if with_std else np.full(model.amplitudes.size, np.nan)
    width = max([5, *(len(shaft.name) for shaft in model.shafts)])
    lines = [f"  {'shaft':<{width}}  order   amplitude     +-     phase     +-"]
    lines += [f"  {'':<{width}}            arcsec  arcsec       deg    deg"]
    rows = ((shaft, i) for shaft in model.shafts for i in range(len(shaft.orders)))
    for n, (shaft, i) in enumerate(rows):
        lines.append(
            f"  {shaft.name:<{width}}  {shaft.orders[i]:5d}  "
            f"{arcsec(model.amplitudes[n], model.period):10.3f} "
            f"{arcsec(amplitude_std[n], model.period):7.3f}  "
            f"{math.degrees(model.phases[n]) % 360.0:8.2f} "
            f"{min(math.degrees(phase_std[n]), 180.0):6.2f}"
        )
    return lines
