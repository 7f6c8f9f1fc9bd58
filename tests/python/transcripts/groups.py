"""Several of a kind whose counts are all unlike: joints of a robot, units of a fleet, windows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import trueangle as ta
from fleets.made import units
from trueangle.model.monitor import WatchedOrder, WatchedWindow
from trueangle.reports.robot import RobotReport
from trueangle.support.arrays import Array

from .desk import ARCSEC, write_table
from .specimens import report, runs


def arm(folder: Path) -> None:
    """A log of five joints and their robot file: two sound, one without a pattern, two unusable."""
    rng, time = np.random.default_rng(66), np.arange(0.0, 18.0, 0.05)
    columns, text = {"time_s": time}, '[robot]\nname = "leg"\n'
    for name, speed, size, ratio in (
        ("hip", 41.0, 30.0, 100.0), ("knee", -53.0, 70.0, 50.5), ("ankle", 67.0, 0.0, None),
        ("heel", 47.0, 45.0, 80.0), ("toe", 0.0, 0.0, None),
    ):  # fmt: skip
        true = 5.0 + speed * time
        lines = size * (np.sin(np.radians(true)) + 0.2 * np.sin(np.radians(3.0 * true)))
        seen = true + ARCSEC * (lines + rng.normal(0.0, 1.0, time.size) * (name != "toe"))
        columns |= {f"{name}_ref": true, f"{name}_enc": -seen if name == "heel" else seen}
        text += f'\n[[joint]]\nname = "{name}"\n'
        text += f"gear_ratio = {ratio}\n" if ratio is not None else ""
        text += f'[joint.signals]\nindicated = "{name}_enc:deg"\nreference = "{name}_ref:deg"\n'
    write_table(folder / "leg.csv", columns)
    (folder / "leg.toml").write_text(text, encoding="utf-8")


def robot(*verdicts: str) -> RobotReport:
    """Joints of all verdicts: with a gain, without, not held out, without a model, diagnosed."""
    reports = {}
    for k, verdict in enumerate(verdicts):
        made = report(size=1.0 + k) if verdict == "diagnosed" else ta.report(
            runs(1.0 + k), orders=[1, 3], title=f"Joint {k}"
        )  # fmt: skip
        content = made.content
        if verdict == "no gain":
            content["gain"] |= {"reduction_percent": 4.0, "reduction_low_percent": -2.0}
        elif verdict != "gain":
            content["gain"] = None if verdict != "diagnosed" else content["gain"]
        content["model"] = None if verdict == "no model" else content["model"]
        reports[f"joint {k}"] = made
    return RobotReport("Five joints", reports)


def fleet(count: int, dates: tuple[str | None, ...] = (None,), **options: Any) -> ta.Fleet:
    """Units: the third grows, the sixth has another pattern, the ninth has moved its zero."""

    def changed(unit: int, date: int, own: Array) -> tuple[Array, float]:
        own[1] += 5.0 * date * (unit == 2)
        own[0] += 400.0 * (unit == 5)
        return own, 90.0 * (unit == 8 and date > 0)

    rng = np.random.default_rng(64)
    made = units(rng, count, dates=dates, change=changed, places=np.arange(45) * 8.0, runs=1)
    return ta.fleet(made, **options)


def windows(count: int, orders: int, alarms: tuple[int, ...] = ()) -> list[WatchedWindow]:
    """Windows of a watched joint, of so many orders; those that alarm have their reason."""
    found = []
    for k in range(1, count + 1):
        rows = tuple(
            WatchedOrder(
                float(m),
                1e-4 * (m + 0.1 * (k * m % 5)),
                10.0 * m,
                (m * 5 % 14 + 0.01 * k) * (k % 3 > 0),
            )
            for m in range(1, orders + 1)
        )
        alarm = k in alarms
        why = f"order {k} moved by {k + 0.5} arcsec" if alarm else ""
        time = None if k % 2 else 12.5 * (k - 4)
        found.append(
            WatchedWindow(k, 0.0, time, 90, rows, 5.0 + 0.75 * k, 6.0 + 0.05 * k, alarm, why)
        )
    return found
