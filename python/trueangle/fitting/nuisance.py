"""What is in the readings beside a pattern: ramp, drift, direction, velocity, the reference.

::

    e_rj = z_r + pattern(x_rj) + s u_rj + d sign_rj + τ v_rj + g_r(t_rj)

with the unwrapped angle ``u``, the sense and the speed of travel, and a cubic spline ``g`` of
the time of each run. They are fitted jointly with the pattern and taken out of the readings;
what is left is fitted as ever, which gives the same pattern as one fit of all (Frisch and
Waugh).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders, shaft_cycles
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from ..support.suggestions import did_you_mean
from .nuisancechoice import (
    FOLDS,
    FoldRows,
    best_spline,
    choose_nuisance_groups,
    error_inflation,
    reference_lines_help,
    solve_with_groups,
)

#: What may be asked for, in the order in which it is told.
KINDS: Final = ("ramp", "direction", "velocity", "drift")

#: Intervals of the spline of a run's time that are tried, from a cubic on.
_INTERVALS: Final = (1, 2, 4, 6)

#: Stretches of each run that are held out, every third together: twice as long as the memory
#: of the stiffest spline that they may judge. An odd number: way and return differ in fold.
_STRETCHES: Final = 13

#: Of twice as many readings and more every second, third, ... one is looked at.
_LOOKED_AT: Final = 24_000

#: Runs of which each may drift by itself, or have lines of the reference of its own.
_MOST_DRIFTING: Final = 24

#: Orders of each shaft that nuisances are looked for beside.
_LIKELY: Final = tuple(range(1, 9))


@dataclass(frozen=True, eq=False)
class Nuisance:
    """What was taken out of the readings.

    Attributes
    ----------
    kinds : tuple of str
    slope : float
        Of a ramp: error per angle, the relative error of a scale.
    half_width : float
        Of the direction: half of the reversal error, unit of the runs.
    delay : float
        Of the velocity: error per velocity, seconds; negative where the reading lags.
    intervals : int
        Of the spline in time; 0 without drift.
    reference : tuple of (order, A, B)
        Lines that the reference makes, the same in every run.
    turned : tuple of (order, amplitude, phases)
        The same where the reference was mounted anew for every run: one amplitude, and a phase
        in every run, radians.
    shares : mapping of str to float
        Part of the held-out sum of squares that each kind took away.
    unseparated : tuple of str
        Kinds that lower the error as much but cannot be told from the pattern.
    inflation : tuple of float
        By how much the standard errors of ``A, B`` of each order grow beside them.
    """

    kinds: tuple[str, ...] = ()
    slope: float = 0.0
    half_width: float = 0.0
    delay: float = 0.0
    intervals: int = 0
    reference: tuple[tuple[float, float, float], ...] = ()
    turned: tuple[tuple[float, float, tuple[float, ...]], ...] = ()
    shares: tuple[tuple[str, float], ...] = ()
    unseparated: tuple[str, ...] = ()
    inflation: tuple[float, ...] = ()

    def predict(self, run: CalibrationRun) -> Array:
        """Error of a run by ramp, direction and velocity; a drift belongs to its own run."""
        error = np.zeros(len(run))
        if self.slope:
            angle = run.unwrapped_reference
            error += self.slope * (angle - angle.mean())
        if self.half_width:
            error += self.half_width * run.direction
        if self.delay and (speed := run.speed) is not None:
            error += self.delay * speed
        return error

    def sentences(self, period: float) -> Iterable[str]:
        """What was taken out, for the notes."""
        words = {
            "ramp": f"a ramp of {1e6 * self.slope:.3g} ppm of the angle (a wrong scale or ratio)",
            "direction": f"a reversal error of +-{1_296_000.0 * self.half_width / period:.3g} "
            "arcsec with the direction",
            "velocity": f"an error of {1e3 * self.delay:.3g} ms times the velocity (a delay)",
            "drift": f"a drift in time (cubic spline of {self.intervals} "
            f"interval{'s' if self.intervals > 1 else ''} in every run)",
            "reference": f"{len(self.reference)} lines of the reference",
            "turned": "lines of the reference with a phase of their own in every run, because its "
            f"zero is new in each ({', '.join(self._told(period))})",
        }
        shares = dict(self.shares)
        for kind in self.kinds:
            gain = f", {100.0 * shares[kind]:.2g} % of the held-out error" if kind in shares else ""
            yield f"fitted jointly with the pattern, and not in the model: {words[kind]}{gain}"
        for kind in self.unseparated:
            yield (
                f"{words[kind].split(' of ')[0]} would lower the error too, but this design cannot "
                "tell it from the pattern: run `ta.diagnose(...)`, or measure in both directions, "
                "at several speeds and over more turns"
            )

    def _told(self, period: float) -> Iterable[str]:
        for order, amplitude, _ in self.turned:
            yield f"order {order:g}: {1_296_000.0 * amplitude / period:.3g} arcsec"


def asked_nuisance(asked: str | Iterable[str]) -> tuple[str, ...] | None:
    """Kinds of ``"none"``, ``"drift,ramp"`` or a list of names; None for ``"auto"``.

    Raises
    ------
    ArgumentError
        Unknown names.
    """
    if asked == "none":
        return ()
    if asked == "auto":
        return None
    names = asked.split(",") if isinstance(asked, str) else list(asked)
    names = [name.strip() for name in names if name.strip() and name.strip() != "none"]
    unknown = [name for name in names if name not in KINDS]
    if unknown:
        raise ArgumentError(
            f"nuisance must be 'auto', 'none' or some of {', '.join(KINDS)}, got {unknown[0]!r}"
            f"{did_you_mean(unknown[0], ('auto', 'none', *KINDS))}"
        )
    return tuple(kind for kind in KINDS if kind in names)


def orders_beside_nuisance(
    runs: Sequence[CalibrationRun],
    gear_ratio: float | None,
    fixed_member: str,
    shafts: Mapping[str, float] | None,
) -> list[ShaftOrders]:
    """Orders beside which nuisances are looked for before any are chosen.

    Those that come at least half a cycle over the travel: lower ones are a ramp there.
    """
    travel = max(float(np.ptp(run.unwrapped_reference)) for run in runs) / runs[0].period
    cycles = shaft_cycles(gear_ratio, fixed_member) | dict(shafts or {})
    return [
        ShaftOrders(name, float(f), orders)
        for name, f in cycles.items()
        if (orders := tuple(k for k in _LIKELY if k * f * travel >= 0.5))
    ]


def take_out_nuisance(
    runs: Sequence[CalibrationRun],
    kinds: tuple[str, ...] | None,
    shafts: Sequence[ShaftOrders],
    argument: str,
    reference_orders: Sequence[float] = (),
) -> tuple[list[CalibrationRun], Nuisance]:
    """The runs without their nuisances, which are fitted beside these orders.

    ``kinds`` of None are chosen by the error of stretches held out.
    """
    stride = _stride(runs)
    orders = [k * s.cycles_per_turn for s in shafts for k in s.orders]
    rows = _columns(runs, orders, argument, stride, kinds, reference_orders)
    forced = [_lines_of_reference(rows)] if reference_orders else []
    shares: list[tuple[str, float]] = []
    unseparated: list[str] = []
    if kinds is None:
        chosen, shares, unseparated = choose_nuisance_groups(rows, forced)
    else:
        missing = [k for k in kinds if not any(name.startswith(k) for name in rows.groups)]
        if missing:
            raise ArgumentError(_MISSING[missing[0]])
        named = [name for name in rows.groups if name in kinds]
        chosen = [*forced, *named]
        if "drift" in kinds:
            chosen.append(best_spline(rows, chosen))
    if not chosen:
        return list(runs), Nuisance(unseparated=tuple(unseparated))
    found = solve_with_groups(rows, chosen)
    nuisance = Nuisance(
        kinds=tuple(name.rstrip("0123456789") for name in chosen),
        slope=float(found["ramp"][0]) if "ramp" in found else 0.0,
        half_width=float(found["direction"][0]) if "direction" in found else 0.0,
        delay=float(found["velocity"][0]) if "velocity" in found else 0.0,
        intervals=next((int(n[5:]) for n in chosen if n.startswith("drift")), 0),
        reference=tuple(
            (float(k), *found["reference"][2 * i : 2 * i + 2].tolist())
            for i, k in enumerate(reference_orders)
        )
        if "reference" in found
        else (),
        turned=_one_amplitude(found["turned"], reference_orders, len(runs))
        if "turned" in found
        else (),
        shares=tuple(shares),
        unseparated=tuple(unseparated),
        inflation=tuple(error_inflation(rows, chosen)),
    )
    drifts = next((found[n] for n in chosen if n.startswith("drift")), None)
    return [_without(run, i, nuisance, drifts) for i, run in enumerate(runs)], nuisance


def taken_columns(
    runs: Sequence[CalibrationRun], nuisance: Nuisance
) -> tuple[list[Array], list[Array]] | None:
    """Columns of each run that were taken out: what runs share, and what each has for itself.

    Each about its run's mean and of size 1. None where there are none, and where they came from
    a part of the readings.
    """
    if not nuisance.kinds or _stride(runs) > 1:
        return None
    lines = [order for order, *_ in (*nuisance.reference, *nuisance.turned)]
    plain = [replace(run, weights=None) for run in runs]
    kinds = tuple(kind for kind in nuisance.kinds if kind in KINDS)
    groups = _columns(plain, (), "reference", 1, kinds, lines).groups
    named = [f"drift{nuisance.intervals}" if k == "drift" else k for k in nuisance.kinds]
    ends = np.cumsum([len(run) for run in runs])[:-1]
    shared, own = [np.zeros((sum(map(len, runs)), 0))], [np.zeros((sum(map(len, runs)), 0))]
    for name in named:
        columns = groups[name] / np.sqrt(np.maximum((groups[name] ** 2).mean(axis=0), 1e-300))
        (own if name.startswith(("drift", "turned")) else shared).append(columns)
    alone = np.split(np.hstack(own), ends)
    return (
        np.split(np.hstack(shared), ends),
        [part[:, np.abs(part).max(axis=0) > 0.0] for part in alone],
    )


def _stride(runs: Sequence[CalibrationRun]) -> int:
    """Every how many readings one is looked at."""
    return max(1, sum(map(len, runs)) // _LOOKED_AT)


def _lines_of_reference(rows: FoldRows) -> str:
    """Whether the lines of the reference are the same in every run, or are new in each.

    The other group leaves the rows.
    """
    name = "turned" if "turned" in rows.groups and reference_lines_help(rows) else "reference"
    rows.groups.pop("reference" if name == "turned" else "turned", None)
    return name


def _one_amplitude(
    found: Array, orders: Sequence[float], runs: int
) -> tuple[tuple[float, float, tuple[float, ...]], ...]:
    """``(order, amplitude, phases)`` of ``A, B`` of every run: the mean amplitude for all."""
    a, b = np.moveaxis(found.reshape(runs, len(orders), 2), 2, 0)
    phases, sizes = np.arctan2(a, b), np.hypot(a, b).mean(axis=0)
    return tuple(
        (float(order), float(sizes[i]), tuple(phases[:, i].tolist()))
        for i, order in enumerate(orders)
    )


def take_out_nuisance_beside(
    runs: Sequence[CalibrationRun],
    kinds: tuple[str, ...] | None,
    wanted: Sequence[ShaftOrders],
    likely: Sequence[ShaftOrders],
    argument: str,
    reference_orders: Sequence[float] = (),
) -> tuple[list[CalibrationRun], Nuisance]:
    """`take_out_nuisance` beside the orders wanted, chosen beside the likely ones as well.

    What an order that is not in the model leaves is no ramp, though a ramp lowers it.
    """
    if kinds is not None:
        return take_out_nuisance(runs, kinds, wanted, argument, reference_orders)
    both = {s.name: s for s in likely}
    for shaft in wanted:
        more = both[shaft.name].orders if shaft.name in both else ()
        both[shaft.name] = shaft._replace(orders=tuple(sorted({*shaft.orders, *more})))
    _, first = take_out_nuisance(runs, None, list(both.values()), argument, reference_orders)
    chosen = tuple(kind for kind in first.kinds if kind in KINDS)
    cleaned, taken = take_out_nuisance(runs, chosen, wanted, argument, reference_orders)
    return cleaned, replace(taken, shares=first.shares, unseparated=first.unseparated)


_MISSING: Final = {
    "ramp": "nuisance 'ramp' needs travel",
    "direction": "nuisance 'direction' needs runs that reverse: one in a single direction "
    "has it in its zero",
    "velocity": "nuisance 'velocity' needs time or velocity in every run, and different speeds",
    "drift": "nuisance 'drift' needs time in every run (at most 24 runs)",
}


def _without(
    run: CalibrationRun, index: int, nuisance: Nuisance, drifts: Array | None
) -> CalibrationRun:
    error = nuisance.predict(run)
    for order, a, b in nuisance.reference:
        x = 2.0 * np.pi * order / run.period * run.reference
        error += a * np.cos(x) + b * np.sin(x)
    for order, amplitude, phases in nuisance.turned:
        x = 2.0 * np.pi * order / run.period * run.reference
        error += amplitude * np.sin(x + phases[index])
    if drifts is not None and run.time is not None:
        width = nuisance.intervals + 2
        mine = drifts[index * width : (index + 1) * width]
        error += _spline(run.time, run.time, nuisance.intervals) @ mine
    return replace(run, indicated=run.indicated - error)


def _columns(
    runs: Sequence[CalibrationRun],
    orders: Sequence[float],
    argument: str,
    stride: int,
    kinds: tuple[str, ...] | None,
    reference_orders: Sequence[float],
) -> FoldRows:
    wanted = KINDS if kinds is None else kinds
    timed = all(run.time is not None and np.ptp(run.time) > 0.0 for run in runs)
    speeds = [run.speed for run in runs] if "velocity" in wanted else []
    parts: dict[str, list[Array]] = {}
    patterns, errors, folds = [], [], []
    for i, run in enumerate(runs):
        take = slice(None, None, stride)
        x = (2.0 * np.pi / run.period * getattr(run, argument))[take, None]
        angular = x * np.asarray(orders)
        weight = np.ones(len(run)) if run.weights is None else run.weights
        mine = {"ramp": run.unwrapped_reference[take, None]} if "ramp" in wanted else {}
        if "direction" in wanted:
            mine["direction"] = run.direction[take, None]
        if speeds and all(speed is not None for speed in speeds):
            mine["velocity"] = np.asarray(speeds[i])[take, None]
        if reference_orders:
            lines = (2.0 * np.pi / run.period * run.reference)[take, None] * reference_orders
            both = np.stack([np.cos(lines), np.sin(lines)], 2).reshape(len(x), -1)
            mine["reference"] = both
            if 1 < len(runs) <= _MOST_DRIFTING:
                mine["turned"] = _of_run(both, i, len(runs))
        if "drift" in wanted and timed and len(runs) <= _MOST_DRIFTING:
            assert run.time is not None
            for count in _INTERVALS:
                own = _spline(run.time[take], run.time, count)
                mine[f"drift{count}"] = _of_run(own, i, len(runs))
        used = weight[take]
        for name, columns in mine.items():
            parts.setdefault(name, []).append(_about(columns, used))
        patterns.append(_about(np.hstack([np.cos(angular), np.sin(angular)]), used))
        errors.append(_about(run.centred_error[take, None], used)[:, 0])
        folds.append((np.arange(len(x)) * _STRETCHES // len(x) + i) % FOLDS)
    groups = {name: np.vstack(v) for name, v in parts.items()}
    return FoldRows(
        np.vstack(patterns),
        {name: v for name, v in groups.items() if np.abs(v).max() > 0.0},
        np.concatenate(errors),
        np.concatenate(folds),
    )


def _about(columns: Array, weight: Array) -> Array:
    """Columns about their weighted mean, by the roots of the weights."""
    mean = (weight @ columns) / weight.sum()
    return np.asarray(np.sqrt(weight)[:, None] * (columns - mean))


def _of_run(own: Array, index: int, runs: int) -> Array:
    """Columns that each run has for itself: those of this run, zeros for the others."""
    full = np.zeros((len(own), runs * own.shape[1]))
    full[:, index * own.shape[1] : (index + 1) * own.shape[1]] = own
    return full


def _spline(time: Array, whole: Array, intervals: int) -> Array:
    """Cubic truncated powers over the run's time, without the constant, each of size about 1."""
    t = (time - whole[0]) / (whole[-1] - whole[0])
    knots = np.arange(1, intervals) / intervals
    powers = [2.0 * t - 1.0, (2.0 * t - 1.0) ** 2, (2.0 * t - 1.0) ** 3]
    return np.column_stack([*powers, *(np.maximum(0.0, t - k) ** 3 for k in knots)])
