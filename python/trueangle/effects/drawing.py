"""What effects sampled for a rehearsal are drawn from: lines, places and speeds of these runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..joint.pattern import JointPattern
from ..joint.signals import Signals

#: Low orders of the output that are sampled in addition to those of its gear.
LOW_ORDERS = tuple(("output", k) for k in range(1, 9))


@dataclass(frozen=True)
class Drawing:
    """The readings to hide an effect in, their joint, and random numbers."""

    signals: Signals
    around: JointPattern
    rng: np.random.Generator

    def between(self, low: float, high: float) -> float:
        """A number."""
        return float(self.rng.uniform(low, high))

    def whole(self, low: int, high: int) -> int:
        """A whole number below ``high``."""
        return int(self.rng.integers(low, high))

    def phase(self) -> float:
        """A phase in degrees."""
        return self.between(0.0, 360.0)

    def free_line(self) -> tuple[str, float, float]:
        """A line that the simulation does not have: shaft, order, order of the output."""
        joint, known = self.around.joint, self.around.pattern.orders
        every = (*joint.gear_orders(), *LOW_ORDERS)
        lines = [(s, float(k), float(joint.output_order(s, k))) for s, k in every]
        free = [line for line in lines if not np.any(np.isclose(known, line[2], rtol=1e-6))]
        return free[self.whole(0, len(free))]

    def carrier(self) -> float | None:
        """A line of the simulation that the gear leaves; None where it has none."""
        joint = self.around.joint
        geared = {round(float(joint.output_order(s, k)), 6) for s, k in joint.gear_orders()}
        found = [float(m) for m in self.around.pattern.orders if round(float(m), 6) in geared]
        return found[self.whole(0, len(found))] if found else None

    def reading_rate(self) -> float:
        """Readings a second in the slowest of the runs."""
        clock = self.signals.clock
        bounds = [(a, b) for a, b in self.signals.run_bounds() if b > a + 1]
        steps = [float(np.median(np.diff(clock[a:b]))) for a, b in bounds]
        return 1.0 / max(max(steps, default=1.0), 1e-12)
