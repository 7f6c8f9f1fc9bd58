"""Which causes this design of runs can tell apart, worked out before naming any."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import line_columns
from ..regression.estimate import Parameters
from ..regression.regression import Extension, Regression
from ..regression.whitening import wander_basis
from ..simulation.effects import EFFECTS
from .grid import UniformGrid, uniform_grid

__all__ = ["Blindness", "blind_spots", "doubts_about"]

Array = NDArray[np.float64]

#: Share of velocity that direction must leave for latency and backlash to be told apart.
OWN_OF_VELOCITY = 0.10

#: The same for a presliding transition against plain backlash: it is short by nature.
OWN_OF_TRANSITION = 1e-3

#: The same for velocity against the zero, torque against order 1, its cube against it.
OWN_POWER = 0.02

#: Kelvin of change below which temperature counts as constant.
LEAST_KELVIN = 2.0

#: Runs per level that a level of a whole run needs to stand out from their own zeros.
RUNS_PER_LEVEL = 3

#: Orders up to here may be errors of a reference artefact (36 facets).
REFERENCE_ORDERS = 36


@dataclass(frozen=True)
class Blindness:
    """Causes that this data cannot tell apart, or not see at all.

    Attributes
    ----------
    causes : tuple of str
    because, measure : str
        Why, and the measurement to add.
    supported : bool
        The readings do show something that one of these causes explains.
    evidence : float or None
        By how much BIC is better with it.
    estimates : dict of str to Parameters
        What each of the causes would be if it alone were the one; where something is seen.
    """

    causes: tuple[str, ...]
    because: str
    measure: str
    supported: bool = False
    evidence: float | None = None
    estimates: dict[str, Parameters] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """The entry of ``not_identifiable``."""
        return {
            "causes": list(self.causes),
            "because": self.because,
            "measure": self.measure,
            "supported": self.supported,
            "bic_gain": self.evidence,
            "estimates": {
                cause: {name: q.to_json() for name, q in parameters.items()}
                for cause, parameters in self.estimates.items()
            },
        }


def blind_spots(regression: Regression) -> list[Blindness]:
    """What the design of the runs in ``regression`` cannot tell; the readings are not looked at."""
    return [
        *_direction(regression),
        *_velocity(regression),
        *_temperature(regression),
        *_torque(regression),
        *_mount(regression),
        *_runs(regression),
        *_grid(regression),
    ]


def doubts_about(
    extension: Extension, regression: Regression, spots: list[Blindness]
) -> Blindness | None:
    """The reason not to name a supported cause, or None."""
    cause = extension.cause
    for spot in spots:
        if cause in spot.causes and cause != "missing_order":
            return spot
    if cause == "drift_within_run":
        return _doubt_about_wander(regression)
    if cause == "missing_order":
        return _doubt_about_line(float(extension.shape["output_order"]), regression, spots)
    return None


def share_left(regression: Regression, columns: Array, *others: Array) -> float:
    """Largest share of power that columns keep beside the simulation's lines and others."""
    known = np.hstack([regression.base, *others])
    u, s, _ = np.linalg.svd(known / np.linalg.norm(known, axis=0).clip(1e-300), False)
    q = u[:, s > 1e-7 * s[0]]
    rest = columns - q @ (q.T @ columns)
    before = np.einsum("ij,ij->j", columns, columns)
    after = np.einsum("ij,ij->j", rest, rest)
    return float(np.max(np.where(before > 0.0, after / before.clip(1e-300), 0.0)))


def _spot(causes: tuple[str, ...], because: str, measure: str | None = None) -> Blindness:
    if measure is None:
        first = EFFECTS[causes[0]]
        measure = first.measure
        if len(causes) > 1 and causes[1] in first.confounded_with:
            measure = first.confounded_with[causes[1]]
    return Blindness(causes, because, measure)


def _direction(regression: Regression) -> list[Blindness]:
    signals = regression.signals
    moving = signals.direction[signals.direction != 0.0]
    if moving.size == 0 or np.ptp(moving) == 0.0:
        because = "all runs go in one direction: a constant reversal error is part of the zero"
        return [_spot(("backlash",), because), _spot(("presliding_hysteresis",), because)]
    spots = []
    direction = signals.direction[:, None]
    transitions = np.column_stack([signals.presliding(length, 1.0) for length in (1.0, 3.0, 10.0)])
    if share_left(regression, transitions, direction) < OWN_OF_TRANSITION:
        spots.append(
            _spot(
                ("presliding_hysteresis", "backlash"),
                "no reversal inside a run is followed closely: a wound-up spring and play give "
                "the same two branches",
            )
        )
    of_run = [float(np.mean(signals.direction[a:b])) for a, b in regression.bounds]
    if all(abs(d) == 1.0 for d in of_run):
        fewest = min(sum(d > 0 for d in of_run), sum(d < 0 for d in of_run))
        if fewest < RUNS_PER_LEVEL:
            spots.append(
                _spot(
                    ("backlash", "zero_slip"),
                    f"each run goes in one direction and only {fewest} in one of them: the "
                    "difference may be the runs' own zeros",
                )
            )
    return spots


def _velocity(regression: Regression) -> list[Blindness]:
    signals = regression.signals
    both = bool(np.ptp(signals.direction) > 0.0)
    if signals.velocity is None:
        because = "no time stamps and no velocity were recorded"
        spots = [_spot(("latency",), because), _spot(("filter_lag",), because)]
        if both:
            spots.append(
                _spot(
                    ("backlash", "latency", "presliding_hysteresis"),
                    "velocity is unknown: a delay looks like a reversal error, and one that "
                    "builds up where the joint gathers speed",
                )
            )
        return spots
    spots = []
    velocity = signals.velocity[:, None]
    if share_left(regression, velocity) < OWN_POWER:
        spots.append(
            _spot(
                ("latency",),
                "one speed in one direction (or at rest): a delay is part of the zero",
            )
        )
    elif both and share_left(regression, velocity, signals.direction[:, None]) < OWN_OF_VELOCITY:
        spots.append(
            _spot(
                ("backlash", "latency"),
                "one speed: the sign of velocity and velocity itself are the same regressor",
            )
        )
    if not both:
        speed = np.abs(signals.velocity)
        # One direction at one speed filters every line by one factor: another line.
        if np.percentile(speed, 90) < 1.5 * max(float(np.percentile(speed, 10)), 1e-12):
            spots.append(
                _spot(
                    ("filter_lag",),
                    "one speed in one direction (or at rest): a filtered pattern is only "
                    "another pattern",
                )
            )
    elif not signals.velocity.any() or not _lines_pass(regression):
        spots.append(_spot(("filter_lag",), "nothing moved, or no line is known to filter"))
    return spots


def _lines_pass(regression: Regression) -> bool:
    return bool(regression.belief.pattern.orders.size)


def _temperature(regression: Regression) -> list[Blindness]:
    signals = regression.signals
    if signals.temperature is None:
        return [_spot(("thermal_drift",), "no temperature was recorded")]
    if np.ptp(signals.temperature) < LEAST_KELVIN:
        return [
            _spot(("thermal_drift",), f"the temperature varies by less than {LEAST_KELVIN:g} K")
        ]
    temperature = (signals.temperature - signals.temperature.mean())[:, None]
    if signals.torque is not None:
        level = np.abs(signals.torque)[:, None]
        if share_left(regression, temperature, level) < OWN_OF_VELOCITY:
            return [
                _spot(
                    ("thermal_drift", "torsional_compliance", "load_dependent_gear_error"),
                    "temperature and load change together",
                )
            ]
    levels = {round(float(signals.temperature[a:b].mean())) for a, b in regression.bounds}
    if signals.runs < len(levels) + RUNS_PER_LEVEL - 1:
        return [
            _spot(
                ("thermal_drift", "zero_slip"),
                "too few runs per temperature: the difference may be the runs' own zeros",
            )
        ]
    return []


def _torque(regression: Regression) -> list[Blindness]:
    signals = regression.signals
    causes = ("torsional_compliance", "stiffening_compliance", "load_dependent_gear_error")
    if signals.torque is None or not signals.torque.any():
        because = "no torque was recorded" if signals.torque is None else "all runs are unloaded"
        return [_spot((cause,), because) for cause in causes]
    torque = signals.torque[:, None]
    low = np.hstack([line_columns(signals.theta, k) for k in (1, 2, 3)])
    spots = []
    if share_left(regression, torque, low[:, :2]) < OWN_POWER:
        spots.append(
            _spot(
                ("torsional_compliance",),
                "one load: what it bends is part of the zero or of order 1",
            )
        )
    moments = torque * line_columns(signals.theta, 1)
    if (
        share_left(regression, torque**3, low, torque) < OWN_POWER
        and share_left(regression, moments * line_columns(signals.theta, 2), low, torque, moments)
        < OWN_POWER
    ):
        spots.append(
            _spot(
                ("stiffening_compliance",),
                "too few loads: the cube of the torque is not told from the torque and "
                "the low orders",
            )
        )
    gear = [m for m in regression.lines.orders[regression.lines.plausible] if m > 40.0][:2]
    if gear:
        m = float(gear[-1])
        beside = np.hstack([line_columns(signals.theta, m + k) for k in (-1, 0, 1)])
        if share_left(regression, torque * line_columns(signals.theta, m), beside) < OWN_POWER:
            spots.append(
                _spot(
                    ("load_dependent_gear_error",),
                    "one load: gear lines that grow with it are only other lines, or sidebands",
                )
            )
    return spots


def _mount(regression: Regression) -> list[Blindness]:
    mount = regression.signals.mount
    if mount is None:
        return [_spot(("reference_error",), "the mount of the reference was not recorded")]
    if np.ptp(mount) == 0.0:
        return [
            _spot(
                ("reference_error", "missing_order"),
                "the reference was never turned on its mount: its error and the joint's are "
                "the same function of angle",
                EFFECTS["reference_error"].measure,
            )
        ]
    return []


def _runs(regression: Regression) -> list[Blindness]:
    signals = regression.signals
    spots = []
    if signals.runs < 2:
        spots.append(_spot(("zero_slip",), "one run: a zero has no spread"))
        spots.append(
            _spot(("non_integer_order", "missing_order"), "one run: a phase cannot change")
        )
    clock = np.concatenate(
        [
            signals.clock[a:b] / max(float(np.ptp(signals.clock[a:b])), 1e-300)
            for a, b in regression.bounds
        ]
    )
    if share_left(regression, signals.theta[:, None], clock[:, None]) < OWN_OF_VELOCITY and (
        np.ptp(signals.direction) == 0.0
    ):
        spots.append(
            _spot(
                ("scale_error", "drift_within_run"),
                "one direction: a ramp in angle is a ramp in time",
            )
        )
    return spots


def _grid(regression: Regression) -> list[Blindness]:
    grid = uniform_grid(regression.signals.theta)
    if grid is None or grid.positions > 2.0 * regression.lines.orders.max():
        return []
    gear = _gear_lines(regression)
    folded = sorted({(grid.folded(m), m) for m in gear if grid.folded(m) != m})
    if not folded:
        return []
    pairs = ", ".join(f"{m:g} as {low:g}" for low, m in folded[:8])
    return [
        Blindness(
            ("missing_order", "sidebands", "argument_error", "local_defect"),
            f"all readings lie on one uniform grid of {grid.positions} positions, where gear "
            f"orders look like low ones ({pairs}): a model of the aliases would hold at these "
            "positions and fail between them",
            EFFECTS["missing_order"].measure,
        )
    ]


def _gear_lines(regression: Regression) -> list[float]:
    joint = regression.belief.joint
    lines = {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    if "wave_generator" in joint.shafts:
        lines.add(joint.shafts["motor"] + joint.shafts["wave_generator"])
    return sorted(lines)


def _doubt_about_wander(regression: Regression) -> Blindness | None:
    """Why a wander in time may be an error of reversal: few runs that reverse once."""
    signals = regression.signals
    if signals.runs >= RUNS_PER_LEVEL or np.ptp(signals.direction) == 0.0:
        return None
    left = power = 0.0
    for start, stop in regression.bounds:
        wander = wander_basis(signals.clock[start:stop])
        q, _ = np.linalg.qr(np.column_stack([np.ones(stop - start), wander]))
        direction = signals.direction[start:stop]
        power += float(np.sum((direction - direction.mean()) ** 2))
        left += float(np.sum((direction - q @ (q.T @ direction)) ** 2))
    if left > OWN_OF_VELOCITY * power:
        return None
    rest = regression.with_terms(t for t in regression.terms if t.cause != "drift_within_run")
    reversal = rest.propose("backlash", {}, signals.direction[:, None])
    if reversal.bic_gain <= 0.0:
        return None
    causes = ("drift_within_run", "backlash", "presliding_hysteresis")
    return Blindness(
        causes if signals.velocity is not None else (*causes, "latency"),
        f"{signals.runs} run(s) that reverse about once: an error that changes with the "
        "direction of travel and one that changes with time look alike",
        "reverse several times within each run, at places that differ from run to run, or "
        "repeat the runs",
    )


def _doubt_about_line(
    order: float, regression: Regression, spots: list[Blindness]
) -> Blindness | None:
    """Why a line found in the readings is not named a missing order of the joint."""
    grid: UniformGrid | None = uniform_grid(regression.signals.theta)
    for spot in spots:
        if "sidebands" in spot.causes and "missing_order" in spot.causes and grid is not None:
            return Blindness(
                spot.causes,
                f"order {order:g} and {', '.join(f'{m:g}' for m in grid.aliases(order, 3))} are "
                f"the same numbers at these {grid.positions} positions; {spot.because}",
                spot.measure,
            )
    signals = regression.signals
    joint = regression.belief.joint
    named = joint.name_order(order)
    of_gear = named is not None and named[0] != "output"
    if not of_gear and order <= REFERENCE_ORDERS and signals.mount is not None:
        for spot in spots:
            if "reference_error" in spot.causes:
                return Blindness(("missing_order", "reference_error"), spot.because, spot.measure)
    if order == 1.0 and len(joint.shafts) > 1:
        for spot in spots:
            if spot.causes == ("torsional_compliance",) and (
                signals.torque is None or signals.torque.any()
            ):
                return Blindness(
                    ("missing_order", "torsional_compliance"),
                    f"{spot.because}: order 1 may be gravity's",
                    spot.measure,
                )
    if of_gear:
        for spot in spots:
            loaded = signals.torque is not None and signals.torque.any()
            if spot.causes == ("load_dependent_gear_error",) and loaded:
                return Blindness(
                    ("missing_order", "load_dependent_gear_error"), spot.because, spot.measure
                )
            if spot.causes == ("filter_lag",) and order in regression.belief.pattern.orders:
                return Blindness(("missing_order", "filter_lag"), spot.because, spot.measure)
    return None
