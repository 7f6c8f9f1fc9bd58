"""What effects sampled for a rehearsal have in common: lines, places and speeds of these runs."""

from __future__ import annotations

import numpy as np

from ..joint.pattern import JointPattern
from ..joint.signals import Signals

#: Low orders of the output that are sampled in addition to those of its gear.
LOW_ORDERS = tuple(("output", k) for k in range(1, 9))


def drawn_phase(rng: np.random.Generator) -> float:
    """A phase in degrees."""
    return float(rng.uniform(0.0, 360.0))


def drawn_free_line(around: JointPattern, rng: np.random.Generator) -> tuple[str, float, float]:
    """A line that the simulation does not have: shaft, order, order of the output."""
    joint, known = around.joint, around.pattern.orders
    lines = [(s, float(k), float(joint.output_order(s, k))) for s, k in joint.gear_orders()]
    lines += [(s, float(k), float(joint.output_order(s, k))) for s, k in LOW_ORDERS]
    free = [line for line in lines if not np.any(np.isclose(known, line[2], rtol=1e-6))]
    return free[int(rng.integers(len(free)))]


def drawn_carrier(around: JointPattern, rng: np.random.Generator) -> float | None:
    """A line of the simulation that the gear leaves; None where it has none."""
    joint = around.joint
    geared = {round(float(joint.output_order(s, k)), 6) for s, k in joint.gear_orders()}
    found = [float(m) for m in around.pattern.orders if round(float(m), 6) in geared]
    return found[int(rng.integers(len(found)))] if found else None


def reading_rate(signals: Signals) -> float:
    """Readings a second in the slowest of the runs."""
    steps = [
        float(np.median(np.diff(signals.clock[a:b]))) for a, b in signals.run_bounds() if b > a + 1
    ]
    return 1.0 / max(max(steps, default=1.0), 1e-12)
