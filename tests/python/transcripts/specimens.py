"""Results of which no two counts and no two numbers are alike, for pages to be shown of.

A page that counts findings where it should count those confirmed, or takes the first of several
for the last, shows the same as long as its input has two of everything. Here eight runs stand
beside seven findings, of which five are confirmed and the first is not; of each kind of entry
there is one that takes the other branch of a sentence.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, Final
from unittest.mock import patch

import numpy as np

import trueangle as ta
from trueangle.diagnosis.beliefs import Belief
from trueangle.diagnosis.finding import Finding
from trueangle.diagnosis.gain import Gain
from trueangle.diagnosis.goodness.evidence import Evidence
from trueangle.diagnosis.levels import LevelGain
from trueangle.diagnosis.result import Diagnosis
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.quantity import Quantity
from trueangle.fitting.heldout import HeldOut, hold_out
from trueangle.joint.pattern import Harmonic
from trueangle.model.records import FitRecord
from trueangle.reports import Report
from trueangle.simulation import Joint, Simulation

from .desk import ARCSEC

#: Runs by label, readings and what was recorded; a speed gives times and the way.
_RUNS: Final[tuple[tuple[str | None, int, dict[str, Any]], ...]] = (
    ("slow", 24, {"speed": 4.0, "temperature": 20.0, "mount": 0.0}),
    ("fast", 31, {"speed": -12.5, "temperature": 23.5, "torque": -2.25}),
    ("turned", 36, {"speed": 4.0, "torque": 6.5, "mount": 50.0}),
    (None, 45, {"signals": {"direction": 0.0}}),
    ("there and back", 52, {"speed": 4.0, "temperature": 35.0, "mount": 130.0}),
    ("sixth", 33, {}),
    ("seventh", 39, {"speed": 27.0}),
    ("eighth", 29, {"speed": -4.0, "torque": 1.0}),
)


def runs(size: float = 1.0, pattern: float = 1.0) -> list[ta.CalibrationRun]:
    """Eight runs of 24 to 52 readings, in which order 1 is of 20 and order 3 of 8 arcsec."""
    rng = np.random.default_rng(63)
    found = []
    for k, (label, count, recorded) in enumerate(_RUNS):
        speed, signals = recorded.get("speed", 0.0), {**recorded}
        signals.pop("speed", None)
        # A mean of it is no median, and no first or last value.
        early = np.arange(count) < count // 3
        if "mount" in signals:
            signals["mount"] = signals["mount"] - 30.0 * early
        if "temperature" in signals:
            signals["temperature"] = signals["temperature"] - 1.5 * early
        theta = np.linspace(0.0, 350.0, count)
        theta = theta[::-1] if speed < 0.0 else theta
        if label == "there and back":
            theta = np.concatenate([theta[::2], theta[1::2][::-1]])
        error = 20.0 * np.sin(np.radians(theta + 10.0)) + 8.0 * np.cos(np.radians(3.0 * theta))
        error = size * (pattern * error + rng.normal(0.0, 1.0 + 0.2 * k, count)) + 30.0 * k
        if speed:
            step = np.abs(np.diff(theta, prepend=theta[0])) * (1 + early)
            signals["time"] = np.cumsum(step) / abs(speed)
        found.append(
            ta.CalibrationRun(theta, theta + ARCSEC * error, 360.0, label=label, **signals)
        )
    return found


def still() -> ta.CalibrationRun:
    """A run at one place."""
    return ta.CalibrationRun(np.full(20, 40.0), np.full(20, 40.001), 360.0, label="still")


def held() -> HeldOut:
    """What is gained on three runs: of one the others supported no order, two stayed in."""
    found = hold_out(ta.fit(runs()[:3], [1, 3]))
    first, bare, last = found.runs
    bare = replace(bare, model=None, after=bare.before)
    return HeldOut((first, bare, last), (("sixth", "alone"), ("eighth", "alone at -4 deg/s")))


def believed() -> Simulation:
    """A joint of ratio 25 of which order 1 is known."""
    joint = Joint(25.0, "circular_spline", "motor")
    return Simulation(joint, (Harmonic("output", 1, 17.0, 12.0),), sigma_arcsec=1.5)


class Account(Diagnosis):
    """A diagnosis with a plan, which takes no time here."""

    planned = frozenset()  # type: ignore[assignment]
    next_runs = SimpleNamespace(runs=[1], summary=lambda: "Measure next: one run at 30 deg/s.")  # type: ignore[assignment]


class Idle(Diagnosis):
    """One whose plan is that no run tells more."""

    next_runs = SimpleNamespace(runs=[], summary=lambda: "No run tells more.")  # type: ignore[assignment]


def _gain(k: int, share: float | None = None, **more: Any) -> Gain:
    interval = None if share is None else (share - 0.0625, share + 0.125)
    before, after = (9.0 - k, 40.0 - k, 21.0 - k), (2.0 + 0.25 * k, 11.0 + k, 6.0 + k)
    what, note = f"whole runs ({k + 2} parts)", more.pop("note", "")
    return Gain(what, before, after, share, interval, None, note, **more)


def _finding(k: int, cause: str, gain: Gain | None, why: str = "", **parameters: Any) -> Finding:
    quantities = {
        name: Quantity(*entry) if isinstance(entry, tuple) else Quantity(entry)
        for name, entry in parameters.items()
    }
    rivals = [("latency", 31.5 + k), ("filter_lag", 7.25 + k)] if k % 2 else []
    status = "not_confirmed" if why else "confirmed"
    return Finding(cause, quantities, {"bic_gain": 512.5 - 64 * k}, gain, rivals,
                   status=status, reason=why)  # fmt: skip


def findings() -> list[Finding]:
    """Seven with sizes of every kind; the first and the last are not confirmed."""
    level = LevelGain("velocity", "deg/s", [4.0, 12.5], [12.5], 7.5, 3.25, 0.75, (0.5, 0.875))
    open_level = LevelGain("torque", "Nm", [-2.25, 6.5], note="one level only")
    cycles = [["slow", 3], *([f"turned {i}", 10 * i] for i in range(13))]
    return [
        _finding(0, "outliers", None, "it takes 1.5 arcsec off and may not", fraction=(0.03, 0.01),
                 rows=cycles, form="spikes"),
        _finding(1, "missing_order", _gain(1, 0.8125, by_level=level), shaft="motor", order=2,
                 amplitude_arcsec=(8.25, 0.125), phase_deg=(243.75, 1.5)),
        _finding(2, "backlash", _gain(2, 0.5, by_level=open_level, note="of both directions"),
                 place_deg=(91.5, 2.5), half_width_arcsec=(6.05, 0.045)),
        _finding(3, "latency", _gain(3, 0.25), delay_s=(4.25e-4, 1.5e-5)),
        _finding(4, "missing_order", _gain(4), shaft="motor", order=2, amplitude_arcsec=2.75,
                 turns=7),
        _finding(5, "sidebands", _gain(5, 0.125), carrier=25.0, orders=[24.0, 26.0, 27.5],
                 amplitudes=([3.5, -2.25, 1.125], [0.25, 0.5, 0.0625]), rate=(0.5, 0.03)),
        _finding(7, "thermal_drift", _gain(7, -0.0625), "the interval holds zero",
                 zero_arcsec_per_K=(0.8, 0.31), pattern_per_kelvin=(0.01, 0.004)),
    ]  # fmt: skip


def spots() -> list[Ambiguity]:
    """Four questions, two of which something is seen of."""
    step = {"half_width_arcsec": Quantity(6.125, 0.25), "place_deg": Quantity(90.0)}
    lag = {"delay_s": Quantity(7.5e-4, 2.5e-5)}
    lines = {
        "amplitudes": Quantity(3.0, 0.5),
        "order": Quantity(4),
        "phase_deg": Quantity(9.0, 2.0),
    }
    return [
        Ambiguity(("thermal_drift",), "no temperature was recorded", "log one"),
        Ambiguity(("backlash", "latency"), "there is one speed", "measure a second", True, 99.5,
                  {"backlash": step, "latency": lag}),
        Ambiguity(("clock_drift", "scale_error"), "no run stops", "stop in one"),
        Ambiguity(("sidebands",), "lines lie close", "measure longer", True, 12.25,
                  {"sidebands": lines}),
    ]  # fmt: skip


@cache
def _measured() -> Diagnosis:
    return ta.diagnose(runs(), believed(), gain=False)


def diagnosis(kind: type[Diagnosis] = Account, **changed: Any) -> Diagnosis:
    """What was found of `runs`, as no readings would have it."""
    base = _measured()
    assert base.unexplained is not None
    tests = [
        Evidence("place", 9.5, 1e-5, "a line of 2.5 arcsec comes back at the same place", rms=2.5),
        Evidence("time", 8.5, 1e-4, "a line of 1.5 arcsec comes back in time", rms=1.5),
    ]
    beliefs = [
        Belief("output 1", "wrong_phase", {}, {}, {}), Belief("motor 1", "confirmed", {}, {}, {}),
        Belief("backlash", "overestimated", {}, {}, {}), Belief("motor 2", "absent", {}, {}, {}),
    ]  # fmt: skip
    held = {name: getattr(base, name) for name in base.__dataclass_fields__}
    held |= {
        "findings": findings(), "not_identifiable": spots(), "beliefs": beliefs,
        "unexplained": replace(base.unexplained, found=True, rms=3.5, evidence=tests),
    }  # fmt: skip
    return kind(**(held | changed))


def report(
    found: Diagnosis | None = None, size: float = 1.0, last: int | None = None, **options: Any
) -> Report:
    """The page of the first `runs`, or of all, with this diagnosis of them."""
    found = diagnosis() if found is None else found
    with patch("trueangle.diagnosis.diagnose", lambda *_: found):
        options = {"simulation": believed(), **options}
        made: Report = ta.report(runs(size)[:last], **options)
    return made


def folded(orders: int, positions: int = 24) -> list[ta.CalibrationRun]:
    """Three runs at so many positions, with all orders up to one: each may be another."""
    theta, rng = np.arange(positions) * 360.0 / positions, np.random.default_rng(65)
    lines = [(20.0 - m) * np.sin(np.radians(m * theta + 10.0 * m)) for m in range(1, orders + 1)]
    errors = [np.sum(lines, axis=0) + rng.normal(0.0, 0.5, positions) for _ in range(3)]
    return [ta.CalibrationRun(theta, theta + ARCSEC * e, 360.0, label=f"r{k}")
            for k, e in enumerate(errors)]  # fmt: skip


def given(record: FitRecord | None, **more: Any) -> ta.HarmonicModel:
    """A model that takes order 1 of `runs` off, made as its record says."""
    a = 20.0 * ARCSEC * np.exp(1j * np.radians(10.0))
    shaft = ta.Shaft("output", 1, [1], [float(a.imag)], [float(a.real)])
    return ta.HarmonicModel([shaft], period=360.0, fit=record, **more)
