"""Plans of calibrations without a reference, also of the runs that a simulation designs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError
from ..joint.shafts import limited_orders, shaft_cycles
from ..selfcalibration import PLANNED
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.suggestions import check_choice
from .noisefactors import search_spread
from .plan import readings_needed
from .result import SelfPlan

#: Turns below which the pattern cannot be separated from the motion.
_TURNS: Final = 10.0
#: Resolution of the angles in degrees; blind below this share.
_STEP: Final = 0.1

_STARTS: Final = 4000


def angle_factors(angles_deg: ArrayLike, orders: Sequence[float]) -> Array:
    """Noise factor of each order for heads or shifts at ``angles_deg``.

    ::

        f_k = (1 - |S_k/n|²)^(-1/2),    S_k = Σ_i e^(ikα_i)

    Parameters
    ----------
    angles_deg : array_like, shape (..., n)
    orders : sequence of float

    Returns
    -------
    ndarray, shape (..., len(orders))
        Infinite where the order has the same value at all angles.

    Examples
    --------
    >>> angle_factors([0.0, 120.0, 240.0], [1, 2, 3]).round(3)
    array([ 1.,  1., inf])
    """
    angles = np.radians(np.asarray(angles_deg, dtype=np.float64))
    k = np.asarray(orders, dtype=np.float64)
    mean = np.exp(1j * angles[..., None] * k).mean(axis=-2)
    share = 1.0 - np.abs(mean) ** 2
    with np.errstate(divide="ignore"):
        return np.asarray(np.where(share > 1e-3, 1.0 / np.sqrt(np.maximum(share, 1e-300)), np.inf))


def best_angles(count: int, orders: Sequence[float]) -> tuple[float, ...]:
    """Angles of ``count`` heads or shifts with the least worst factor, the first one 0.

    Two are ``360/(K + 1)`` apart (closed form for orders 1 to K); more are searched from fixed
    random starts, to a tenth of a degree.

    Examples
    --------
    >>> best_angles(2, range(1, 9))
    (0.0, 40.0)
    """
    if count < 2:
        raise ArgumentError(f"two angles or more are needed, got {count}")
    k = sorted(orders)
    if count == 2 and k == list(range(1, len(k) + 1)):
        return 0.0, round(360.0 / (len(k) + 1), 4)
    starts: Array = np.zeros((_STARTS, count))
    starts[:, 1:] = np.random.default_rng(0).uniform(0.0, 360.0, (_STARTS, count - 1))
    steps = np.arange(0.0, 360.0, _STEP)
    best = search_spread(lambda trial: angle_factors(trial, k).max(axis=-1), starts, steps)
    return tuple(round(float(a), 4) for a in np.sort(best))


def speed_factor(ratio: float) -> float:
    """Noise factor when ripple is fitted jointly with the pattern, coasting by ``ratio``.

    Examples
    --------
    >>> round(speed_factor(5.0), 2), round(speed_factor(1.25), 1)
    (1.53, 7.8)
    """
    # Imported here: the fitting side of self-calibration is no part of a plan's import.
    from ..selfcalibration.ripple import cost_of_ripple

    if not (math.isfinite(ratio) and ratio > 1.0):
        raise ArgumentError(f"speed_ratio must be greater than 1, got {ratio!r}")
    return cost_of_ripple(np.exp(np.linspace(0.0, 2.0 * math.log(ratio), 4001)))


@told_kinds
def plan_self(
    method: str,
    orders: Iterable[float] | None = None,
    *,
    count: int = 3,
    angles: Sequence[float] | None = None,
    speed_ratio: float = 5.0,
    start_speed: float | None = None,
    rate: float | None = None,
    gear_ratio: float | None = None,
    noise: float | None = None,
    standard_error: float | None = None,
) -> SelfPlan:
    """What to record so that a calibration without a reference knows the wanted orders.

    Parameters
    ----------
    method : {"spin-down", "heads", "shifts", "dual"}
    orders : iterable of int, optional
        Default 1 to 8.
    count : int
        Heads or shifts.
    angles : sequence of float, optional
        Angles that are there, in degrees: how much worse are they?
    speed_ratio : float
        Start over end speed of a spin-down.
    start_speed, rate : float, optional
        Turns per second at the start, readings per second.
    gear_ratio : float, optional
        For ``"dual"``.
    noise, standard_error : float, optional
        Scatter of one reading and the standard error wanted, in one unit.

    Examples
    --------
    >>> plan = plan_self("heads", range(1, 9), count=2, noise=5.0, standard_error=0.5)
    >>> plan.angles_deg, round(plan.worst_noise_factor, 2), plan.readings
    ((0.0, 40.0), 2.92, 1710)
    """
    check_choice("method", method, PLANNED)
    wanted = tuple(
        sorted({float(k) for k in limited_orders(range(1, 9) if orders is None else orders)})
    )
    if not wanted or any(not (math.isfinite(k) and k > 0.0) for k in wanted):
        raise ArgumentError(f"orders must be positive numbers, got {orders!r}")
    if method == "spin-down":
        return _spin_down(wanted, speed_ratio, start_speed, rate, noise, standard_error)
    if method == "dual":
        return _dual(wanted, gear_ratio, noise, standard_error)
    best = best_angles(count, wanted)
    factors = dict(zip(wanted, angle_factors(best, wanted).tolist(), strict=True))
    worst = max(factors.values())
    given: dict[str, object] = {}
    if angles is not None:
        mine = dict(zip(wanted, angle_factors(list(angles), wanted).tolist(), strict=True))
        seen = [f for f in mine.values() if math.isfinite(f)]
        given = {
            "angles_deg": list(angles),
            "noise_factors": mine,
            "worst_noise_factor": max(seen, default=math.inf),
            "worse_by": max(mine.values()) / worst if math.isfinite(worst) else 1.0,
            "blind_orders": [k for k, f in mine.items() if not math.isfinite(f)],
        }
    what = "heads" if method == "heads" else "shifts"
    notes = [
        f"{count} equispaced {what} do not show multiples of {count}",
        "the zero is not identifiable",
    ]
    if method == "shifts":
        notes.append(
            "angles need to be known to a degree only: they are estimated from the readings"
        )
        if count < 3:
            notes.append("three clampings or more show what the coupling changes")
    return SelfPlan(
        method,
        wanted,
        factors,
        angles_deg=best,
        given=given,
        turns=1.0 if method == "heads" else float(count),
        readings=_readings(noise, standard_error, worst),
        notes=tuple(notes),
    )


def _spin_down(
    orders: tuple[float, ...],
    ratio: float,
    start: float | None,
    rate: float | None,
    noise: float | None,
    error: float | None,
) -> SelfPlan:
    factor = speed_factor(ratio)
    readings = _readings(noise, error, factor)
    notes = [
        "coast with the drive off: a loop closed on the encoder hides the orders it follows",
        "without a change of speed, encoder and ripple are confounded: plan a ratio of 3 or more",
        "the zero is not identifiable",
    ]
    turns, seconds = _TURNS, None
    if start is not None and rate is not None:
        if rate / start < 2.2 * max(orders):
            notes.append(
                f"at {start:g} turns/s order {max(orders):g} needs {2.2 * max(orders) * start:.3g} "
                f"readings per second, not {rate:g}: start slower or read faster"
            )
        mean = start * (1.0 - 1.0 / ratio) / math.log(ratio)
        seconds = max((readings or 0) / rate, _TURNS / mean)
        turns = mean * seconds
        readings = max(readings or 0, math.ceil(seconds * rate))
    return SelfPlan(
        "spin-down",
        orders,
        dict.fromkeys(orders, factor),
        speed_ratio=ratio,
        speed_ratio_factors={r: speed_factor(r) for r in (1.1, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0)},
        turns=turns,
        readings=readings,
        seconds=seconds,
        # Knots per turn of a motion that leaves order 1 to within half a percent.
        knots_per_turn=0.5 * min(orders),
        notes=tuple(notes),
    )


def _dual(
    orders: tuple[float, ...], ratio: float | None, noise: float | None, error: float | None
) -> SelfPlan:
    notes = ["only sums are identifiable: output encoder with gear, motor encoder with gear"]
    turns = 3.0
    if ratio is not None:
        ratio = shaft_cycles(ratio, "none")["motor"]
        gap = min(abs(j * ratio - k) for j in range(1, 9) for k in orders)
        if abs(ratio - round(ratio)) < 1e-9:
            notes.append(
                f"the ratio of {ratio:g} is whole: output order {ratio:g} and motor order 1 "
                "are confounded; a spin-down of the motor alone separates them"
            )
        elif gap > 0.0:
            # Two lines part when they differ by a whole wave over the travel.
            turns = max(turns, math.ceil(1.0 / gap))
    notes.append("travel both ways: reversal error and delay are fitted jointly with the orders")
    return SelfPlan(
        "dual",
        orders,
        dict.fromkeys(orders, 1.0),
        turns=turns,
        readings=_readings(noise, error, 1.0),
        notes=tuple(notes),
    )


def _readings(noise: float | None, error: float | None, factor: float) -> int | None:
    if noise is None or error is None or not math.isfinite(factor):
        return None
    return readings_needed(noise, error, factor)


def designed_selfplan(sim: Simulation, method: str) -> dict[str, Any]:
    """Arguments of `plan_self` for the heads, shifts or coasts that ``sim`` designs.

    Parameters
    ----------
    sim : Simulation
    method : {"spin-down", "heads", "shifts", "dual"}

    Returns
    -------
    dict
        ``orders`` (whole ones of the output), ``noise``, and what the method needs.

    Raises
    ------
    ArgumentError
        The simulation designs nothing for this method.

    Examples
    --------
    >>> from trueangle.simulation import Head, Joint, RunDesign, Simulation
    >>> sim = Simulation(Joint(heads=(Head(0.0), Head(40.0))), sigma_arcsec=5.0)
    >>> designed_selfplan(sim, "heads")
    {'noise': 5.0, 'angles': [0.0, 40.0], 'count': 2}
    """
    found: dict[str, Any] = {}
    orders = sorted({m for m in sim.pattern.orders.tolist() if m >= 1.0 and m.is_integer()})
    if orders:
        found["orders"] = tuple(orders)
    if sim.sigma_arcsec > 0.0:
        found["noise"] = sim.sigma_arcsec
    if method == "heads":
        return found | _angles([head.angle_deg for head in sim.joint.heads], "[[head]] tables")
    if method == "shifts":
        shifts = [run.shift_deg for run in sim.runs if run.shift_deg is not None]
        return found | _angles(shifts, "[[run]] tables with shift_deg")
    if method == "dual":
        if sim.joint.gear_ratio == 1.0:
            raise ArgumentError("the simulation's joint has no gear_ratio for the method dual")
        return found | {"gear_ratio": sim.joint.gear_ratio}
    coasts = [run for run in sim.runs if run.decay_per_s > 0.0]
    if not coasts:
        raise ArgumentError(
            "the simulation has no [[run]] with a lower speed_end_deg_s to coast to"
        )
    return found | _coast(coasts[0])


def _angles(angles: list[float], what: str) -> dict[str, Any]:
    if len(angles) < 2:
        raise ArgumentError(f"the simulation needs two {what} or more, it has {len(angles)}")
    return {"angles": angles, "count": len(angles)}


def _coast(run: RunDesign) -> dict[str, Any]:
    assert run.speed_end_deg_s is not None
    ratio = run.speed_deg_s / run.speed_end_deg_s
    return {
        "speed_ratio": ratio,
        "start_speed": run.speed_deg_s / 360.0,
        "rate": run.samples * run.decay_per_s / math.log(ratio),
    }
