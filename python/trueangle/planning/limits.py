"""Limits of the rig: what a further run may be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ArgumentError, FileError
from ..joint.signals import Signals, join_runs
from ..runs.run import CalibrationRun
from ..support.argumentkinds import told_kinds
from ..support.decoding import finite_float, read_text, shown_value, toml_value
from ..support.suggestions import did_you_mean

#: Speeds of a further run where none are stated, deg/s.
SPEEDS = (1.0, 60.0)

#: Readings of one run at most, where not stated and no earlier run had more.
SAMPLES = 360


#: Degrees of travel from which on a joint is one that turns whole turns.
WHOLE = 350.0

#: What lies a little beyond the earlier runs: kelvin, turns of the reference on its mount (deg),
#: and a load (Nm) and current (A) where there was none.
WARMER, MOUNTS, LOAD, CURRENT = 15.0, (0.0, 130.0, 250.0), 10.0, 2.0


@told_kinds
@dataclass(frozen=True)
class Limits:
    """What further runs may be: the table ``[limits]`` of a file.

    Parameters
    ----------
    arc_deg : (float, float)
        Where the output may be; one turn or more for a joint that turns freely.
    speed_deg_s : (float, float)
        Slowest and fastest.
    temperature_C, torque_Nm : (float, float)
        Coldest and warmest; the constant loads that can be put on.
    gravity_Nm : float
        The largest load that follows the angle as a weight on an arm does.
    mount_deg : tuple of float
        How far the reference can be turned on its mount.
    current_A : (float, float)
        Currents of the motor that can be set at any load; both 0: none.
    samples, runs : int
        Readings of one run and further runs, at most.
    reversals : bool
        Whether a run may turn round.

    Examples
    --------
    >>> limits = Limits(arc_deg=(0.0, 270.0), temperature_C=(20.0, 35.0))
    >>> limits.span_deg
    270.0
    """

    arc_deg: tuple[float, float] = (0.0, 360.0)
    speed_deg_s: tuple[float, float] = SPEEDS
    temperature_C: tuple[float, float] = (20.0, 20.0)
    torque_Nm: tuple[float, float] = (0.0, 0.0)
    gravity_Nm: float = 0.0
    mount_deg: tuple[float, ...] = (0.0,)
    current_A: tuple[float, float] = (0.0, 0.0)
    samples: int = SAMPLES
    runs: int = 4
    reversals: bool = True

    def __post_init__(self) -> None:
        for name in ("arc_deg", "speed_deg_s", "temperature_C", "torque_Nm", "current_A"):
            value = getattr(self, name)
            if len(value) != 2 or finite_float(value[0]) is None or finite_float(value[1]) is None:
                raise ArgumentError(f"{name} must be two finite numbers, got {value!r}")
            if value[0] > value[1]:
                raise ArgumentError(f"{name} must be the least before the most, got {value!r}")
        if self.arc_deg[0] == self.arc_deg[1]:
            raise ArgumentError(f"arc_deg must have a length, got {self.arc_deg!r}")
        if self.speed_deg_s[0] <= 0.0:
            raise ArgumentError(f"speed_deg_s must be positive, got {self.speed_deg_s!r}")
        if finite_float(self.gravity_Nm) is None or self.gravity_Nm < 0.0:
            raise ArgumentError(f"gravity_Nm must not be negative, got {self.gravity_Nm!r}")
        if not self.mount_deg or any(finite_float(mount) is None for mount in self.mount_deg):
            raise ArgumentError(f"mount_deg must be finite numbers, got {self.mount_deg!r}")
        for name, least in (("samples", 20), ("runs", 1)):
            if getattr(self, name) < least:
                raise ArgumentError(f"{name} must be at least {least}, got {getattr(self, name)}")

    @property
    def span_deg(self) -> float:
        """Degrees from one end to the other."""
        return self.arc_deg[1] - self.arc_deg[0]

    @classmethod
    def of(cls, signals: Signals) -> Limits:
        """Those of earlier readings, used where none are stated.

        One turn or the arc measured so far, 1 to 60 deg/s, the loads, temperatures, mounts and
        currents measured, and as many readings as an earlier run had (2000 at most).
        """
        bounds = signals.run_bounds()
        limits = cls(
            arc_deg=_arc(signals, bounds),
            # Readings of one run at most, where not stated, where earlier ones were logs: what
            # these do not show needs another motion, if any shows it; more can be stated.
            samples=min(max(SAMPLES, *(stop - start for start, stop in bounds)), 2000),
        )
        if signals.temperature is not None:
            limits = replace(limits, temperature_C=_range(signals.temperature))
        if signals.torque is not None:
            means = np.array([signals.torque[a:b].mean() for a, b in bounds])
            swing = max(float(np.ptp(signals.torque[a:b])) / 2.0 for a, b in bounds)
            limits = replace(
                limits, torque_Nm=_range(means, 0.01 + 0.2 * swing), gravity_Nm=round(swing, 3)
            )
        if signals.mount is not None:
            limits = replace(
                limits, mount_deg=tuple(np.unique(np.degrees(signals.mount).round(3)).tolist())
            )
        if signals.current is not None:
            limits = replace(limits, current_A=_range(signals.current))
        return limits

    @classmethod
    def of_runs(cls, runs: Sequence[CalibrationRun]) -> Limits:
        """`of` of runs."""
        return cls.of(join_runs(runs))

    def wider(self) -> Limits:
        """A little beyond what was measured, which most rigs allow."""
        low, high = self.torque_Nm
        load = max(abs(low), abs(high), self.gravity_Nm) or LOAD
        mounts = dict.fromkeys((*self.mount_deg, *MOUNTS))
        amperes = max(map(abs, self.current_A)) or CURRENT
        return replace(
            self,
            temperature_C=(self.temperature_C[0], self.temperature_C[1] + WARMER),
            torque_Nm=(min(low, -load), max(high, load)),
            gravity_Nm=max(self.gravity_Nm, load),
            mount_deg=tuple(mounts),
            current_A=(-amperes, amperes),
        )


@told_kinds
def load_limits(path: str | Path) -> Limits:
    """Read a file of limits.

    Parameters
    ----------
    path : str or Path
        TOML with the table ``[limits]``; its keys are the parameters of `Limits`, each optional.

    Returns
    -------
    Limits

    Raises
    ------
    FileError
        The file is missing, no TOML, or a key is unknown or out of range: the message names it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "limits.toml"
    >>> _ = path.write_text("[limits]" + chr(10) + "arc_deg = [-135, 135]")
    >>> load_limits(path).arc_deg
    (-135.0, 135.0)
    """
    text = read_text(path, 100_000, FileError, "a file of limits")
    document = toml_value(path, text, "a file of limits")
    for name in document:
        if name != "limits":
            raise FileError(
                path, f"unknown table {shown_value(name)}; a file of limits has [limits]"
            )
    table = document.get("limits")
    if not isinstance(table, dict):
        raise FileError(path, "has no table [limits]")
    known = {field.name: str(field.type) for field in fields(Limits)}
    values = {}
    for name, value in table.items():
        if name not in known:
            text = f"[limits]: unknown key {shown_value(name)}; it has {', '.join(known)}"
            raise FileError(path, text + did_you_mean(name, known))
        values[name] = _value(path, name, value, known[name])
    try:
        return Limits(**values)
    except ArgumentError as cause:
        raise FileError(path, f"[limits]: {cause}") from None


def _value(path: str | Path, name: str, value: Any, wanted: str) -> Any:
    def refuse(what: str) -> FileError:
        return FileError(path, f"[limits]: {name} must be {what}, got {shown_value(value)}")

    if wanted == "bool":
        if not isinstance(value, bool):
            raise refuse("true or false")
        return value
    if wanted.startswith("tuple"):
        numbers = tuple(map(finite_float, value)) if isinstance(value, list) else (None,)
        if None in numbers:
            raise refuse("a list of finite numbers")
        return numbers
    number = finite_float(value)
    if number is None or (wanted == "int" and number != int(number)):
        raise refuse("a whole number" if wanted == "int" else "a finite number")
    return int(number) if wanted == "int" else number


def _range(values: Any, least: float = 0.0) -> tuple[float, float]:
    """Least and most, rounded; one value where they are as near as ``least``."""
    low, high = round(float(np.min(values)), 3), round(float(np.max(values)), 3)
    if high - low <= least:
        low = high = round(float(np.mean(values)), 3)
    return low, high


def _arc(signals: Signals, bounds: list[tuple[int, int]]) -> tuple[float, float]:
    """Where the runs went, each taken back by whole turns to the first; one turn at least."""
    degrees = signals.degrees
    origin = float(degrees[bounds[0][0]])
    ends = []
    for start, stop in bounds:
        low, high = float(degrees[start:stop].min()), float(degrees[start:stop].max())
        if high - low >= WHOLE:
            return 0.0, max(360.0, 360.0 * round((high - low) / 360.0))
        back = 360.0 * round((0.5 * (low + high) - origin) / 360.0)
        ends.append((low - back, high - back))
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    if high - low >= WHOLE:
        return 0.0, 360.0
    return round(low, 1), round(max(high, low + 0.1), 1)
