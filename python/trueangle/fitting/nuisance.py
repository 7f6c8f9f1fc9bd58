r"""What is in the readings beside a pattern: ramp, drift, direction, velocity, the reference.

.. math:: e_{rj} = z_r + \text{pattern}(x_{rj}) + s\,u_{rj} + d\,\mathrm{sign}_{rj} + \tau v_{rj}
          + g_r(t_{rj})

with the unwrapped angle ``u``, the sense and the speed of travel, and a cubic spline ``g`` of
the time of each run. They are fitted beside the pattern and taken out of the readings; what is
left is fitted as ever, which gives the same pattern as one fit of all (Frisch and Waugh).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..runs import CalibrationRun
from ..shafts import ShaftOrders, shaft_cycles

__all__ = ["KINDS", "Nuisance", "asked_nuisance", "likely_orders", "take_out"]

Array = NDArray[np.float64]

#: What may be asked for, in the order in which it is told.
KINDS: Final = ("ramp", "direction", "velocity", "drift")

#: Intervals of the spline of a run's time that are tried, from a cubic on.
_INTERVALS: Final = (1, 2, 4, 6)

#: Stretches of each run that are held out, every third together: twice as long as the memory
#: of the stiffest spline that they may judge. An odd number: way and return differ in fold.
_STRETCHES: Final = 13
_FOLDS: Final = 3

#: Readings that the choice is made from.
_LOOKED_AT: Final = 24_000

#: A nuisance must lower the held-out sum of squares by this share, in most of the folds, ...
_GAIN: Final = 0.01
#: ... and this share of it must be left beside the pattern: else the design cannot tell them.
_TOLD: Final = 0.02
#: Of nuisances that leave nearly the same the simplest is taken.
_ALIKE: Final = 0.02

#: Runs of which each may drift by itself.
_MOST_DRIFTING: Final = 24

#: Orders of each shaft that nuisances are looked for beside.
_LIKELY: Final = tuple(range(1, 9))

#: Part of the greatest eigenvalue below which a combination of columns is not seen.
_SEEN: Final = 1e-9


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
        }
        shares = dict(self.shares)
        for kind in self.kinds:
            gain = f", {100.0 * shares[kind]:.2g} % of the held-out error" if kind in shares else ""
            yield f"taken out beside the pattern, and not in the model: {words[kind]}{gain}"
        for kind in self.unseparated:
            yield (
                f"{words[kind].split(' of ')[0]} would lower the error too, but this design cannot "
                "tell it from the pattern: run trueangle diagnose, or measure in both directions, "
                "at several speeds and over more turns"
            )


def asked_nuisance(asked: str | Iterable[str]) -> tuple[str, ...] | None:
    """Kinds of ``"none"``, ``"drift,ramp"`` or a list of names; None for ``"auto"``.

    Raises
    ------
    ArgumentError
        Unknown names.
    """
    if asked == "auto":
        return None
    names = asked.split(",") if isinstance(asked, str) else list(asked)
    names = [name.strip() for name in names if name.strip() and name.strip() != "none"]
    unknown = [name for name in names if name not in KINDS]
    if unknown:
        raise ArgumentError(
            f"nuisance must be 'auto', 'none' or some of {', '.join(KINDS)}, got {unknown[0]!r}"
        )
    return tuple(kind for kind in KINDS if kind in names)


def likely_orders(
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


class _Columns(NamedTuple):
    """Columns by name, each about its run's mean, the errors, and the fold of each reading."""

    pattern: Array
    groups: dict[str, Array]
    error: Array
    fold: NDArray[np.intp]


def take_out(
    runs: Sequence[CalibrationRun],
    kinds: tuple[str, ...] | None,
    shafts: Sequence[ShaftOrders],
    argument: str,
    reference_orders: Sequence[float] = (),
) -> tuple[list[CalibrationRun], Nuisance]:
    """The runs without their nuisances, which are fitted beside these orders.

    Parameters
    ----------
    kinds : tuple of str or None
        None chooses by the error of stretches held out.
    """
    stride = max(1, sum(map(len, runs)) // _LOOKED_AT)
    orders = [k * s.cycles_per_turn for s in shafts for k in s.orders]
    rows = _columns(runs, orders, argument, stride, kinds, reference_orders)
    forced = ["reference"] if reference_orders else []
    shares: list[tuple[str, float]] = []
    unseparated: list[str] = []
    if kinds is None:
        chosen, shares, unseparated = _choose(rows, forced)
    else:
        missing = [k for k in kinds if not any(name.startswith(k) for name in rows.groups)]
        if missing:
            raise ArgumentError(_MISSING[missing[0]])
        named = [name for name in rows.groups if name in kinds]
        chosen = [*forced, *named]
        if "drift" in kinds:
            chosen.append(_stiffest(rows, chosen))
    if not chosen:
        return list(runs), Nuisance(unseparated=tuple(unseparated))
    found = _solved(rows, chosen)
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
        if reference_orders
        else (),
        shares=tuple(shares),
        unseparated=tuple(unseparated),
        inflation=tuple(_inflation(rows, chosen)),
    )
    drifts = next((found[n] for n in chosen if n.startswith("drift")), None)
    return [_without(run, i, nuisance, drifts) for i, run in enumerate(runs)], nuisance


_MISSING: Final = {
    "ramp": "nuisance 'ramp' needs travel",
    "direction": "nuisance 'direction' needs runs with reversals, or in both directions",
    "velocity": "nuisance 'velocity' needs time or velocity in every run, and unlike speeds",
    "drift": "nuisance 'drift' needs time in every run (at most 24 runs)",
}


def _without(
    run: CalibrationRun, index: int, nuisance: Nuisance, drifts: Array | None
) -> CalibrationRun:
    error = nuisance.predict(run)
    for order, a, b in nuisance.reference:
        x = 2.0 * np.pi * order / run.period * run.reference
        error += a * np.cos(x) + b * np.sin(x)
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
) -> _Columns:
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
            mine["reference"] = np.stack([np.cos(lines), np.sin(lines)], 2).reshape(len(x), -1)
        if "drift" in wanted and timed and len(runs) <= _MOST_DRIFTING:
            assert run.time is not None
            for count in _INTERVALS:
                own = _spline(run.time[take], run.time, count)
                full = np.zeros((len(x), len(runs) * own.shape[1]))
                full[:, i * own.shape[1] : (i + 1) * own.shape[1]] = own
                mine[f"drift{count}"] = full
        used = weight[take]
        for name, columns in mine.items():
            parts.setdefault(name, []).append(_about(columns, used))
        patterns.append(_about(np.hstack([np.cos(angular), np.sin(angular)]), used))
        errors.append(_about(run.centred_error[take, None], used)[:, 0])
        folds.append((np.arange(len(x)) * _STRETCHES // len(x) + i) % _FOLDS)
    groups = {name: np.vstack(v) for name, v in parts.items()}
    return _Columns(
        np.vstack(patterns),
        {name: v for name, v in groups.items() if np.abs(v).max() > 0.0},
        np.concatenate(errors),
        np.concatenate(folds),
    )


def _about(columns: Array, weight: Array) -> Array:
    """Columns about their weighted mean, by the roots of the weights."""
    mean = (weight @ columns) / weight.sum()
    return np.asarray(np.sqrt(weight)[:, None] * (columns - mean))


def _spline(time: Array, whole: Array, intervals: int) -> Array:
    """Cubic truncated powers over the run's time, without the constant, each of size about 1."""
    t = (time - whole[0]) / (whole[-1] - whole[0])
    knots = np.arange(1, intervals) / intervals
    powers = [2.0 * t - 1.0, (2.0 * t - 1.0) ** 2, (2.0 * t - 1.0) ** 3]
    return np.column_stack([*powers, *(np.maximum(0.0, t - k) ** 3 for k in knots)])


def _design(rows: _Columns, chosen: Sequence[str]) -> Array:
    return np.hstack([rows.pattern, *(rows.groups[name] for name in chosen)])


def _solution(gram: Array, moment: Array) -> Array:
    if not gram.size:
        return np.zeros(0)
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    seen = values > _SEEN * values[-1]
    turned = vectors[:, seen].T @ (moment / scale)
    return np.asarray(vectors[:, seen] @ (turned / values[seen]) / scale)


def _held_out(rows: _Columns, chosen: Sequence[str]) -> Array:
    """Sum of squares of each fold under the fit of the others."""
    design = _design(rows, chosen)
    masks = [rows.fold == f for f in range(_FOLDS)]
    grams = [design[m].T @ design[m] for m in masks]
    moments = [design[m].T @ rows.error[m] for m in masks]
    found = []
    for f, mask in enumerate(masks):
        others = [i for i in range(_FOLDS) if i != f]
        solution = _solution(sum(grams[i] for i in others), sum(moments[i] for i in others))
        left = rows.error[mask] - design[mask] @ solution
        found.append(float(left @ left))
    return np.array(found)


def _told(rows: _Columns, chosen: Sequence[str], name: str) -> float:
    """Part of a group's energy that the pattern and the chosen ones leave."""
    design, columns = _design(rows, chosen), rows.groups[name]
    gram, cross = design.T @ design, design.T @ columns
    left = columns - design @ np.column_stack(
        [_solution(gram, cross[:, j]) for j in range(cross.shape[1])]
    )
    return float((left**2).sum() / (columns**2).sum())


def _choose(
    rows: _Columns, forced: list[str]
) -> tuple[list[str], list[tuple[str, float]], list[str]]:
    """Groups taken one by one while the best lowers the held-out error."""
    chosen = list(forced)
    shares: list[tuple[str, float]] = []
    unseparated: list[str] = []
    before = _held_out(rows, chosen)
    total = float(before.sum())
    barred: set[str] = set()
    while True:
        trials = {
            name: _held_out(rows, [*chosen, name])
            for name in rows.groups
            if name not in chosen and name.rstrip("0123456789") not in barred
        }
        good = {
            name: after
            for name, after in trials.items()
            if after.sum() < (1.0 - _GAIN) * before.sum()
            and np.count_nonzero(after < before) > _FOLDS // 2
        }
        if not good:
            return chosen, shares, unseparated
        least = min(float(after.sum()) for after in good.values())
        # A kinked drift imitates a ramp there and back: of those alike the simplest.
        alike = [name for name, after in good.items() if after.sum() <= (1.0 + _ALIKE) * least]
        best = min(alike, key=lambda name: rows.groups[name].shape[1])
        kind = best.rstrip("0123456789")
        barred.add(kind)
        if _told(rows, chosen, best) < _TOLD:
            unseparated.append(kind)
            continue
        shares.append((kind, float(before.sum() - good[best].sum()) / total))
        chosen.append(best)
        before = good[best]


def _stiffest(rows: _Columns, chosen: Sequence[str]) -> str:
    """The spline that lowers the held-out error most."""
    names = [name for name in rows.groups if name.startswith("drift")]
    return min(names, key=lambda name: float(_held_out(rows, [*chosen, name]).sum()))


def _inflation(rows: _Columns, chosen: Sequence[str]) -> list[float]:
    """Standard errors of ``A, B`` of each order beside the chosen groups, over those without."""
    pattern, design = rows.pattern, _design(rows, chosen)
    size = pattern.shape[1]
    if not size:
        return []
    alone, beside = (
        np.diag(np.linalg.pinv(x.T @ x, rcond=_SEEN, hermitian=True))[:size]
        for x in (pattern, design)
    )
    ratio = np.sqrt(np.maximum(beside / np.maximum(alone, 1e-300), 1.0))
    return [float(v) for v in ratio.reshape(2, -1).T.ravel()]


def _solved(rows: _Columns, chosen: Sequence[str]) -> dict[str, Array]:
    """Coefficients of the chosen groups beside the pattern."""
    design = _design(rows, chosen)
    solution = _solution(design.T @ design, design.T @ rows.error)
    ends = np.cumsum([rows.pattern.shape[1], *(rows.groups[n].shape[1] for n in chosen)])
    return dict(zip(chosen, np.split(solution, ends[:-1])[1:], strict=True))
