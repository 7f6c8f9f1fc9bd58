"""What lies on the desk when a transcript starts: readings with what is hidden in them, and files.

Every table is written with as many digits as its instrument has, so that it is the same bytes
wherever it is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import trueangle as ta
from trueangle.model.records import FitRecord

Array = NDArray[np.float64]

ARCSEC = 1.0 / 3600.0

BELIEVED = """\
[joint]
gear_ratio = 100.0
fixed_member = "circular_spline"

[[harmonic]]
shaft = "output"
order = 1
amplitude_arcsec = 14.1
phase_deg = 243.75

[[harmonic]]
shaft = "motor"
order = 2
amplitude_arcsec = 9.0
phase_deg = 40.0

[[harmonic]]
shaft = "wave_generator"
order = 2
amplitude_arcsec = 20.0
phase_deg = 100.0

[noise]
sigma_arcsec = 2.0
"""

RUN = """
[[run]]
label = "{label}"
speed_deg_s = {speed}
samples = 320
turns = 2.0
reversals = [0.5]
torque_Nm = {torque}
temperature_C = {temperature}
current_A = {current}
mount_deg = {mount}
"""

IDENTITY = """\
[certificate]
number = "2026-0042"
item = "Joint module J7"
serial = "4711"
laboratory = "Angle laboratory"
date = 2026-11-21
reference = "36-sided polygon and autocollimator"
temperature_C = 20.3

[specification]
limit_arcsec = 80
decision_rule = "guard_band"

[[contribution]]
name = "polygon, calibration"
standard_arcsec = 0.1
"""

ROBOT = """\
[robot]
name = "arm"
""" + "".join(
    f"""
[[joint]]
name = "{name}"
gear_ratio = {ratio}
[joint.signals]
indicated = "{name}_position:rad"
reference = "{name}_laser:deg"
"""
    for name, ratio in (("shoulder", 100.0), ("elbow", 100.0), ("wrist", 50.0))
)

ARM = """\
<robot name="arm"><link name="a"/><link name="b"/><link name="c"/>
<joint name="elbow" type="revolute"><parent link="a"/><child link="b"/></joint>
<joint name="wrist" type="continuous"><parent link="b"/><child link="c"/></joint>
<transmission name="t"><joint name="elbow"/><actuator name="m">
<mechanicalReduction>101</mechanicalReduction></actuator></transmission></robot>
"""


def write_table(path: Path, columns: Mapping[str, object], digits: int = 7) -> None:
    """A CSV table; floats with so many digits behind the point."""
    cells = []
    for values in columns.values():
        array = np.asarray(values)
        form = f"%.{digits}f" if array.dtype.kind == "f" else "%s"
        cells.append([form % value for value in array.tolist()])
    rows = [",".join(columns), *(",".join(row) for row in zip(*cells, strict=True))]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def furnish(folder: Path) -> None:
    """Write everything."""
    runs = [
        RUN.format(label=f"r{k}", speed=speed, torque=torque, temperature=temperature,
                   current=0.1 + 0.04 * k * (k % 3), mount=mount)
        for k, (speed, torque, temperature, mount) in enumerate(
            [(5.0, 0.0, 20.0, 0.0), (30.0, 8.0, 20.0, 0.0), (5.0, -8.0, 32.0, 50.0),
             (30.0, 0.0, 32.0, 50.0), (12.0, 8.0, 26.0, 110.0), (12.0, -4.0, 26.0, 110.0)]
        )
    ]  # fmt: skip
    for name, text in {
        "believed.toml": BELIEVED + "".join(runs), "identity.toml": IDENTITY, "robot.toml": ROBOT,
        "arm.urdf": ARM, "printer.cfg": printer(),
    }.items():  # fmt: skip
        (folder / name).write_text(text, encoding="utf-8")
    polygon(folder)
    arm(folder)
    fleet(folder)
    months(folder)
    without_reference(folder)
    two_clocks(folder)
    faulty(folder)
    models(folder)


def models(folder: Path) -> None:
    """Models to be exported: of an arc with play, in radians of two shafts with terms, steep."""
    shaft = ta.Shaft("output", 1, [1, 2], [0.3, 0.0], [0.0, 0.1])
    found = FitRecord(900, 2, (20.0, 140.0), 0.001, signals=(("velocity", -90.0, 60.0),))
    play = (ta.Backlash(180 * ARCSEC), ta.Latency(0.002))
    known = np.diag([0.0, 1e-8, 1e-8, 4e-8, 4e-8])
    ta.HarmonicModel(
        [shaft], constant=0.25, period=360.0, terms=play, fit=found, covariance=known
    ).save(folder / "play.json")
    a = np.radians(ARCSEC)
    ta.HarmonicModel(
        [ta.Shaft("output", 1, [1, 3], [900 * a, 0.0], [0.0, 40 * a]),
         ta.Shaft("motor", 100.5, [1], [0.0], [20 * a])],
        constant=-0.01, period=2.0 * np.pi, argument="indicated",
        terms=(ta.terms.ThermalDrift(2 * a, reference_C=22.0), ta.terms.TorsionalCompliance(3 * a),
               ta.terms.CurrentCoupling(5 * a), ta.Latency(1e-4),
               ta.terms.PreslidingHysteresis(8 * a, 0.05)),
    ).save(folder / "loaded.json")  # fmt: skip
    ta.HarmonicModel([ta.Shaft("output", 1, [4, 25], [7.0, 0.0], [0.0, 0.02])], period=360.0).save(
        folder / "steep.json"
    )


def printer() -> str:
    """The list that Klipper has made of a motor: raw readings at each of its 200 full steps."""
    places = np.arange(200) * 1.8
    reading = (places + waves(places, (1.0, 40.0, 20.0))) % 360.0 / 360.0 * 65536.0
    return "[angle a]\ncalibrate = " + ", ".join(f"{v:.1f}" for v in reading) + "\n"


def waves(theta: Array, *lines: tuple[float, float, float]) -> Array:
    """Degrees of a sum of lines (order, amplitude in arcsec, phase in degrees) at degrees."""
    return ARCSEC * np.sum(
        [size * np.sin(np.radians(order * theta + phase)) for order, size, phase in lines], axis=0
    )


def polygon(folder: Path) -> None:
    """36 positions, eight runs there and back: orders 1, 4, 25, and an arc of it."""
    rng = np.random.default_rng(36)
    tables: dict[str, list[Array]] = {"run": [], "reference_deg": [], "indicated_deg": []}
    for k in range(8):
        theta = np.arange(36) * 10.0
        theta = theta[::-1] if k % 2 else theta
        error = waves(theta, (1.0, 40.0, 20.0), (4.0, 8.0, 200.0), (25.0, 12.0, 75.0))
        error += ARCSEC * (0.5 * k + rng.normal(0.0, 1.2, 36))
        tables["run"].append(np.full(36, k))
        tables["reference_deg"].append(theta)
        tables["indicated_deg"].append(theta + error)
    columns = {name: np.concatenate(parts) for name, parts in tables.items()}
    write_table(folder / "polygon.csv", columns)
    on_arc = (columns["reference_deg"] >= 40.0) & (columns["reference_deg"] <= 230.0)
    write_table(folder / "arc.csv", {name: values[on_arc] for name, values in columns.items()})


def arm(folder: Path) -> None:
    """One log of three joints, each with a laser tracker's angle."""
    rng = np.random.default_rng(3)
    time = np.arange(0.0, 20.0, 0.06)
    columns = {"time_s": time}
    for name, size, speed in (
        ("shoulder", 40.0, 40.0),
        ("elbow", 90.0, 55.0),
        ("wrist", 6.0, 70.0),
    ):
        true = speed * time
        error = waves(true, (1.0, size, speed), (2.0, size / 5.0, 10.0))
        columns[f"{name}_laser"] = true
        error += ARCSEC * rng.normal(0.0, 1.0, true.size)
        columns[f"{name}_position"] = np.radians(true + error)
    write_table(folder / "arm.csv", columns, 9)


def fleet(folder: Path) -> None:
    """Twelve units twice: SN07 is off centre, and order 2 of SN03 has grown."""
    rng = np.random.default_rng(12)
    angle = np.arange(0.0, 360.0, 8.0)
    table: dict[str, list[object]] = {
        name: [] for name in ("unit", "when", "reference_deg", "indicated_deg")
    }
    for serial in range(12):
        first, second = rng.normal([40.0, 20.0], 10.0)
        for when in ("2026-01-10", "2026-07-10"):
            first = 150.0 if serial == 7 else first
            grown = 25.0 if serial == 3 and when > "2026-06" else 0.0
            error = waves(angle, (1.0, first, 80.0), (2.0, second + grown, 30.0))
            error += ARCSEC * rng.normal(0.0, 3.0, angle.size)
            table["unit"] += [f"SN{serial:02}"] * angle.size
            table["when"] += [when] * angle.size
            table["reference_deg"] += angle.tolist()
            table["indicated_deg"] += (angle + error).tolist()
    write_table(folder / "fleet.csv", table)


def months(folder: Path) -> None:
    """Sixteen units on four dates: each of the first eight has a history of its own."""
    rng = np.random.default_rng(21)
    angle = np.arange(0.0, 360.0, 8.0)
    table: dict[str, list[object]] = {
        name: [] for name in ("unit", "when", "reference_deg", "indicated_deg")
    }
    size = rng.normal([40.0, 20.0, 8.0], [9.0, 5.0, 2.0], (16, 3))
    phase = rng.normal([80.0, 30.0, 200.0], 10.0, (16, 3))
    dates = ("2026-01-10", "2026-03-10", "2026-05-10", "2026-07-10")
    for unit in range(16):
        for k, when in enumerate(dates):
            if unit in (4, 6) and k in (1, 2):
                continue
            new, turn, zero = size[unit].copy(), phase[unit].copy(), 0.0
            if unit == 0:
                new[1] += 4.0 * k  # it grows
            elif unit == 1 and k == 3:
                new[0] += 30.0  # a step
            elif unit in (2, 3) and k == 3:  # their labels are exchanged
                new, turn = size[5 - unit], phase[5 - unit]
            elif unit == 4 and k == 3:
                new, turn = rng.normal([40.0, 20.0, 8.0], 9.0), rng.uniform(0.0, 360.0, 3)
            elif unit == 5 and k > 1:
                zero = 60.0
            elif unit == 7:
                new[2] = 60.0  # unlike the others from the start
            lines = zip((1.0, 2.0, 3.0), new.tolist(), turn.tolist(), strict=True)
            error = waves(angle, *lines) + ARCSEC * (zero + rng.normal(0.0, 2.0, angle.size))
            table["unit"] += [f"SN{unit:02}"] * angle.size
            table["when"] += [when] * angle.size
            table["reference_deg"] += angle.tolist()
            table["indicated_deg"] += (angle + error).tolist()
    write_table(folder / "months.csv", table)


def without_reference(folder: Path) -> None:
    """A shaft that coasts, four heads on a disc, clampings of two encoders, and a geared joint."""
    rng = np.random.default_rng(5)
    time = np.arange(8000) / 1000.0
    theta = 3600.0 * time - 150.0 * time**2
    coast = theta + waves(theta, (1.0, 300.0, 17.0), (2.0, 150.0, 57.0))
    coast += ARCSEC * rng.normal(0.0, 20.0, time.size)
    write_table(folder / "coast.csv", {"time_s": time, "indicated_deg": coast % 360.0})
    heads = {}
    for k, place in enumerate((0.0, 119.2, 203.7, 290.1)):
        seen = np.linspace(0.0, 720.0, 1200) + place
        seen = seen + waves(seen, (1.0, 60.0, 10.0), (3.0, 80.0, 57.0))
        heads[f"head{k + 1}_deg"] = (seen + ARCSEC * rng.normal(0.0, 5.0, 1200)) % 360.0
    write_table(folder / "heads.csv", heads)
    clampings: dict[str, list[Array]] = {
        name: [] for name in ("run", "reference_deg", "indicated_deg", "shift_deg")
    }
    for k, shift in enumerate((0.0, 50.0, 130.0, 200.0)):
        seen = np.arange(0.0, 360.0, 10.0)
        other = (seen + shift + waves(seen + shift, (1.0, 20.0, 90.0), (3.0, 6.0, 5.0))) % 360.0
        own = seen + waves(seen, (1.0, 35.0, 30.0), (2.0, 9.0, 140.0))
        own += ARCSEC * rng.normal(0.0, 1.0, seen.size)
        for name, values in zip(
            clampings, (np.full(36, k), other, own, np.full(36, shift)), strict=True
        ):
            clampings[name].append(values)
    write_table(folder / "clampings.csv", {n: np.concatenate(v) for n, v in clampings.items()})
    out = np.linspace(0.0, 360.0, 1500)
    out = np.concatenate([out, out[::-1]])
    geared = out + waves(out, (1.0, 60.0, 28.0), (2.0, 20.0, 100.0), (101.0, 15.0, 40.0))
    geared += ARCSEC * rng.normal(0.0, 3.0, out.size)
    write_table(folder / "geared.csv", {"motor_deg": 101.0 * out, "indicated_deg": geared})


def two_clocks(folder: Path) -> None:
    """The same motion by two loggers: one is 0.25 s late and runs 80 ppm fast."""
    rng = np.random.default_rng(8)
    time = np.arange(0.0, 30.0, 0.01)

    def place(at: Array) -> Array:
        return 60.0 * np.sin(0.7 * at) + 20.0 * np.sin(1.9 * at + 0.4) + 90.0

    seen = place(time)
    seen = seen + waves(seen, (1.0, 30.0, 12.0)) + ARCSEC * rng.normal(0.0, 4.0, time.size)
    write_table(folder / "encoder.csv", {"time_s": time, "indicated_deg": seen})
    other = np.arange(0.5, 29.0, 0.013)
    write_table(
        folder / "tracker.csv",
        {"time_s": (other + 0.25) * (1.0 + 8e-5), "reference_deg": place(other)},
    )


def faulty(folder: Path) -> None:
    """Data of which something is wrong: a row twice, a value that stays, a sign, an empty cell."""
    rng = np.random.default_rng(9)
    theta = np.arange(0.0, 360.0, 5.0)
    good = theta + waves(theta, (1.0, 30.0, 12.0)) + ARCSEC * rng.normal(0.0, 1.0, theta.size)
    twice = np.concatenate([np.arange(72), [20, 20, 21]])
    write_table(folder / "twice.csv", {"reference_deg": theta[twice], "indicated_deg": good[twice]})
    write_table(folder / "mirrored.csv", {"reference_deg": theta, "indicated_deg": -good})
    stale = np.where((np.arange(72) > 30) & (np.arange(72) < 44), good[30], good)
    write_table(folder / "stale.csv", {"reference_deg": theta, "indicated_deg": stale})
    text = (folder / "mirrored.csv").read_text(encoding="utf-8").splitlines()
    text[5] = text[5].split(",")[0] + ","
    (folder / "empty.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
    text[7] = "30.0,abc"
    (folder / "wrong.csv").write_text("\n".join(text) + "\n", encoding="utf-8")
    radians = np.radians(good)
    write_table(folder / "units.csv", {"reference_deg": theta, "indicated_deg": radians})
