"""Errors at nominal positions: of a fit, of its residuals, of reversal; runs after correction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..estimation.reference import design_matrix
from ..model.file import load_model
from ..model.model import HarmonicModel
from ..plots.curves import fitted_degrees
from ..runs.aliasing import POSITION_TOLERANCE, distinct_positions
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from ..support.distributions import f_tail
from .budget import LEVEL, Contribution, propagated

if TYPE_CHECKING:
    from ..fitting.result import FitResult

#: Nominal positions of a whole turn where none are requested.
POSITIONS: Final = 36

#: Nominal positions at most: a certificate is read by people.
_MOST_POSITIONS: Final = 720

#: Places of a turn among which errors that the series lacks are looked for.
_PLACES: Final = 360


@dataclass(frozen=True, eq=False)
class Values:
    """Error at nominal positions, relative to its mean over them, in arcsec.

    Attributes
    ----------
    angle_deg : ndarray, shape (n,)
    error_arcsec : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
        From the fit's whole covariance, in arcsec squared: the values are correlated, since
        every coefficient enters all of them.
    """

    angle_deg: Array
    error_arcsec: Array
    covariance: Array

    @property
    def standard(self) -> Array:
        """Type A standard uncertainty of every value."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def nominal_positions(fit: FitResult, count: int | None = None) -> Array:
    """Nominal positions in degrees.

    Those that were read, where they are a grid of at most 36 and no other count is
    requested; else ``count`` (36) to a turn, and on partial travel those that it covers.

    Raises
    ------
    ArgumentError
        A count outside 2 to 720, or fewer than two positions on the travel.
    """
    if count is not None and not (isinstance(count, int) and 2 <= count <= _MOST_POSITIONS):
        raise ArgumentError(
            f"positions must be a whole number from 2 to {_MOST_POSITIONS}, got {count!r}"
        )
    if count is None:
        read = distinct_positions(fit.runs)
        if 2 <= len(read) <= POSITIONS:
            return _rounded(read.turns * 360.0)
    low, high = fitted_degrees(fit.model)
    pitch = 360.0 / (count or POSITIONS)
    first = int(np.ceil(low / pitch - 1e-9))
    last = (
        int(np.ceil(high / pitch - 1e-9)) if high - low >= 360.0 else int(high / pitch + 1e-9) + 1
    )
    angles = pitch * np.arange(first, last)
    if angles.size < 2:
        raise ArgumentError(
            f"the travel from {low:.6g} to {high:.6g} deg holds fewer than two of "
            f"{count or POSITIONS} positions a turn: use more positions"
        )
    return np.asarray(angles, dtype=np.float64)


def _rounded(read_deg: Array) -> Array:
    """Positions as they were meant: with the fewest decimals that keep each the place it is."""
    tolerance = 360.0 * POSITION_TOLERANCE
    decimals = (np.round(read_deg, n) for n in range(3))
    meant = next(deg for deg in decimals if np.abs(deg - read_deg).max() < tolerance)
    return np.unique(np.mod(meant, 360.0))


def values_at(fit: FitResult, angles_deg: Array) -> Values:
    """Error of the fitted series at ``angles_deg``, its mean over them taken away.

    ::

        e = (I - 1 1ᵀ / n) Gβ,    V = (·) cov(β) (·)ᵀ

    with a row of regressors G for every position. The zero of the joint is set at the
    machine; taking the mean away leaves what a setting of the zero cannot remove.
    """
    model = fit.model
    shafts = [(shaft.cycles_per_turn, shaft.orders) for shaft in model.shafts]
    rows = design_matrix(angles_deg * (model.period / 360.0), shafts, model.period)
    rows = rows - rows.mean(axis=0)
    pairs = [(a, b) for s in model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
    beta = np.array([model.constant, *np.ravel(pairs)])
    scale = ARCSEC_PER_TURN / model.period
    return Values(angles_deg, scale * (rows @ beta), scale**2 * propagated(rows, fit.covariance))


def left_at_places(fit: FitResult) -> Contribution:
    """Standard deviation over the places of the turn of what the series does not hold.

    With ``m_pr`` the mean residual of run r at place p, noise is independent from
    run to run and the error left at a place is not:

    ::

        s² = mean_p [((Σ_r m_pr)² - Σ_r m_pr²) / (R_p (R_p - 1))]

    It counts where the places scatter more than noise makes them at the level of U,

    ::

        F = [Σ_p R_p m̄_p² / ν_1] / [Σ_pr (m_pr - m̄_p)² / ν_2],

    with ν_1 the places less the coefficients of the fit and ν_2 the readings again of places
    less the zeros of further runs (a test of lack of fit). One run alone cannot show it.
    """
    name = "error that the series does not hold"
    places, runs, sizes, rest = _by_place(fit)
    total, squares, count = (np.zeros(_PLACES) for _ in range(3))
    scale = ARCSEC_PER_TURN / fit.model.period
    means = scale * rest / sizes
    np.add.at(total, places, means)
    np.add.at(squares, places, means**2)
    np.add.at(count, places, 1.0)
    repeated = count > 1.0
    total, squares, count = total[repeated], squares[repeated], count[repeated]
    unknowns = 1 + 2 * sum(len(shaft.orders) for shaft in fit.model.shafts)
    freedom = float(count.size - unknowns)
    again = float((count - 1.0).sum() - len(set(runs.tolist())) + 1)
    if freedom < 1.0 or again < 1.0:
        return Contribution(name, 0.0, "A", "t")
    variance = float(((total**2 - squares) / (count * (count - 1.0))).mean())
    of_places = float((total**2 / count).sum())
    noise = max(float(squares.sum()) - of_places, 1e-20 * of_places)
    seen = f_tail(of_places / freedom * again / noise, freedom, again) < 1.0 - LEVEL
    return Contribution(
        name, math.sqrt(max(variance, 0.0)) if seen else 0.0, "A", "t", float(count.size)
    )


def reversal_halfwidth(fit: FitResult) -> Contribution | None:
    """Half of the reversal error, where both directions were read and it is significant.

    ::

        h = Σ d r / Σ d²,    ν = (h / u(h))² / 2

    per run, its standard error u from the scatter over the runs (over the readings for one
    run or two), and the degrees of freedom of what is known so well (JCGM 100, G.4.2). The values
    then hold for the mean of both directions, and a reading is off by ``+h`` or ``-h``. None
    where one direction only was read.
    """
    scale = ARCSEC_PER_TURN / fit.model.period
    taken = 0.0 if fit.nuisance is None else fit.nuisance.half_width
    parts = np.split(fit.residuals, np.cumsum([len(run) for run in fit.runs])[:-1])
    halves, errors = [], []
    for run, rest in zip(fit.runs, parts, strict=True):
        way = run.direction - run.direction.mean()
        energy = float(way @ way)
        if len(run) > 2 and energy > 0.05 * len(run):
            half = float(way @ rest) / energy
            halves.append(scale * (half + taken))
            spread = rest - half * way
            errors.append(scale * float(np.sqrt(spread @ spread / (len(run) - 2) / energy)))
    if not halves:
        return None
    half = float(np.mean(halves))
    count = len(halves)
    error = float(np.std(halves, ddof=1) / np.sqrt(count)) if count > 2 else float(np.max(errors))
    name = "half the reversal error"
    # Standard errors beyond which a reversal is significant. Below it is noise, and adding noise to
    # the budget would make every U too wide.
    if abs(half) <= 3.0 * error:
        return Contribution(name, 0.0, "A", "two-point")
    freedom = 0.5 * (half / error) ** 2 if error > 0.0 else np.inf
    return Contribution(name, abs(half), "A", "two-point", freedom)


def _by_place(
    fit: FitResult,
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Place, run, readings and sum of residuals of every place that a run has read."""
    place, of_run = [], []
    for number, run in enumerate(fit.runs):
        turns = np.mod(run.reference / run.period, 1.0)
        place.append(np.minimum((turns * _PLACES).astype(np.intp), _PLACES - 1))
        of_run.append(np.full(len(run), number, dtype=np.intp))
    cell = np.concatenate(of_run) * _PLACES + np.concatenate(place)
    used = np.ones(cell.size, dtype=bool)
    if fit.weights is not None:
        used = np.concatenate([weights > 0.0 for weights in fit.weights])
    cells, inverse = np.unique(cell[used], return_inverse=True)
    sizes = np.bincount(inverse).astype(np.float64)
    sums = np.bincount(inverse, weights=fit.residuals[used])
    return cells % _PLACES, cells // _PLACES, sizes, np.asarray(sums, dtype=np.float64)


def model_as_left(model: HarmonicModel | str | PathLike[str]) -> HarmonicModel:
    """The model itself, or that of a file."""
    if isinstance(model, HarmonicModel):
        return model
    return load_model(model)


def corrected_runs(model: HarmonicModel, runs: Sequence[CalibrationRun]) -> list[CalibrationRun]:
    """Runs with indicated angles corrected by the model, signals included.

    Raises
    ------
    ArgumentError
        The model needs a signal that a run does not have.
    """
    return [_corrected(model, run) for run in runs]


def _corrected(model: HarmonicModel, run: CalibrationRun) -> CalibrationRun:
    turn = model.period / run.period
    signals: dict[str, Any] = {}
    for name in model.uses_signals:
        values = {"direction": run.direction, "velocity": run.speed}.get(name)
        values = run.signal(name) if values is None else values
        if values is None and name in model.signals:
            raise ArgumentError(
                f"the model needs {name}, which the readings lack: record it, or take a model of "
                "the angle alone"
            )
        if values is not None:
            signals[name] = values * turn if name == "velocity" else values
    angle = np.asarray(model.correct(run.indicated * turn, **signals)) / turn
    return replace(run, indicated=angle)


def is_of_these(model: HarmonicModel, runs: Sequence[CalibrationRun]) -> bool:
    """Whether files of these readings are among those that the model was fitted to."""
    fitted = {source.sha256 for source in model.provenance.inputs} if model.provenance else set()
    return any(run.source is not None and run.source.sha256 in fitted for run in runs)
