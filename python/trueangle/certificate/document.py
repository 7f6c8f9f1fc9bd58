"""A certificate: its content as plain values, and the file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..fitting.summary import fit_error_unit
from ..runs.checks.check import check
from ..runs.run import CalibrationRun, as_runs
from ..runs.writing import provenance
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import told_kinds
from ..support.display_units import ErrorsIn
from ..support.plainresult import finite_or_none
from .budget import LEVEL, Budget, Contribution
from .conformity import conformity
from .identity import ENTRIES, Identity, load_identity
from .values import (
    corrected_runs,
    is_of_these,
    left_at_places,
    model_as_left,
    nominal_positions,
    reversal_halfwidth,
    values_at,
)

if TYPE_CHECKING:
    from ..fitting.result import FitResult
    from ..model.model import HarmonicModel

FORMAT: Final = "trueangle-certificate"
VERSION: Final = 1


@dataclass(frozen=True, eq=False)
class Certificate:
    """A calibration certificate.

    Attributes
    ----------
    content : dict
        All numbers and words, plain values: `save` adds nothing but the layout.
        Errors are in arcsec; ``errors_in`` states which unit the pages show.
        ``positions`` holds ``angle_deg, error_arcsec, standard_arcsec,
        degrees_of_freedom, coverage_factor, expanded_arcsec`` of every position;
        ``as_left`` the same as a model leaves it, ``conformity`` what `conformity` states;
        ``data_faults`` and ``coverage`` what `trueangle.check` reports of the readings.
    logo : path or None
        The picture in the head of the first page.
    """

    content: dict[str, Any]
    logo: str | None = None

    def save(self, path: str | PathLike[str]) -> None:
        """Write it as PDF/A-2b, complete or not at all.

        Raises
        ------
        MissingExtraError
            typst or matplotlib is not installed (``pip install trueangle[certificate]``).
        FileError
            A name that ends in another format's ending, a place that no file is written to,
            one of the files it was made from.
        """
        from .typesetting import write_pdf

        write_pdf(self.content, path, self.logo)


@told_kinds
def certify(
    runs: CalibrationRun | Iterable[CalibrationRun],
    identity: Identity | str | PathLike[str],
    *,
    orders: Iterable[float] | Mapping[str, Iterable[float]] | str | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    positions: int | None = None,
    fit: FitResult | None = None,
    model: HarmonicModel | str | PathLike[str] | None = None,
    errors_in: ErrorsIn = "auto",
) -> Certificate:
    """Value and expanded uncertainty of the error at every nominal position.

    ::

        U(θ) = k √(u_A(θ)² + u_p² + u_h² + Σ_i u_{B,i}²)

    with ``u_A`` from the whole covariance of the fit, ``u_p`` the error at single
    places that the series does not hold, ``u_h`` half of the reversal error where both
    directions were read, ``u_B`` as the identity file gives them, and k the quantile
    of Student's distribution for 95.45 % and the effective degrees of freedom (JCGM 100).

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    identity : Identity or path
        Who, what and where, and the type B contributions (`load_identity`).
    orders, gear_ratio, fixed_member, shafts
        As for `trueangle.fit`.
    positions : int, optional
        Nominal positions to a turn; by default those that were read where they are at most
        36, else 36.
    fit : FitResult, optional
        A fit of ``runs`` that is there already.
    model : HarmonicModel or path, optional
        What the joint is corrected by: the values as left, of the corrected readings, follow those
        as found, with their own budget and statement.
    errors_in : str or float
        Unit of every value and uncertainty of the pages: ``"arcsec"``, ``"deg"``,
        ``"mrad"``, ``"count"``, or the counts of a turn; ``"auto"`` is arcsec, or degrees
        where they are that large. The content stays in arcsec.

    Returns
    -------
    Certificate

    Raises
    ------
    ArgumentError
        A fit without covariance has no uncertainty to state; ``model`` needs a signal that the
        readings lack.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> theta = np.arange(0.0, 360.0, 10.0)
    >>> runs = [CalibrationRun(theta, theta + 0.01 * np.sin(np.radians(theta))
    ...                        + rng.normal(0.0, 1e-4, 36), period=360.0) for _ in range(3)]
    >>> reference = Contribution("polygon", 0.5)
    >>> made = certify(runs, Identity("1", "joint", contributions=(reference,)), orders=[1])
    >>> row = made.content["positions"][9]
    >>> row["angle_deg"], round(row["error_arcsec"]), round(row["expanded_arcsec"], 1)
    (90.0, 36, 1.0)
    """
    found = as_runs(runs)
    who = identity if isinstance(identity, Identity) else load_identity(identity)
    gear: dict[str, Any] = {
        "gear_ratio": gear_ratio,
        "fixed_member": fixed_member,
        "shafts": shafts,
    }
    if fit is None:
        fit = _fitted(found, orders, gear)
    angles = nominal_positions(fit, positions)
    valued = _valued(fit, angles, who)
    left = None
    if model is not None:
        by = model_as_left(model)
        same = {shaft.name: shaft.orders for shaft in fit.model.shafts}
        left = {
            "model": Path(model).name if isinstance(model, str | PathLike) else repr(by),
            "same_readings": is_of_these(by, found),
            **_valued(_fitted(corrected_runs(by, found), same, gear), angles, who),
        }
    checked = check(found).to_dict()
    unit = fit_error_unit(fit, errors_in)
    source = None if isinstance(identity, Identity) else str(Path(identity))
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "identity": {name: getattr(who, name) for name in ENTRIES},
        "language": who.language,
        "temperature_C": who.temperature_C,
        "temperature_recorded_C": (recorded := _recorded(found)),
        "not_stated": [
            name for name in who.not_stated if name != "temperature_C" or recorded is None
        ],
        "errors_in": {"unit": unit.name, "per_arcsec": unit.per_arcsec},
        "level_percent": 100.0 * LEVEL,
        "argument": fit.model.argument,
        **valued,
        "as_left": left,
        "harmonics": _harmonics(fit, _degrees_of_freedom(fit)),
        "readings": _readings(fit),
        "data_faults": checked["data_faults"],
        "coverage": {name: checked[name] for name in ("directions", "span_deg", "cannot")},
        "notes": list(fit.notes),
        "aliases": _aliases(fit),
        "provenance": provenance(found, source),
    }
    return Certificate(content, who.logo)


def _fitted(runs: list[CalibrationRun], orders: Any, gear: dict[str, Any]) -> FitResult:
    """The fit, jointly with a reversal error where one is found; that has a separate line.

    In the residuals it would be autocorrelated noise, and count twice.
    """
    from ..fitting.fit import fit

    found = fit(runs, orders, **gear)
    half = reversal_halfwidth(found)
    if half is None or half.standard == 0.0:
        return found
    return fit(runs, orders, nuisance="direction", **gear)


def _valued(fit: FitResult, angles: NDArray[np.float64], who: Identity) -> dict[str, Any]:
    """Values with their uncertainty, the widest budget, and what is stated of them."""
    if fit.model.covariance is None or not math.isfinite(fit.residual_std):
        raise ArgumentError(
            "there are as many unknowns as readings, so no uncertainty can be estimated: "
            "read more positions, or fit fewer orders"
        )
    values = values_at(fit, angles)
    shared = [item for item in (left_at_places(fit), reversal_halfwidth(fit)) if item is not None]
    shared += list(who.contributions)
    freedom = _degrees_of_freedom(fit)
    budgets = [
        Budget((Contribution("fit of the readings", float(u), "A", "t", freedom), *shared))
        for u in values.standard
    ]
    widest = max(range(len(budgets)), key=lambda k: budgets[k].expanded)
    rows = [
        {
            "angle_deg": float(angle),
            "error_arcsec": float(error),
            "standard_arcsec": budget.standard,
            "degrees_of_freedom": finite_or_none(budget.degrees_of_freedom),
            "coverage_factor": budget.coverage_factor,
            "expanded_arcsec": budget.expanded,
        }
        for angle, error, budget in zip(values.angle_deg, values.error_arcsec, budgets, strict=True)
    ]
    return {
        "positions": rows,
        "budget": _budget(budgets[widest], float(values.angle_deg[widest])),
        "conformity": None if who.specification is None else conformity(who.specification, rows),
    }


def _recorded(runs: list[CalibrationRun]) -> dict[str, float] | None:
    """Mean, lowest and highest temperature of the readings; None where it was not recorded."""
    known = [run.temperature for run in runs if run.temperature is not None]
    values = np.concatenate(known) if known else np.zeros(0)
    values = values[np.isfinite(values)]
    if not values.size:
        return None
    return {
        "mean": float(values.mean()),
        "low": float(values.min()),
        "high": float(values.max()),
    }


def _degrees_of_freedom(fit: FitResult) -> float:
    """Of the fit's noise: the fewest of any coefficient, so that no U is too narrow."""
    return fit.uncertainty.fewest


def _budget(budget: Budget, angle_deg: float) -> dict[str, Any]:
    """The budget of the position with the greatest U."""
    return {
        "angle_deg": angle_deg,
        "lines": [
            {
                "name": item.name,
                "type": item.kind,
                "distribution": item.distribution,
                "standard_arcsec": item.standard,
                "sensitivity": item.sensitivity,
                "degrees_of_freedom": finite_or_none(item.degrees_of_freedom),
                "share_percent": share,
            }
            for item, share in zip(budget.contributions, budget.shares(), strict=True)
        ],
        "standard_arcsec": budget.standard,
        "degrees_of_freedom": finite_or_none(budget.degrees_of_freedom),
        "coverage_factor": budget.coverage_factor,
        "expanded_arcsec": budget.expanded,
    }


def _harmonics(fit: FitResult, freedom: float) -> list[dict[str, Any]]:
    """Amplitude and phase of every order with the expanded uncertainty of the fit."""
    factor = ARCSEC_PER_TURN / fit.model.period
    k = Budget((Contribution("fit", 1.0, "A", "t", freedom),)).coverage_factor
    rows = [(shaft, order) for shaft in fit.model.shafts for order in shaft.orders]
    return [
        {
            "shaft": shaft.name,
            "order": order,
            "amplitude_arcsec": factor * float(fit.amplitudes[n]),
            "amplitude_expanded_arcsec": k * factor * float(fit.amplitude_std[n]),
            "phase_deg": math.degrees(float(fit.phases[n])) % 360.0,
            "phase_expanded_deg": min(k * math.degrees(float(fit.phase_std[n])), 180.0),
        }
        for n, (shaft, order) in enumerate(rows)
    ]


def _readings(fit: FitResult) -> dict[str, Any]:
    factor = ARCSEC_PER_TURN / fit.model.period
    mounts = {
        round(float(m) * 360.0 / fit.model.period, 6)
        for run in fit.runs
        if run.mount is not None
        for m in (run.mount[0],)
    }
    return {
        "readings": sum(len(run) for run in fit.runs),
        "runs": len(fit.runs),
        "mounts": max(len(mounts), 1),
        "standard_deviation_arcsec": factor * fit.residual_std,
        "zero_deg": fit.model.constant * 360.0 / fit.model.period,
        "zero_spread_arcsec": factor * fit.offset_spread,
        "outliers": len(fit.wild),
    }


def _aliases(fit: FitResult) -> list[dict[str, Any]]:
    """Orders kept that these positions cannot distinguish from others."""
    if fit.selection is None:
        return []
    return [
        {"order": float(row.order), "aliases": [float(m) for m in row.aliases[:6]]}
        for row in fit.selection.table
        if row.retained and row.aliases
    ]
