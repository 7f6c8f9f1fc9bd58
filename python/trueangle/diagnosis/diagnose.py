"""Diagnose: compare runs with a simulation and name what it lacks."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ..effects import EFFECTS, Curve
from ..effects.wrong_gear_ratio import WrongGearRatio
from ..errors import ArgumentError
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.signals import join_runs
from ..runs.checks.check import data_faults
from ..runs.checks.record import records_of
from ..runs.checks.rows import without_old_samples
from ..runs.files import runs_of
from ..runs.run import CalibrationRun
from ..runs.source import ReadingOptions
from ..simulation.simulation import SIMULATION, Simulation
from ..support.argumentkinds import of_type, told_kinds
from ..support.blas import one_blas_thread
from ..support.deadline import Deadline, current_deadline, with_deadline
from .account import MOST_READINGS, account_of
from .candidates import candidates_above
from .confirmation import NOT_CONFIRMED
from .delay import delay_factor, delay_finding
from .discrepancy import discrepancy_of, unfolded_error
from .drive import diagnose_drive
from .finding import Finding
from .findings import equal_scatter, scatter_doubt, scatter_finding
from .gates import many_causes, not_the_only_ratio
from .gearedlines import GearedLinesRatio
from .goodness import Unexplained, goodness_of_fit
from .judgedbeliefs import judged_beliefs, misplaced_beliefs
from .naming import named_causes
from .penalty import regression_without
from .remainder import leftover_of
from .result import Diagnosis
from .rounding import rounding_of
from .unseenorders import arc_note

if TYPE_CHECKING:
    from ..runs.joining import MeasuredMinusSimulated

#: Fewest readings that can support a cause.
LEAST_READINGS = 20

#: Standard deviations beyond which readings are outliers whatever the mean.
OUTLYING_ANYWAY = 12.0

#: Share of the time given after which the choice of causes ends.
FOR_CHOICE = 0.7


@told_kinds
def diagnose(
    runs: Any,
    sim: Simulation | None = None,
    *,
    simulated: Any = None,
    gain: bool = True,
    within: float | None = None,
    progress: str = "none",
    **reading: Unpack[ReadingOptions],
) -> Diagnosis:
    """Name the physical causes that a simulation of the joint lacks.

    Every cause of the vocabulary is a nested extension of

    ::

        y = ε_measured - ε_simulated = Xβ + Σ_j Z_j u_j + n

    with the zero and the lines of the simulation always free in X. It is chosen by the
    likelihood with a penalty of ``k ln n_e + 2 ln(grid)``, ``n_e`` the readings
    or runs that inform on a parameter, and 6 for a new cause, forward and then backward;
    a further cause must also bring 0.1 % of what the others explain, as no form is exact;
    correlated noise is whitened, outliers are clipped at four standard deviations,
    and errors that are new in every run enter as random effects. Causes that the design of
    the runs cannot separate are determined first and not named.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        Time, velocity, torque, temperature and mount where known; files, folders, patterns and
        tables in memory as `trueangle.read_runs` takes them.
    sim : Simulation, optional
        The assumed model; may be omitted where there is a log.
    simulated : path, table, iterable of CalibrationRun or MeasuredMinusSimulated, optional
        The log of any other simulator of the same motion
        (`trueangle.runs.joining.minus_simulated`): it is subtracted from the readings, and ``sim``
        and its extension describe the difference. Where both have the torque of the drive, that is
        accounted for as well (`Diagnosis.torque`).
    gain : bool
        Measure the gain on held-out runs (about half of the time).
    within : float, optional
        Seconds that it may take. By itself work is counted and no clock looked at, so that the
        same readings give the same account on any machine, however busy; ordinary ones need a
        sixth of what may be done. When either is up, the account so far is returned and marked
        as incomplete (`Diagnosis.complete`, ``notes``): causes may be missing, and what was
        not held out is not confirmed. Seven tenths of the time are for the choice of causes.
    progress : {"none", "auto", "text", "json"}
        What is done and how much is left, on stderr, after the first second; ``"auto"`` is
        text on a terminal and nothing elsewhere.
    **reading
        ``signals``, ``period``, ``by`` ... of files and tables, as in `trueangle.read_runs`.

    Returns
    -------
    Diagnosis

    Raises
    ------
    ArgumentError
        No run, too few readings, neither a simulation nor a log, or a time that is not above
        zero.

    Notes
    -----
    Readings at a turning point, where the joint turned and has not moved, take no part: which way
    they were reached is not known. Up to 40 000 readings are used; of more, one of every n in
    a row is taken at random (seed 0), which keeps the angles free of a grid. About 0.4 to
    1.5 s for 10 000 readings, on one processor: numpy's own threads are stopped meanwhile.
    Source: Frisch-Waugh projection; Schwarz (1978) and Kass and Wasserman (1995) for the
    penalty; Koenker (1981) for the variance.

    Examples
    --------
    >>> from trueangle.simulation import Backlash, RunDesign, Simulation, simulate
    >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),
    ...                                          RunDesign(reversals=(0.5,), speed_deg_s=30)))
    >>> runs = simulate(sim.with_effects([Backlash(3.0)]))
    >>> diagnose(runs, sim).findings[0].cause
    'backlash'
    """
    measured = runs_of(runs, reading)
    if sim is not None:
        of_type("sim", sim, Simulation, SIMULATION)
    log = None
    if simulated is not None:
        from ..runs.joining import MeasuredMinusSimulated, minus_simulated

        is_joined = isinstance(simulated, MeasuredMinusSimulated)
        log = simulated if is_joined else minus_simulated(measured, simulated)
    elif sim is None:
        raise ArgumentError("no simulation: give one, or a log as `simulated=`")
    used = min(sum(map(len, measured)), MOST_READINGS)
    with with_deadline(within, progress) as at, at.bounded(used), one_blas_thread():
        stated = Simulation() if sim is None else sim
        found = _diagnosis(measured, log, stated, gain)
        if log is None or not found.complete:
            return found
        joint = Simulation(stated.joint)
        torque = diagnose_drive(
            log, measured, lambda runs, drive: _diagnosis(runs, drive, joint, gain)
        )
        return replace(found, torque=torque)


def _diagnosis(
    measured: list[CalibrationRun],
    log: MeasuredMinusSimulated | None,
    stated: Simulation,
    gain: bool,
) -> Diagnosis:
    at = current_deadline()
    faults = data_faults(records_of(measured))
    runs, _ = without_old_samples(measured if log is None else log.runs)
    every = join_runs(runs)
    if len(every) < LEAST_READINGS:
        raise ArgumentError(
            f"{len(every)} readings cannot support a diagnosis: give at least {LEAST_READINGS}"
        )
    error = unfolded_error(runs)
    with at.part(FOR_CHOICE):
        account = account_of(every, error, stated)
    seen = account.seen
    sim, every, signals, rows = seen.sim, seen.every, seen.signals, seen.rows
    first, sigma = account.first, sim.sigma_arcsec or None
    named = named_causes(account.choice.chosen, account.choice.spots, gain, sigma)
    chosen, rest, spots, factors = named.chosen, named.rest, named.spots, named.factors
    findings = list(named.findings)
    # What a curve shows is no change of what is believed.
    curves = named.curves
    judged = _as_extended(chosen, findings, curves, sim) if curves else chosen
    beliefs, corrected = judged_beliefs(judged, sim, account.believed, spots, gain, named.moved)
    # What has no name may be what scatters.
    in_doubt = any(not factor.named_by for factor in factors)
    in_doubt |= any(spot.supported and not spot.common for spot in spots)
    spoilt = next((fault for fault in faults if fault.spoils_readings), None)
    for item in account.choice.scatter:
        if spoilt is not None or (in_doubt and item.size < OUTLYING_ANYWAY):
            spots.append(scatter_doubt(item, spoilt))
        elif equal := equal_scatter(item):
            spots.append(equal)
        else:
            findings.append(scatter_finding(item, rest))
    if seen.ratio is not None:
        found = _ratio_finding(seen.ratio)
        findings.append(found)
        if not found.confirmed:
            corrected = replace(corrected, joint=stated.joint)
    if seen.delay is not None:
        sure = regression_without(chosen, not_confirmed_terms(findings), settled=True)
        late = delay_finding(seen.delay, sure, first, gain and not at.over, rest)
        findings.append(late)
        factors = [
            *factors,
            delay_factor(late, seen.signals, float(np.var(first.readings.residual))),
        ]
        factors.sort(key=lambda factor: -factor.rms)
    findings.sort(key=lambda finding: (not finding.confirmed, -finding.evidence["bic_gain"]))
    shown = _less_curves(chosen, curves, sim) if curves else chosen
    if rest.found:
        rest = named.less_factors(sigma)
    extended = corrected.with_effects(
        [*(e for finding in findings if finding.confirmed for e in finding.effects), *curves]
    )
    beliefs, findings = misplaced_beliefs(beliefs, findings, sim)
    notes = [_incomplete(at, gain)] if at.cut else []
    notes += [text for text in (many_causes(findings), arc_note(chosen)) if text]
    residual = error - stated.predict(every)
    before = goodness_of_fit(
        leftover_of(first.signals, residual if rows is None else residual[rows], first.cache),
        float(first.lines.orders.max()),
        sigma,
    )
    return Diagnosis(
        discrepancy_of(every, residual),
        _structure(first),
        _noise(shown, rest),
        findings,
        spots,
        extended,
        _overall(first, _as_extended(chosen, findings, curves, sim)),
        len(every),
        len(signals),
        rest.noise.correlation,
        rest,
        before,
        beliefs,
        faults,
        notes,
        not at.cut,
        log,
        measured,
        factors=factors,
    )


def _as_extended(
    chosen: Regression, findings: list[Finding], curves: list[Curve], sim: Simulation
) -> Regression:
    """With what extends the simulation alone: confirmed causes and curves."""
    sure = {k for finding in findings if finding.confirmed for k in finding.group}
    others = [k for k in range(len(chosen.terms)) if k not in sure]
    named = regression_without(chosen, others, settled=True) if others else chosen
    return _less_curves(named, curves, sim) if curves else named


def _less_curves(regression: Regression, curves: list[Curve], sim: Simulation) -> Regression:
    """The same terms in readings less what curves show there."""
    shown = [curve.expected(regression.signals, sim.surroundings) for curve in curves]
    less = regression.of_readings(regression.readings.less(np.sum(shown, axis=0)))
    return less.with_terms(regression.terms)


def not_confirmed_terms(findings: list[Finding]) -> list[int]:
    """Terms of the findings that are not confirmed."""
    return [k for finding in findings if not finding.confirmed for k in finding.group]


def _incomplete(at: Deadline, gain: bool) -> str:
    """That the account was ended, while what, and what that means."""
    means = ", as few are tested on held-out data" * gain
    return f"INCOMPLETE: {at.why} while {at.cut}; names and sizes found by then may change{means}"


def _ratio_finding(ratio: GearedLinesRatio) -> Finding:
    """All lines of the geared shafts at another ratio, as one cause."""
    parameters = {
        "gear_ratio": quantity(ratio.gear_ratio, ratio.std),
        "believed_gear_ratio": quantity(ratio.believed),
        "share_found": quantity(ratio.found),
    }
    if ratio.alike:
        parameters["aliases"] = quantity(list(ratio.alike))
    z = (ratio.gear_ratio - ratio.believed) / max(ratio.std, 1e-300)
    evidence = {"bic_gain": min(z * z, 1e12)}
    found = Finding(WrongGearRatio.kind, parameters, evidence, None, [])
    reason = not_the_only_ratio(found)
    return replace(found, status=NOT_CONFIRMED, reason=reason) if reason else found


def _structure(start: Regression) -> dict[str, float]:
    """Share of the readings' variance that each cause explains alone, largest first."""
    before = start.left_within_runs
    alone = {}
    for cause in EFFECTS:
        extension = candidates_above(start, cause)
        if extension is not None and extension.bic_gain > 0.0:
            after = start.with_terms([extension], 0.0).left_within_runs
            alone[cause] = 1.0 - float(np.sum(after**2) / max(float(np.sum(before**2)), 1e-300))
    # Equal shares by name: their last digits differ from one processor to the next.
    return dict(sorted(alone.items(), key=lambda item: (-round(item[1], 6), item[0])))


def _noise(chosen: Regression, rest: Unexplained) -> float:
    """Standard deviation of one reading: that of the residual, where it is only noise."""
    if rest.found or int(np.count_nonzero(~chosen.outlying)) <= chosen.rank:
        return float(np.hypot(rest.noise.sigma, rounding_of(chosen)))
    return float(np.sqrt(chosen.variance_within_runs))


def _overall(before: Regression, after: Regression) -> dict[str, float]:
    """rms, peak-to-peak and max abs without and with all findings, fitted in the same way."""
    numbers = {}
    for name, regression in (("before", before), ("after", after)):
        left = regression.left_within_runs
        numbers[f"rms_{name}_arcsec"] = float(np.sqrt(np.mean(left**2)))
        numbers[f"peak_to_peak_{name}_arcsec"] = float(np.ptp(left))
        numbers[f"max_abs_{name}_arcsec"] = float(np.abs(left).max())
    return numbers
