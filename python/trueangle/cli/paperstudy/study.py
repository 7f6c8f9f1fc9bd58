"""The paper's two joints, its study from its own equations, and what 36 positions hide.

Equations 8 and 9 of the paper give the error of two joints at 36 positions. The same
values there follow from orders of the gear (100 for 8, 202 for 14, ...), for which the
paper's correction makes the joint worse wherever it was not calibrated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ...fitting.orders.result import OrderSelection
from ...fitting.orders.select import select_orders
from ...planning.mountplan import CalibrationPlan
from ...planning.plan import plan_mounts, wanted_orders
from ...runs.aliasing import fold
from ...runs.run import CalibrationRun
from ...support.arrays import Array

#: Positions of the paper's prism and the groups it took; the last one verifies.
POSITIONS: Final = 36
GROUPS: Final = 6

#: Scatter of one reading, arcsec: what the peak-to-peak of the compensated error leaves
#: room for: 26.62 and 18.40 over 4.24 (mean range of 36 normal values) and over
#: sqrt(1 + 15/180) (15 unknowns from 180 readings).
NOISE: Final = {"a": 6.03, "b": 4.17}

#: Gear orders of ratio 100 that stand at the paper's orders on 36 positions.
GEAR_ORDERS: Final = {8: 100, 7: 101, 16: 200, 15: 201, 14: 202, 12: 300, 4: 400}

#: The paper's figures: peak-to-peak before and after in arcsec, reduction in percent.
PUBLISHED: Final = {"a": (149.53, 26.62, 82.20), "b": (101.35, 18.40, 81.85)}


@dataclass(frozen=True)
class PaperJoint:
    """Error of a joint as a sum of sines: ``{order: (amplitude in arcsec, phase in deg)}``."""

    name: str
    constant: float
    lines: Mapping[int, tuple[float, float]]

    def error(self, degrees: ArrayLike) -> Array:
        """Error in arcsec at reference angles in degrees."""
        x = np.radians(np.asarray(degrees, dtype=np.float64))
        total = np.full(x.shape, self.constant)
        for order, (amplitude, phase) in self.lines.items():
            total += amplitude * np.sin(order * x + np.radians(phase))
        return total


#: Equation 8.
JOINT_A: Final = PaperJoint(
    "a",
    0.0,
    {
        1: (14.10, 243.75),
        4: (6.91, 26.73),
        8: (18.05, 46.50),
        12: (6.66, 264.24),
        14: (33.36, 20.82),
        15: (8.94, 57.88),
        16: (19.60, 247.91),
    },
)

#: Equation 9.
JOINT_B: Final = PaperJoint(
    "b",
    -11.47,
    {
        1: (24.31, 15.81),
        4: (10.18, 187.75),
        7: (4.86, 147.06),
        8: (13.85, 258.45),
        12: (4.68, 213.24),
        14: (17.71, 115.24),
        16: (8.64, 128.30),
    },
)


def lifted(joint: PaperJoint, orders: Mapping[int, int] | None = None) -> PaperJoint:
    """The joint with some orders replaced by others that are the same at 36 positions.

    Examples
    --------
    >>> grid = np.arange(36) * 10.0
    >>> bool(np.allclose(lifted(JOINT_A).error(grid), JOINT_A.error(grid)))
    True
    """
    lines = {}
    for order, (amplitude, phase) in joint.lines.items():
        high = (GEAR_ORDERS if orders is None else orders).get(order, order)
        sign = fold(high, POSITIONS)[1] if high != order else 1
        lines[high] = (amplitude, phase if sign > 0 else 180.0 - phase)
    return PaperJoint(joint.name, joint.constant, lines)


def simulated_groups(
    joint: PaperJoint,
    offsets_deg: Sequence[float] = (0.0,) * GROUPS,
    noise: float | None = None,
    seed: int = 0,
) -> list[CalibrationRun]:
    """Groups of 36 readings, each beginning ``offset`` after the first position."""
    random = np.random.default_rng(seed)
    scatter = NOISE[joint.name] if noise is None else noise
    runs = []
    for number, offset in enumerate(offsets_deg):
        reference = np.asarray(
            np.arange(POSITIONS) * (360.0 / POSITIONS) + offset, dtype=np.float64
        )
        error = joint.error(reference) + random.normal(0.0, scatter, POSITIONS)
        runs.append(
            CalibrationRun(
                reference,
                reference + error / 3600.0,
                period=360.0,
                mount=np.full(POSITIONS, offset),
                label=f"{joint.name}{number + 1}",
            )
        )
    return runs


@dataclass(frozen=True)
class Reduction:
    """Error before and after a correction, arcsec: at the positions and everywhere.

    ``positions`` and ``dense`` are peak-to-peak (before, after), ``dense_rms`` is rms.
    """

    positions: tuple[float, float]
    dense: tuple[float, float]
    dense_rms: tuple[float, float]
    orders: tuple[float, ...]

    @property
    def at_positions(self) -> float:
        """Change of the peak-to-peak error at the positions, percent."""
        return 100.0 * (self.positions[1] / self.positions[0] - 1.0)

    @property
    def in_between(self) -> float:
        """Change of the peak-to-peak error on a dense grid, percent."""
        return 100.0 * (self.dense[1] / self.dense[0] - 1.0)


def reduction(
    joint: PaperJoint,
    runs: Sequence[CalibrationRun],
    orders: Sequence[float],
    held: CalibrationRun | None = None,
) -> Reduction:
    """Fit ``orders`` to the runs and correct a held-out run and a dense grid with them.

    ``held`` defaults to the last run, which then takes no part in the fit.
    """
    training = list(runs) if held is not None else list(runs[:-1])
    last = runs[-1] if held is None else held
    coefficients = _fit(training, orders)
    measured = 3600.0 * last.centred_error
    after = measured - _model(last.reference, orders, coefficients)
    grid = np.arange(0.0, 360.0, 0.05)
    truth = joint.error(grid)
    left = truth - _model(grid, orders, coefficients)
    return Reduction(
        (float(np.ptp(measured)), float(np.ptp(after))),
        (float(np.ptp(truth)), float(np.ptp(left))),
        (float(truth.std()), float(left.std())),
        tuple(orders),
    )


def _fit(runs: Sequence[CalibrationRun], orders: Sequence[float]) -> Array:
    """A and B of all orders in arcsec, each run's zero taken out."""
    reference = np.concatenate([run.reference for run in runs])
    error = np.concatenate([3600.0 * run.centred_error for run in runs])
    zero = np.repeat(np.eye(len(runs)), [len(run) for run in runs], axis=0)
    design = np.concatenate([_columns(reference, orders), zero], axis=1)
    return np.asarray(np.linalg.lstsq(design, error, rcond=None)[0][: 2 * len(orders)])


def _columns(degrees: Array, orders: Sequence[float]) -> Array:
    x = np.radians(degrees)[:, None] * np.asarray(orders, dtype=np.float64)
    return np.concatenate([np.cos(x), np.sin(x)], axis=1)


def _model(degrees: Array, orders: Sequence[float], coefficients: Array) -> Array:
    return np.asarray(_columns(degrees, orders) @ coefficients)


@dataclass(frozen=True)
class Study:
    """The paper's study repeated, and the same with gear orders behind the aliases.

    Attributes
    ----------
    selections : dict of str to OrderSelection
        By the paper's method, per joint.
    published : dict of str to Reduction
        Joints as the paper published them.
    gear : dict of str to Reduction
        The same joints with all aliases lifted to gear orders, corrected as in the paper.
    plan : CalibrationPlan
        Two mounts that show the difference.
    planned : dict of str to Reduction
        Gear joints read on both mounts, orders selected by evidence.
    """

    selections: dict[str, OrderSelection]
    published: dict[str, Reduction]
    gear: dict[str, Reduction]
    plan: CalibrationPlan
    planned: dict[str, Reduction]


def paper_study(seed: int = 0) -> Study:
    """Repeat the paper's study with simulated groups of both joints.

    Examples
    --------
    >>> study = paper_study()
    >>> study.gear["a"].at_positions < -75.0 and study.gear["a"].in_between > 50.0
    True
    """
    plan = plan_mounts(100.0, POSITIONS, 2)
    offsets = [o for o in plan.mount_offsets_deg for _ in range(GROUPS // 2)]
    selections, published, gear, planned = {}, {}, {}, {}
    for joint in (JOINT_A, JOINT_B):
        runs = simulated_groups(joint, seed=seed)
        selection = select_orders(runs, range(1, 18), gear_ratio=100, method="paper")
        selections[joint.name] = selection
        published[joint.name] = reduction(joint, runs, selection.orders)
        other = lifted(joint)
        gear[joint.name] = reduction(other, simulated_groups(other, seed=seed), selection.orders)
        read = simulated_groups(other, offsets, seed=seed)
        found = select_orders(read, wanted_orders(100.0), gear_ratio=100).orders
        held = simulated_groups(other, offsets[-1:], seed=seed + 1)[0]
        planned[joint.name] = reduction(other, read, found, held)
    return Study(selections, published, gear, plan, planned)
