"""Joints, rigs and what a certificate of them is worth: coverage of U by simulation.

``python -m tests.python.certificate.joints --joints 2000`` prints the share of joints whose
true error lies within U at every position.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

import trueangle as ta
from trueangle.certificate import Contribution, Identity, certify

ARCSEC = 1.0 / 3600.0


@dataclass(frozen=True)
class Rig:
    """A way to calibrate, and the orders that its joints have."""

    name: str
    travel_deg: float
    readings: int
    runs: int
    orders: tuple[int, ...]
    noise_arcsec: float
    mounts: int = 1
    contributions: tuple[Contribution, ...] = ()


RIGS = (
    Rig("polygon", 360.0, 36, 3, (1, 2, 5), 3.0,
        contributions=(Contribution("reference", 0.8),
                       Contribution("axis", 0.6, "B", "rectangular"))),
    Rig("two mounts", 360.0, 24, 4, (1, 3, 4), 2.0, mounts=2,
        contributions=(Contribution("reference", 0.5, "B", "triangular"),)),
    Rig("part of a turn", 200.0, 80, 4, (1, 2), 4.0,
        contributions=(Contribution("reference", 1.0, "B", "normal", 8.0),)),
    Rig("a third of a turn, with a ridge", 120.0, 60, 3, (1, 2, 3, 4), 2.0,
        contributions=(Contribution("reference", 0.5),)),
)  # fmt: skip


def covered(rig: Rig, seed: int) -> np.ndarray:
    """Whether the true error of one simulated joint lies within U, position by position."""
    away, rows = judged(rig, seed)
    return np.abs(away) <= [row["expanded_arcsec"] for row in rows]


def judged(rig: Rig, seed: int) -> tuple[np.ndarray, list[dict[str, float]]]:
    """How far the value of each position is off, arcsec, and what the certificate says of it."""
    rng = np.random.default_rng([20261121, seed])
    amplitude = rng.uniform(5.0, 60.0, len(rig.orders))
    phase = rng.uniform(0.0, 2.0 * np.pi, len(rig.orders))

    def true_error(angle_deg: np.ndarray) -> np.ndarray:
        turn = np.radians(angle_deg)
        return sum(
            a * np.sin(k * turn + p) for a, k, p in zip(amplitude, rig.orders, phase, strict=True)
        )

    runs = []
    for number in range(rig.runs):
        mount = (number % rig.mounts) * 360.0 / (rig.readings * rig.mounts)
        theta = mount + np.linspace(
            0.0, rig.travel_deg, rig.readings, endpoint=rig.travel_deg < 360.0
        )
        error = (
            true_error(theta)
            + rng.normal(0.0, rig.noise_arcsec, theta.size)
            + rng.normal(0.0, 900.0)
        )
        runs.append(ta.CalibrationRun(theta, theta + ARCSEC * error, period=360.0, mount=mount))
    made = certify(
        runs, Identity("1", rig.name, contributions=rig.contributions), orders=rig.orders
    )
    rows = made.content["positions"]
    angle = np.array([row["angle_deg"] for row in rows])
    truth = true_error(angle) - true_error(angle).mean()
    # What no reading shows is drawn anew for every joint and position.
    unseen = sum((_draw(item, rng, angle.size) for item in rig.contributions), np.zeros(angle.size))
    value = np.array([row["error_arcsec"] for row in rows]) + unseen
    return value - truth, rows


def _draw(item: Contribution, rng: np.random.Generator, count: int) -> np.ndarray:
    """An error as the contribution states it (JCGM 101, 6.4)."""
    unit = {
        "normal": lambda: (
            rng.standard_normal(count)
            if np.isinf(item.degrees_of_freedom)
            else rng.standard_t(item.degrees_of_freedom, count)
        ),
        "rectangular": lambda: rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), count),
        "triangular": lambda: rng.triangular(-np.sqrt(6.0), 0.0, np.sqrt(6.0), count),
    }
    return item.standard * unit[item.distribution]()


def main() -> None:
    """Print the coverage of every rig."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--joints", type=int, default=2000)
    parser.add_argument("--first-seed", type=int, default=0)
    args = parser.parse_args()
    for rig in RIGS:
        inside = np.array([covered(rig, args.first_seed + k) for k in range(args.joints)])
        share = 100.0 * inside.mean(axis=0)
        print(
            f"{rig.name:<16} {args.joints} joints: {100.0 * inside.mean():.2f} % inside U, "
            f"by position {share.min():.1f} to {share.max():.1f} %"
        )


if __name__ == "__main__":
    main()
