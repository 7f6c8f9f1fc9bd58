"""The model that a fit makes: its coefficients and covariance, its record, its limits."""

from __future__ import annotations

import math
from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from .._core import __version__
from ..errors import ArgumentError
from ..estimation.reference import design_matrix
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.records import FitRecord, Provenance
from ..runs.channelangle import common_channels
from ..runs.checks.check import channel_faults
from ..runs.checks.record import records_of
from ..runs.checks.rows import duplicate_rows, duplicate_runs, missed_counts
from ..support.angles import arcsec, wrap
from ..support.arrays import Array
from ..support.display_units import error_unit, sine_of_rms
from ..support.distributions import student_quantile
from ..support.layout import counted, run_name
from .decoded import track_readings
from .fitdata import FitData
from .orders.table import UNDETERMINED
from .rounding import COUNTED

if TYPE_CHECKING:
    from .orders.result import OrderSelection


def _build_model(fit: FittedCoefficients) -> HarmonicModel:
    """The fitted series with its covariance, record and provenance."""
    condition = fit.fitted.solution.condition_number
    sources = dict.fromkeys(run.source for run in fit.problem.runs if run.source is not None)
    return fit.model_with_covariance.replace(
        condition_number=condition if np.isfinite(condition) else None,
        fit=_record(fit),
        provenance=Provenance(tuple(sources), f"trueangle {__version__}"),
        indicated_sign=fit.problem.indicated_sign,
        channels=common_channels(fit.problem.runs),
    )


def _fit_notes(fit: FittedCoefficients) -> Iterable[str]:
    """What not to trust and why, one sentence each."""
    span, weighted, channels = fit.span, fit.weighted, common_channels(fit.problem.runs)
    if not span.full:
        # In degrees, like the zeros and positions reported next to it.
        turn = 360.0 / fit.problem.period
        travel = span._replace(start=span.start * turn, stop=span.stop * turn)
        yield f"Fitted on {travel.describe(360.0)} only: outside it is extrapolated."
    if fit.missing:
        dropouts = "" if channels is None else "off the channels' curve or "
        yield f"{counted(fit.missing, 'row')} {dropouts}with an empty cell omitted."
    if channels is not None and channels.second is not None:
        from ..estimation.tracks import Mismatch  # a fit without a second track does not need it

        yield _sentence(Mismatch.of(channels, track_readings(fit.problem.runs)).says)
    yield from (_sentence(remark) for remark in fit.remarks)
    records = records_of(fit.runs) if fit.moments is None else []
    for test in (channel_faults, duplicate_runs, duplicate_rows, missed_counts):
        yield from (_sentence(f"{fault.says}; {fault.mend}") for fault in test(records))
    if fit.ridge > 0.0:
        where = "arc" if fit.problem.is_periodic else "travel"
        yield (
            f"On this {where} the orders nearly cancel: a ridge of {fit.ridge:.1e} keeps the "
            "amplitudes small; single coefficients have no meaning. Standard "
            "errors and intervals include the bias of the ridge, for "
            "patterns of this size, on average over the travel."
        )
    if weighted.wild:
        rows = [f"reading {row + 1} of {run_name(label)}" for label, row in sorted(fit.wild)[:3]]
        rows += ["..."] * (weighted.wild > 3)
        yield f"{counted(weighted.wild, 'outlier')} rejected: {', '.join(rows)}."
    errors = fit.standard_errors
    if errors is not None and errors[0].size and (fit.amplitudes < 2.0 * errors[0]).all():
        yield _undetermined(fit)
    if fit.uncertainty.note:
        yield _sentence(fit.uncertainty.note)
    if (fit.joint[0] or 0.0) < 0.0 and not any("motor" in run.signals for run in fit.problem.runs):
        yield (
            "The sign of the gear ratio does not show: only orders of the wave generator depend on "
            "it; record a column motor_deg to have it checked."
        )
    fractional = [s.name for s in fit.problem.shafts if s.cycles_per_turn % 1.0]
    if fractional:
        yield (
            f"Shaft {', '.join(fractional)} does not turn a whole number of times per output "
            "turn: the error does not repeat after one turn, angles must be unwrapped."
        )
    if fit.evidence is not None and fit.evidence.notes:
        yield from map(_sentence, fit.evidence.notes)
    elif (verified := _verified(fit)) is not None:
        yield _sentence(verified[1])


def _undetermined(fit: FittedCoefficients) -> str:
    """What a curve is good for of which no amplitude is twice its standard error."""
    size, error = (arcsec(x, fit.problem.period) for x in fit.curve_and_error)
    before = arcsec(fit.rms_before, fit.problem.period)
    unit = error_unit("auto", sine_of_rms(before), fit.problem.period)
    curve = f"{' +- '.join(unit.pair(size, error))} {unit.name}"
    if size >= 2.0 * error:
        return (
            f"No single amplitude is twice its standard error; the curve, of {curve}, is "
            "determined where it was read."
        )
    needed = math.ceil(len(fit.problem.runs) * (2.0 * error / max(size, 1e-300)) ** 2)
    chosen = '; or let `orders="auto"` choose' * (fit.evidence is None)
    return (
        f"{UNDETERMINED}the fitted error, {curve}, is below twice its standard error. Do not rely "
        f"on it: about {needed:.3g} runs like these in all would determine it{chosen}."
    )


def _sentence(note: str) -> str:
    return f"{note[:1].upper()}{note[1:]}."


def _record(fit: FittedCoefficients) -> FitRecord:
    problem, solution = fit.problem, fit.fitted.solution
    variance = solution.residual_variance
    used = fit.offsets[np.isfinite(fit.offsets)]
    around = wrap(used - solution.constant, problem.period)
    verified = _verified(fit)
    return FitRecord(
        samples=problem.readings,
        runs=len(problem.runs),
        span=(fit.span.start, fit.span.stop),
        residual=math.sqrt(variance) if math.isfinite(variance) else None,
        method=solution.method,
        loss=fit.loss,
        wild=fit.weighted.wild,
        ridge=fit.ridge,
        offsets=tuple(used.tolist()),
        offset_spread=float(around.std(ddof=1)) if used.size > 1 else 0.0,
        positions=None if verified is None else verified[0],
        note=" ".join(fit.notes),
        freedom=_scattered(fit),
    )


def _scattered(fit: FittedCoefficients) -> float | None:
    """Degrees of freedom of a covariance by scatter; None of white noise, and where there is none.

    Of white noise they are readings less unknowns.
    """
    found = fit.uncertainty
    known = found.kind != "white" and math.isfinite(found.fewest)
    return float(found.fewest) if known else None


def _verified(fit: FittedCoefficients) -> tuple[int, str] | None:
    """Distinct positions and where the model is verified; None for free or many angles."""
    from .orders.verdicts import verified_positions

    runs = fit.problem.runs
    if fit.problem.readings > COUNTED:
        return None
    verified = verified_positions(runs, *fit.joint)
    return None if verified.between else (verified.count, verified.sentence)


class FittedCoefficients(FitData):
    """The model of a fit, and its coefficients with their uncertainty."""

    @cached_property
    def bare_model(self) -> HarmonicModel:
        """The fitted coefficients alone, which are all that a correction takes."""
        problem, solution = self.problem, self.fitted.solution
        parts = zip(problem.shafts, solution.cosine, solution.sine, strict=True)
        shafts = [
            Shaft(shaft.name, shaft.cycles_per_turn, shaft.orders, tuple(a), tuple(b))
            for shaft, a, b in parts
        ]
        return HarmonicModel(tuple(shafts), solution.constant, problem.period, problem.argument)

    @cached_property
    def model_with_covariance(self) -> HarmonicModel:
        """The fitted coefficients with their covariance, without the record of this fit."""
        covariance = self.uncertainty.covariance
        return self.bare_model.replace(
            covariance=covariance if np.isfinite(covariance).all() else None
        )

    @cached_property
    def model(self) -> HarmonicModel:
        """The fitted model, with its covariance and the record of this fit."""
        return _build_model(self)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What not to trust and why."""
        return tuple(_fit_notes(self))

    @cached_property
    def selection(self) -> OrderSelection | None:
        """The evidence, when the orders were chosen by it; retained ones as they are fitted."""
        return (
            None
            if self.evidence is None
            else self.evidence.as_fitted(self.model, self.standard_errors)
        )

    @property
    def offset_spread(self) -> float:
        """Standard deviation of the runs' zeros about their circular mean."""
        return 0.0 if self.model.fit is None else self.model.fit.offset_spread

    @property
    def standard_errors(self) -> tuple[Array, Array] | None:
        """Of amplitudes and phases; None where no residual is left to take them from."""
        told = self.model_with_covariance.covariance is not None
        return (self.amplitude_std, self.phase_std) if told else None

    @property
    def covariance(self) -> Array:
        """Of ``[constant, A, B of each order of each shaft in turn]``."""
        if self.model_with_covariance.covariance is None:
            raise ArgumentError(
                "no covariance: as many unknowns as readings leave no residual to take it from"
            )
        return self.model_with_covariance.covariance

    def interval(self, level: float = 0.95) -> Array:
        """Intervals that hold the true coefficients at this level.

        ::

            b_i ± t_{(1+p)/2,ν_i} u(b_i)

        with Student's quantile for the effective degrees of freedom of each standard error:
        few runs show a standard error roughly.

        Parameters
        ----------
        level : float
            Between 0 and 1.

        Returns
        -------
        ndarray, shape (coefficients, 2)
            Low and high end for ``[constant, A, B of each order of each shaft in turn]``.

        Examples
        --------
        >>> import trueangle as ta
        >>> theta = np.arange(0.0, 360.0, 5.0)
        >>> noise = np.random.default_rng(1).normal(0.0, 0.01, theta.size)
        >>> run = ta.CalibrationRun(theta, theta + 0.5 * np.sin(np.radians(theta)) + noise, 360.0)
        >>> low, high = ta.fit(run, orders=[1]).interval()[2]
        >>> bool(low < 0.5 < high)
        True
        """
        pairs = [(a, b) for s in self.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
        values = np.concatenate([[self.model.constant], np.ravel(pairs)])
        return self._around(values, np.sqrt(np.diag(self.covariance)), self.freedom, level)

    def amplitude_interval(self, level: float = 0.95) -> Array:
        """Intervals of `amplitudes`, as `interval`; the low end is 0 at least.

        Right where the amplitude is well above its standard error (`amplitude_std`).
        """
        both = self.freedom[1:].reshape(-1, 2).min(axis=1)
        found = self._around(self.amplitudes, self.amplitude_std, both, level)
        return np.asarray(np.maximum(found, 0.0))

    @property
    def curve_and_error(self) -> tuple[float, float]:
        """Amplitude of the fitted curve, and its standard error, in the unit of the runs.

        ::

            2 mean_i g_iᵀ b bᵀ g_i, mean_i g_iᵀ V g_i

        are their squares, over the places read, with rows ``g_i`` of the series less their mean,
        coefficients b and their covariance V.
        """
        places = np.concatenate(self.problem.angles)
        # Readings at whose places the two are compared.
        places = places[:: 1 + places.size // 512]
        shafts = [(shaft.cycles_per_turn, shaft.orders) for shaft in self.bare_model.shafts]
        rows = design_matrix(places, shafts, self.problem.period)
        rows = (rows - rows.mean(axis=0))[:, 1:]
        shown = [(s.cosine, s.sine) for s in self.bare_model.shafts]
        pairs = np.concatenate([np.column_stack(pair) for pair in shown])
        error = np.einsum("ij,jk,ik->i", rows, self.covariance[1:, 1:], rows)
        curve = math.sqrt(2.0) * np.std(rows @ pairs.ravel())
        return float(curve), math.sqrt(float(np.mean(error)))

    @property
    def freedom(self) -> Array:
        """Effective degrees of freedom of each variance in the diagonal of `covariance`."""
        return self.uncertainty.freedom

    @staticmethod
    def _around(values: Array, std: Array, freedom: Array, level: float) -> Array:
        if not 0.0 < level < 1.0:
            raise ArgumentError(f"level must lie between 0 and 1, got {level!r}")
        times = np.array([student_quantile(0.5 + 0.5 * level, float(v)) for v in freedom])
        return np.asarray(np.column_stack([values - times * std, values + times * std]))

    @property
    def orders(self) -> tuple[float, ...]:
        """Output orders of all harmonics, shaft by shaft."""
        return self.bare_model.orders

    @property
    def amplitudes(self) -> Array:
        """``C_k`` of all harmonics."""
        return self.bare_model.amplitudes

    @property
    def phases(self) -> Array:
        """``phi_k`` in radians of all harmonics."""
        return self.bare_model.phases

    @cached_property
    def amplitude_std(self) -> Array:
        """Standard error of every amplitude, to first order from the covariance.

        ::

            u(C)² = (A² u_A² + B² u_B² + 2 A B u_AB) / C²

        Where ``C`` is not well above it the amplitude is Rice distributed and this is a
        lower bound: judge such orders by (A, B) and their covariance (JCGM 102).
        """
        return self._polar_std(along=True)

    @cached_property
    def phase_std(self) -> Array:
        """Standard error of every phase in radians.

        ::

            u(φ)² = (B² u_A² + A² u_B² - 2 A B u_AB) / C⁴
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return self._polar_std(along=False) / self.amplitudes

    def _polar_std(self, along: bool) -> Array:
        a = np.concatenate([np.zeros(0), *(s.cosine for s in self.bare_model.shafts)])
        b = np.concatenate([np.zeros(0), *(s.sine for s in self.bare_model.shafts)])
        index = 1 + 2 * np.arange(a.size)
        cov = self.covariance
        aa, bb, ab = cov[index, index], cov[index + 1, index + 1], cov[index, index + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = (a, b) / np.hypot(a, b) if along else (b, -a) / np.hypot(a, b)
        # A zero amplitude has no direction: any will do.
        u, v = np.where(np.isfinite(u), u, 1.0), np.where(np.isfinite(v), v, 0.0)
        return np.asarray(np.sqrt(np.maximum(u * u * aa + v * v * bb + 2.0 * u * v * ab, 0.0)))
