"""The paper's study from its Equations 8 and 9, and what its 36 positions could not show.

Run with ``python examples/paper/study.py``; prints tables only.
"""

import numpy as np

import trueangle as ta
from trueangle.cli.demo import (
    GEAR_ORDERS,
    JOINT_A,
    JOINT_B,
    PUBLISHED,
    Study,
    lifted,
    paper_study,
    reduction,
    short_report,
    simulated_groups,
)
from trueangle.planning import wanted_orders

STUDIES = 100

#: Mean reduction of both joints in the paper, percent.
PUBLISHED_MEAN = 82.03


def study_table(study: Study) -> str:
    """The paper's figures next to those of the simulated groups."""
    lines = [
        "joint   peak-to-peak, arcsec             paper                       orders retained",
    ]
    shares = []
    for name, found in study.published.items():
        before, after = found.positions
        first, last, share = PUBLISHED[name]
        shares.append(-found.at_positions)
        orders = ", ".join(f"{k:g}" for k in found.orders)
        lines.append(
            f"  {name}   {before:7.2f} -> {after:5.2f}  {-found.at_positions:6.2f} %"
            f"   {first:7.2f} -> {last:5.2f}  {share:6.2f} %   {orders}"
        )
    mean = sum(shares) / len(shares)
    lines.append(f"  mean                    {mean:6.2f} %                      {PUBLISHED_MEAN} %")
    return "\n".join(lines)


def repeated_studies() -> str:
    """Mean and standard deviation of many such studies, next to the paper's single one."""
    lines = ["joint   before, arcsec     after, arcsec      reduction            paper"]
    for joint in (JOINT_A, JOINT_B):
        found = [
            reduction(joint, simulated_groups(joint, seed=seed), sorted(joint.lines))
            for seed in range(STUDIES)
        ]
        values = np.array([(*r.positions, -r.at_positions) for r in found])
        mean, std = values.mean(axis=0), values.std(axis=0)
        first, last, share = PUBLISHED[joint.name]
        lines.append(
            f"  {joint.name}   {mean[0]:6.1f} +- {std[0]:4.1f}    {mean[1]:6.1f} +- {std[1]:4.1f}"
            f"    {mean[2]:5.1f} +- {std[2]:3.1f} %    {first} -> {last}, {share:.2f} %"
        )
    return "\n".join(lines)


def hidden_orders() -> str:
    """Same readings at the 36 positions, other orders: at the positions and in between."""
    variants = {
        "as published": {},
        "14 is 202, 16 is 200": {14: 202, 16: 200},
        "and 8 is 100": {8: 100, 14: 202, 16: 200},
        "all are gear orders": GEAR_ORDERS,
    }
    lines = [
        "joint, true orders           36 positions, p-p     everywhere, p-p       everywhere, rms"
    ]
    for joint in (JOINT_A, JOINT_B):
        for name, orders in variants.items():
            true = lifted(joint, orders)
            runs = simulated_groups(true)
            found = reduction(true, runs, sorted(joint.lines))
            lines.append(
                f"  {joint.name} {name:22} {found.positions[0]:5.0f} -> {found.positions[1]:3.0f}"
                f" ({found.at_positions:+4.0f} %)   {found.dense[0]:4.0f} -> {found.dense[1]:3.0f}"
                f" ({found.in_between:+4.0f} %)   {found.dense_rms[0]:4.1f} ->"
                f" {found.dense_rms[1]:4.1f}"
            )
    return "\n".join(lines)


def with_a_plan() -> str:
    """Three mounts, two groups each: the orders that the readings then support."""
    plan = ta.plan_mounts(100, positions=36, mounts=3)
    offsets = [o for o in plan.mount_offsets_deg for _ in range(2)]
    lines = [f"three mounts at {', '.join(f'{o:g}' for o in plan.mount_offsets_deg)} deg"]
    for joint in (JOINT_A, JOINT_B):
        true = lifted(joint)
        runs = simulated_groups(true, offsets)
        chosen = ta.select_orders(runs, wanted_orders(100), gear_ratio=100)
        held = simulated_groups(true, offsets[:1], seed=1)[0]
        found = reduction(true, runs, chosen.orders, held)
        lines.append(
            f"  {joint.name} orders {', '.join(f'{k:g}' for k in chosen.orders)}: everywhere "
            f"{found.dense[0]:.0f} -> {found.dense[1]:.1f} arcsec peak-to-peak "
            f"({found.in_between:+.0f} %), {found.dense_rms[1]:.1f} rms"
        )
    return "\n".join(lines)


def main() -> None:
    """Print everything."""
    study = paper_study()
    print("One study by the paper's method\n")
    print(study_table(study))
    print(f"\n{STUDIES} such studies\n")
    print(repeated_studies())
    print("\nThe same readings from other orders, corrected as in the paper\n")
    print(hidden_orders())
    print("\nThe plan that shows the difference\n")
    print(with_a_plan())
    print("\nIn ten lines\n")
    print(short_report(study))
    print("\nThe table behind joint a\n")
    print(study.selections["a"].summary())


if __name__ == "__main__":
    main()
