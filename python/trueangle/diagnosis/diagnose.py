"""Diagnose: compare runs with a simulation and name what it lacks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS, Effect
from ..effects.missing_order import MissingOrder
from ..effects.scatter import NEW_SCATTER, ScatterFinding
from ..effects.search import line_parameters
from ..errors import ArgumentError
from ..joint.signals import join_runs
from ..regression.estimate import Parameters, quantity
from ..regression.regression import ROUNDING, Extension, Regression
from ..runs import CalibrationRun, as_runs
from ..simulation.simulation import Simulation
from .discrepancy import compare, noise_from_repeats, unfolded_error
from .findings import Diagnosis, Finding
from .gain import Gain, measure_gain
from .identifiability import Blindness, blind_spots, doubts_about
from .selection import (
    NEW_CAUSE,
    cause_terms,
    extensions,
    finding_groups,
    is_flexible,
    misfit,
    propose,
    select,
)

__all__ = ["MOST_READINGS", "diagnose"]

Array = NDArray[np.float64]

#: Readings used at most: beyond, one of every so many in a row is drawn at random.
MOST_READINGS = 40_000

#: Fewest readings that can support a cause.
LEAST_READINGS = 20

#: Standard deviations beyond which readings are outliers whatever the mean.
OUTLYING_ANYWAY = 12.0

#: Rivals reported for each finding.
RIVALS = 3

#: Findings, in the order found, for which rivals are tried.
RIVALLED = 4


def diagnose(
    runs: CalibrationRun | Iterable[CalibrationRun], sim: Simulation, *, gain: bool = True
) -> Diagnosis:
    r"""Name the physical causes that a simulation of the joint lacks.

    Every cause of the vocabulary is a nested extension of

    .. math:: y = \varepsilon_\text{measured} - \varepsilon_\text{simulated}
              = X\beta + \sum_j Z_j u_j + n

    with the zero and the lines of the simulation always free in X. It is chosen by the
    likelihood with a penalty of :math:`k\ln n_e + 2\ln(\text{grid})`, :math:`n_e` the readings
    or runs that inform on a parameter, and 6 for a new cause, forward and then backward;
    a further cause must also bring 0.1 % of what the others explain, as no form is exact;
    correlated noise is whitened, outliers are clipped at four standard deviations,
    and errors drawn anew in every run enter as random effects. What the design of the
    runs cannot tell apart is worked out first and not named.

    Parameters
    ----------
    runs : CalibrationRun or iterable of CalibrationRun
        Time, velocity, torque, temperature and mount where known.
    sim : Simulation
    gain : bool
        Measure the gain on held-out runs (about half of the time).

    Returns
    -------
    Diagnosis

    Raises
    ------
    ArgumentError
        No run, or too few readings.

    Notes
    -----
    Up to 40 000 readings are used; of more, one of every so many in a row is drawn at
    random (seed 0), which keeps the angles free of a grid. About 1 to 3 s for 10 000
    readings. Source: Frisch-Waugh projection; Schwarz (1978) and Kass and Wasserman
    (1995) for the penalty; Koenker
    (1981) for the variance.

    Examples
    --------
    >>> from trueangle.simulation import Backlash, RunDesign, Simulation, simulate
    >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),
    ...                                          RunDesign(reversals=(0.5,), speed_deg_s=30)))
    >>> runs = simulate(sim.with_effects([Backlash(3.0)]))
    >>> diagnose(runs, sim).findings[0].cause
    'backlash'
    """
    found = as_runs(runs)
    every = join_runs(found)
    if len(every) < LEAST_READINGS:
        raise ArgumentError(
            f"{len(every)} readings cannot support a diagnosis: give at least {LEAST_READINGS}"
        )
    residual_all = unfolded_error(found) - sim.predict(every)
    rows = _subsample(len(every))
    signals = every if rows is None else every.take(rows)
    residual = residual_all if rows is None else residual_all[rows]
    start = Regression(signals, residual, sim.surroundings)
    spots = blind_spots(start)
    chosen = select(start)
    scatter: list[ScatterFinding] = []
    uneven = _scatter(chosen, weighs=True)
    if uneven is not None and uneven.bic_gain > NEW_SCATTER + misfit(chosen):
        scatter.append(uneven)
        start = Regression(signals, residual, sim.surroundings, uneven.weights, start.lines)
        chosen = select(start, chosen.terms)
    isolated = _scatter(chosen, weighs=False)
    if isolated is not None and isolated.bic_gain > NEW_CAUSE:
        scatter.append(isolated)
    findings, spots = _findings(chosen, spots, gain)
    in_doubt = any(spot.supported for spot in spots)
    for item in scatter:
        if in_doubt and item.size < OUTLYING_ANYWAY:
            spots.append(_scatter_doubt(item))
        else:
            findings.append(_scatter_finding(item))
    findings.sort(key=lambda finding: -finding.evidence["bic_gain"])
    extended = sim.with_effects(effect for finding in findings for effect in finding.effects)
    noise = noise_from_repeats(signals, chosen.left - chosen.whiten.run_part(chosen.left))
    return Diagnosis(
        compare(every, residual_all),
        _structure(start),
        noise if noise is not None else float(np.sqrt(chosen.variance)),
        findings,
        spots,
        extended,
        _overall(start, chosen),
        len(every),
        len(signals),
        chosen.whiten.rho,
    )


def _scatter(regression: Regression, weighs: bool) -> ScatterFinding | None:
    """The cause of the scatter with the most evidence, of those that weigh readings or not."""
    found = [
        item
        for effect in EFFECTS.values()
        if effect.weighs == weighs and (item := effect.find_scatter(regression)) is not None
    ]
    return max(found, key=lambda item: item.bic_gain, default=None)


def _structure(start: Regression) -> dict[str, float]:
    """Share of the variance that each cause would explain alone, largest first."""
    alone = {
        cause: 1.0 - float(np.exp(-max(extension.deviance, 0.0) / start.n))
        for cause in EFFECTS
        if (extension := start.memory.get((cause,))) is not None and extension.bic_gain > 0.0
    }
    return dict(sorted(alone.items(), key=lambda item: -item[1]))


def _subsample(n: int) -> NDArray[np.int64] | None:
    """One reading of every so many in a row, at random within each; None where all fit."""
    if n <= MOST_READINGS:
        return None
    edges = np.linspace(0, n, MOST_READINGS + 1).astype(np.int64)
    rng = np.random.default_rng(0)
    return edges[:-1] + (rng.random(MOST_READINGS) * np.diff(edges)).astype(np.int64)


def _findings(
    regression: Regression, spots: list[Blindness], with_gain: bool
) -> tuple[list[Finding], list[Blindness]]:
    """Findings of the chosen terms; those in doubt become entries of what is not told."""
    spots = list(spots)
    groups = finding_groups(regression.terms)
    named = []
    for group in groups:
        doubt = doubts_about(regression.terms[group[0]], regression, spots)
        if doubt is None:
            named.append(group)
            continue
        evidence = sum(regression.terms[k].bic_gain for k in group)
        spots = [spot for spot in spots if spot != doubt]
        estimates = _estimates(regression, group, doubt.causes)
        spots.append(replace(doubt, supported=True, evidence=evidence, estimates=estimates))
    gains: Sequence[Gain | None] = [None] * len(named)
    if with_gain and named:
        gains = measure_gain(regression, named)
    fitted = regression.fitted()
    findings: list[Finding] = []
    for group, gain in zip(named, gains, strict=True):
        terms = [(*fitted[k], regression.covariance(k)) for k in group]
        cause = terms[0][0].cause
        parameters, effects = EFFECTS[cause].report(regression, terms)
        rivals = _rivals(regression, group) if len(findings) < RIVALLED else []
        weight = {
            "bic_gain": float(sum(t.bic_gain for t, _, _ in terms)),
            "deviance": float(sum(t.deviance for t, _, _ in terms)),
            "parameters": float(sum(t.parameters for t, _, _ in terms)),
            "log_grid": float(sum(t.log_grid for t, _, _ in terms)),
        }
        findings.append(Finding(cause, parameters, weight, gain, rivals, effects))
    return findings + _corrected_lines(regression, spots), spots


def _estimates(
    regression: Regression, group: Sequence[int], causes: Sequence[str]
) -> dict[str, Parameters]:
    """Parameters of every cause that may be the one, each alone in place of a finding."""
    rest = cause_terms(regression, group, settled=True)
    found = {}
    # Not lines: one that another hides behind is no property of the joint.
    for cause in causes:
        effect = EFFECTS[cause]
        if not (effect.acts_on_runs or is_flexible(effect)):
            continue
        extension = propose(effect, rest)
        if extension is None or extension.bic_gain <= 0.0:
            continue
        fitted = rest.with_terms([*rest.terms, extension])
        k = len(fitted.terms) - 1
        parameters, _ = effect.report(fitted, [(*fitted.fitted()[k], fitted.covariance(k))])
        found[cause] = parameters
    return found


def _rivals(regression: Regression, group: Sequence[int]) -> list[tuple[str, float]]:
    """The best other causes in place of a finding, and how much less they explain."""
    cause = regression.terms[group[0]].cause
    rest = cause_terms(regression, group)
    own = rest.bic - regression.bic
    others = [name for name in EFFECTS if name != cause]
    gaps = [(p.cause, own - gain) for p, _, gain in extensions(rest, others) if p.deviance > 0.0]
    gaps.sort(key=lambda item: item[1])
    return [(name, float(gap)) for name, gap in gaps[:RIVALS]]


def _corrected_lines(regression: Regression, spots: list[Blindness]) -> list[Finding]:
    """Lines that the simulation has, with another amplitude or phase."""
    belief = regression.belief.pattern
    joint = regression.belief.joint
    # Causes that act on the lines themselves take or give a part of them on average.
    if belief.orders.size == 0 or any(EFFECTS[t.cause].changes_lines for t in regression.terms):
        return []
    modulated = {term.shape["carrier"] for term in regression.terms if "carrier" in term.shape}
    found = []
    for k, order in enumerate(belief.orders):
        if order in modulated:
            continue  # modulation takes from its carrier what it gives to the sidebands
        where = slice(1 + 2 * k, 3 + 2 * k)
        change = regression.coefficients[where]
        spread = regression.unscaled_covariance[where, where] * regression.variance
        deviance = float(change @ np.linalg.pinv(spread) @ change)
        log_grid = float(np.log(belief.orders.size))
        bic_gain = deviance - 2.0 * regression.log_n - 2.0 * log_grid
        if bic_gain <= NEW_CAUSE or float(np.abs(change).max()) < ROUNDING:
            continue
        shape = {"output_order": float(order)}
        extension = Extension(MissingOrder.kind, shape, np.zeros((regression.n, 0)), 2, log_grid)
        doubt = doubts_about(extension, regression, spots)
        if doubt is not None:
            spots[:] = [spot for spot in spots if spot != doubt]
            spots.append(replace(doubt, supported=True, evidence=bic_gain))
            continue
        amplitude, phase, std, phase_std = line_parameters(change, spread)
        shaft, number = joint.name_order(float(order)) or ("output", float(order))
        effect: Effect = MissingOrder(shaft, number, amplitude, phase)
        parameters = {
            "shaft": quantity(shaft),
            "order": quantity(number),
            "output_order": quantity(float(order)),
            "amplitude_arcsec": quantity(amplitude, std),
            "phase_deg": quantity(phase, phase_std),
            "simulated_amplitude_arcsec": quantity(np.hypot(belief.cosine[k], belief.sine[k])),
            "explanations": quantity(joint.explanations(float(order))),
        }
        penalty = {
            "bic_gain": bic_gain,
            "deviance": deviance,
            "parameters": 2.0,
            "log_grid": log_grid,
        }
        found.append(Finding(MissingOrder.kind, parameters, penalty, None, [], [effect]))
    return found


def _scatter_finding(item: ScatterFinding) -> Finding:
    evidence = {"bic_gain": item.bic_gain}
    return Finding(item.cause, item.parameters, evidence, None, [], item.effects)


def _scatter_doubt(item: ScatterFinding) -> Blindness:
    """Scatter about a mean that is itself in doubt."""
    return Blindness(
        (item.cause,),
        "the error that the readings show has no certain cause yet, so what scatters about it "
        "has none either",
        "the measurements named above, then diagnose again",
        True,
        item.bic_gain,
    )


def _overall(before: Regression, after: Regression) -> dict[str, float]:
    """rms, peak-to-peak and max abs without and with all findings, fitted alike."""
    numbers = {}
    for name, regression in (("before", before), ("after", after)):
        left = regression.left - regression.whiten.run_part(regression.left)
        numbers[f"rms_{name}_arcsec"] = float(np.sqrt(np.mean(left**2)))
        numbers[f"peak_to_peak_{name}_arcsec"] = float(np.ptp(left))
        numbers[f"max_abs_{name}_arcsec"] = float(np.abs(left).max())
    return numbers
