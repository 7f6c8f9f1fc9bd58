"""What a simulation's runs are to a calibration without a reference: arguments of its plan."""

from __future__ import annotations

import math
from typing import Any

from ..errors import ArgumentError
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation


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
