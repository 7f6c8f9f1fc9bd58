"""Faults of the data are found before any model, and clean data have none."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError

FAULTS = (
    "duplicate_runs",
    "duplicate_rows",
    "stale_samples",
    "unsorted_time",
    "mixed_units",
    "wrong_sign",
    "swapped_channels",
    "wrong_gear_ratio",
    "saturated_travel",
    "wrapped_reference",
    "missed_counts",
)

UNUSABLE = {"unsorted_time", "mixed_units", "wrong_sign", "wrong_gear_ratio", "wrapped_reference"}


def columns(run: int, rng: np.random.Generator, count: int = 300) -> dict[str, np.ndarray]:
    """One run of a joint with an error of a degree and noise of 10 arcsec."""
    time = np.sort(rng.uniform(0.0, 18.0, count))
    sign = 1.0 if run % 2 else -1.0
    theta = 20.0 * sign * time + 5.0
    error = np.cos(np.radians(theta)) + rng.normal(0.0, 10.0 / 3600.0, count)
    return {
        "time_s": time,
        "reference_deg": theta,
        "indicated_deg": np.round((theta + 40.0 + error) * 8192) / 8192,
    }


def written(folder: Path, runs: list[dict[str, np.ndarray]], labels: list[str]) -> Path:
    path = folder / "runs.csv"
    rows = ["run,time_s,reference_deg,indicated_deg"]
    for label, run in zip(labels, runs, strict=True):
        rows += [
            f"{label},{a!r},{b!r},{c!r}"
            for a, b, c in zip(*map(np.ndarray.tolist, run.values()), strict=True)
        ]
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def faulty(fault: str, rng: np.random.Generator) -> tuple[list[dict[str, np.ndarray]], list[str]]:
    runs, labels = [columns(k, rng) for k in range(4)], ["a", "b", "c", "d"]
    one = runs[1]
    if fault == "duplicate_runs":
        runs[3] = {k: v.copy() for k, v in one.items()}
    elif fault == "duplicate_rows":
        order = np.sort(np.append(np.arange(300), [50, 51, 52]))
        runs[1] = {k: v[order] for k, v in one.items()}
    elif fault == "stale_samples":
        for k in range(20, 280, 20):
            one["indicated_deg"][k : k + 3] = one["indicated_deg"][k - 1]
    elif fault == "unsorted_time":
        one["time_s"][100], one["time_s"][101] = one["time_s"][101], one["time_s"][100]
    elif fault == "mixed_units":
        for name in ("reference_deg", "indicated_deg"):
            one[name] = np.radians(one[name])
    elif fault == "wrong_sign":
        for run in runs:
            run["indicated_deg"] = -run["indicated_deg"]
    elif fault == "swapped_channels":
        for run in runs:
            run["reference_deg"], run["indicated_deg"] = run["indicated_deg"], run["reference_deg"]
    elif fault == "wrong_gear_ratio":
        for run in runs:
            run["indicated_deg"] = 7.3 * run["indicated_deg"]
    elif fault == "saturated_travel":
        for run in runs:
            run["indicated_deg"] = np.clip(run["indicated_deg"], -250.0, 330.0)
    elif fault == "wrapped_reference":
        for run in runs:
            run["reference_deg"] = run["reference_deg"] % 180.0
    elif fault == "missed_counts":
        one["indicated_deg"][140:] -= 7.2
    return runs, labels


def test_clean_data_have_no_fault(tmp_path: Path) -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        runs, labels = faulty("none", rng)
        found = ta.check(written(tmp_path, runs, labels))
        assert found.data_faults == (), seed
        assert found.usable
        assert found.ratio == pytest.approx(1.0, abs=0.01)
        wrapped = [{**run, "reference_deg": run["reference_deg"] % 360.0} for run in runs]
        assert ta.check(written(tmp_path, wrapped, labels)).data_faults == ()


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_alone(fault: str, tmp_path: Path) -> None:
    for seed in range(3):
        runs, labels = faulty(fault, np.random.default_rng(100 + seed))
        found = ta.check(written(tmp_path, runs, labels))
        assert {f.fault for f in found.data_faults} == {fault}, (seed, found.data_faults)
        assert found.usable == (fault not in UNUSABLE)
        assert all(f.says and f.mend and f.runs for f in found.data_faults)


def test_rows_are_those_of_the_file_and_texts_count_in_the_run(tmp_path: Path) -> None:
    runs, labels = faulty("unsorted_time", np.random.default_rng(3))
    fault = ta.check(written(tmp_path, runs, labels)).data_faults[0]
    assert fault.rows == (300 + 101 + 1,)
    assert fault.runs == ("b",)
    runs, labels = faulty("missed_counts", np.random.default_rng(4))
    fault = ta.check(written(tmp_path, runs, labels)).data_faults[0]
    assert fault.rows == (300 + 140 + 1,)
    assert fault.says.startswith("the error of run b jumps by -7.2 deg at reading 141 and stays")


@pytest.mark.parametrize(("places", "span"), [(36, 360.0), (27, 260.0)])
def test_facets_of_a_polygon_are_a_whole_turn_wherever_the_joint_stopped(places, span):
    rng = np.random.default_rng(2)
    nominal = np.tile(10.0 * np.arange(places), 3)
    off = rng.normal(0.0, 15.0, nominal.size)
    found = ta.check(
        {"nominal_deg": nominal, "seen_arcsec": off, "indicated_deg": nominal + off / 3600.0},
        signals={"reference": "nominal_deg", "reference_offset": "seen_arcsec"},
    )
    assert found.extent.span_deg == pytest.approx(span, abs=0.1)


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(1)
    path = written(tmp_path, *faulty("wrong_gear_ratio", rng))
    assert main(["check", str(path), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["data_faults"][0]["fault"] == "wrong_gear_ratio"
    assert found["ratio"] == pytest.approx(7.3, rel=0.01)
    assert "73/10" in found["ratio_suggests"]
    path = written(tmp_path, *faulty("none", rng))
    assert main(["check", str(path)]) == 0
    assert "No fault found" in capsys.readouterr().out
    assert main(["check", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["directions"] == [-1, 1]
    assert found["speeds"] == pytest.approx([20.0], rel=0.02)
    assert (found["loads"], found["temperatures"], found["mounts"]) == ([], [], [])
    assert found["span_deg"] == pytest.approx(360.0, abs=10.0)
    assert any("several loads" in entry["measure"] for entry in found["cannot"])


def test_a_joint_at_rest_repeats_nothing() -> None:
    rng = np.random.default_rng(7)
    theta = np.repeat(np.arange(0.0, 360.0, 10.0), 20) + 0.0
    indicated = np.round((theta + rng.normal(0.0, 0.01, theta.size)) / 0.088) * 0.088
    run = ta.CalibrationRun(theta, indicated, period=360.0, time=np.arange(theta.size) * 0.01)
    assert ta.check(run).data_faults == ()


def test_measured_data(data_dir: Path) -> None:
    found = ta.check(data_dir / "rm44_repeat.csv")
    assert [(f.fault, f.runs) for f in found.data_faults] == [("duplicate_runs", ("10", "11"))]
    # Turns of the gear pair differ by 0.7 deg at the same places: neighbours in time say so.
    for name in ("rm44_misalignment", "resolver_stepper", "gear_pair_fit"):
        assert ta.check(data_dir / f"{name}.csv").data_faults == (), name
    # One reading of the protractor is 18 deg off those around it.
    found = ta.check(data_dir / "arm_joint_protractor.csv")
    assert [(f.fault, f.rows) for f in found.data_faults] == [("outliers", (743,))]


@pytest.mark.parametrize(
    ("places", "counts"), [(200, None), (200, 4096), (3000, None), (3000, 4096), (3000, 512)]
)
def test_an_outlier_is_found_between_places_far_apart_and_counts(
    places: int, counts: int | None
) -> None:
    """Places 1.8 deg apart are no counts of 1.8 deg, and counts are no outliers."""
    rng = np.random.default_rng(places)
    theta = np.arange(places) * 360.0 / places
    sound = theta + 0.2 * np.cos(np.radians(theta)) + rng.normal(0.0, 0.01, places)
    for off in (0.0, 3.0):
        indicated = sound + off * (np.arange(places) == 77)
        if counts is not None:
            indicated = np.round(indicated * counts / 360.0) * 360.0 / counts
        run = ta.CalibrationRun(theta, indicated, period=360.0)
        found = [(f.fault, f.rows, f.says[-10:]) for f in ta.check(run).data_faults]
        assert found == ([("outliers", (78,), "reading 78")] if off else [])
    few = ta.CalibrationRun(theta[:3], sound[:3], period=360.0)
    assert ta.check(few).cannot[0]["measure"] == "12 or more in a run"


@pytest.mark.parametrize("mounts", [(0.0, 105.0), (-30.0, 17.5, 80.0)])
def test_levels_within_one_run_are_reported(mounts: tuple[float, ...]) -> None:
    """A mean of two levels is no level; noise is one, and a drift has both of its ends."""
    rng = np.random.default_rng(41)
    place = np.arange(0.0, 360.0, 12.0)
    rows = [(x, m, 20.0 + 11.0 * i) for i, m in enumerate(mounts) for x in place]
    reference, mount, temperature = np.array(rows).T
    run = ta.CalibrationRun(
        reference,
        reference + 0.05 * np.cos(np.radians(reference - mount)),
        period=360.0,
        temperature=temperature + rng.normal(0.0, 0.2, mount.size),
        torque=np.linspace(1.0, 2.0, mount.size),
        mount=mount,
    )
    found = ta.check(run)
    assert found.extent.mounts == mounts
    expected = 20.0 + 11.0 * np.arange(len(mounts))
    assert found.extent.temperatures == pytest.approx(expected, abs=0.2)
    assert found.extent.loads == pytest.approx((1.0, 2.0), abs=0.04)
    assert found.extent.swept == ("torque",)
    assert "Nm, also between them within a run" in " ".join(found.summary().split())
    assert {"compliance", "thermal drift"} <= {*found.can}


def test_one_column_is_label_and_mount(tmp_path: Path) -> None:
    path = tmp_path / "polygon.csv"
    rows = [(x, x + 0.001 * (m + x % 7), m) for m in (0, 72, 144) for x in range(0, 360, 15)]
    path.write_text(
        "reference_deg,indicated_deg,turned\n" + "".join(f"{a},{b},{c}\n" for a, b, c in rows)
    )
    runs = ta.read_runs(path, signals={"run": "turned", "mount": ("turned", "deg")})
    assert [run.label for run in runs] == ["0", "72", "144"]
    assert [run.mount[0] for run in runs] == [0.0, 72.0, 144.0]
    assert main(["check", str(path), "--signal", "run=turned", "--signal", "mount=turned:deg"]) == 0
    path.write_text(path.read_text().replace(",144\n", ",third\n", 1))
    with pytest.raises(
        FileError, match="line 50, column 'turned': a number is needed, got 'third'"
    ):
        ta.read_runs(path, signals={"run": "turned", "mount": ("turned", "deg")})


@pytest.mark.parametrize("copies", [30, 90, 360])
def test_copies_of_rows_are_told_by_check_and_fit(copies: int, tmp_path: Path, capsys) -> None:
    """Of a third of them, too: the last rows again, of all, or of all four times more."""
    rng = np.random.default_rng(copies)
    theta = rng.uniform(0.0, 360.0, 90)
    error = 0.1 * np.sin(np.radians(theta)) + rng.normal(0.0, 3e-3, 90)
    rows = [f"{t:.4f},{t + e:.4f}" for t, e in zip(theta, error, strict=True)]
    path = tmp_path / "r.csv"
    twice = [*rows, *(4 * rows)[-copies:]]
    words = f"{copies} of {len(twice)} readings of run 1 repeat others to the last digit"
    for written in (rows, twice):
        path.write_text("\n".join(["reference_deg,indicated_deg", *written]) + "\n")
        told = [str(fault) for fault in ta.check(path).data_faults if words in fault.says]
        notes = [note for note in ta.fit(path, orders=[1]).notes if words in note]
        assert main(["fit", str(path), "--orders", "1", "-o", str(tmp_path / "m.json")]) == 0
        assert (words in capsys.readouterr().err) == (written is twice)
        assert len(told) == len(notes) == (written is twice)
    assert "(first: 91)" in notes[0]
    assert notes[0].endswith("drop the copies.")
    # It is done as it says.
    (fault,) = ta.check(path).data_faults
    kept = [row for k, row in enumerate(twice, 1) if k not in fault.rows]
    assert kept == rows


#: Faults that ordinary motion was taken for.
MOTION = {"saturated_travel", "wrapped_reference", "stale_samples"}

SEEDS = range(640, 652)


def followed(command, readings, share=0.08):
    """A joint that comes nearer to its command by a share per reading, after a few readings."""
    joint = np.empty_like(command)
    place = command[0]
    delayed = np.concatenate([np.full(readings, command[0]), command])[: command.size]
    for i, wanted in enumerate(delayed):
        place += share * (wanted - place)
        joint[i] = place
    return joint


def measured(joint, rng, noise=1e-3, size=0.4):
    error = size * np.sin(np.radians(joint) + rng.uniform(0, 6))
    return joint + error + rng.normal(0.0, noise, joint.size) + rng.uniform(-50, 50)


def trapezoid(rng):
    stops = np.repeat(rng.uniform(-140, 140, 6), 2)
    command = np.interp(np.linspace(0, 11, 1600), np.arange(12.0), stops)
    return command, measured(followed(command, 4), rng)


def integer_sweep(rng):
    up = np.arange(0.0, rng.integers(60, 200))
    rest = int(rng.integers(3, 9))
    command = np.concatenate([up, np.full(rest, up[-1]), up[::-1], np.full(rest, 0.0)])
    command = np.tile(command, 2)
    return command, measured(followed(command, 2, 0.5), rng)


def servo_steps(rng):
    size = rng.choice([43.95, 21.7, 90.0])
    level = np.arange(900) // 45
    command = size * (level % 2 if rng.integers(2) else np.abs(level % 8 - 4))
    return command, measured(followed(command, 1, 0.25), rng)


def at_rest(rng):
    wander = np.cumsum(rng.normal(0.0, 2e-3, 1500))
    command = np.full(1500, 77.0) + 20.0 * (np.arange(1500) > 1200)
    return command, measured(followed(command, 1) + wander, rng)


def counted(rng):
    joint = 60.0 * np.sin(np.linspace(0.0, 9.0, 3000)) + np.cumsum(rng.normal(0, 1e-3, 3000))
    count = 360.0 / 4096.0
    return joint, np.round(measured(joint, rng) / count) * count


def jogs(rng):
    moves = []
    place = 0.0
    for _ in range(14):
        goal = place + rng.uniform(-40, 40)
        moves += [np.linspace(place, goal, rng.integers(8, 60)), np.full(rng.integers(1, 70), goal)]
        place = goal
    command = np.concatenate(moves)
    return np.round(command, 2), measured(followed(command, 3, 0.2), rng)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("motion", [trapezoid, integer_sweep, servo_steps, at_rest, counted, jogs])
@pytest.mark.parametrize("swapped", [False, True])
def test_ordinary_motion_has_no_fault(motion, seed, swapped):
    print("seed", seed)
    reference, indicated = motion(np.random.default_rng(seed))
    pair = (indicated, reference) if swapped else (reference, indicated)
    time = np.arange(reference.size) * 0.02 if seed % 2 else None
    found = ta.check(ta.CalibrationRun(*pair, period=360.0, time=time))
    assert not MOTION & {fault.fault for fault in found.data_faults}


def swept(rng, form):
    share = np.linspace(0.0, 1.0, int(rng.integers(300, 1500)))
    path = {
        "up": 700.0 * share,
        "there and back": 240.0 * (1.0 - np.abs(2.0 * share - 1.0)),
        "to and fro": 100.0 * np.sin(9.0 * share + rng.uniform(0, 6)),
    }[form]
    theta = path + rng.uniform(-90, 90)
    return theta, measured(theta, rng)


@pytest.mark.parametrize("form", ["up", "there and back", "to and fro"])
@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("fault", ["saturated_travel", "stale_samples", "frozen"])
def test_faults_are_told_wherever_they_are(fault, column, form):
    told = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        pair = list(swept(rng, form))
        values = pair[column].copy()
        if fault == "saturated_travel":
            values = np.minimum(values, values.max() - rng.uniform(0.1, 0.3) * np.ptp(values))
        elif fault == "stale_samples":
            length = int(rng.integers(1, 6))
            for k in range(20 + int(rng.integers(9)), values.size - 20, values.size // 9):
                values[k : k + length] = values[k - 1]
        else:
            k = int(rng.uniform(0.2, 0.7) * values.size)
            values[k : k + values.size // 9] = values[k - 1]
        pair[column] = values
        found = ta.check(ta.CalibrationRun(*pair, period=360.0))
        named = "stale_samples" if fault == "frozen" else fault
        told += named in {f.fault for f in found.data_faults}
    # A fault whose beginning and end lie at turning points of the motion may pass for a rest.
    assert told >= len(SEEDS) - 2


@pytest.mark.parametrize("range_deg", [45.0, 100.0, 180.0, 250.0])
def test_a_reference_that_wraps_is_told_at_any_range(range_deg):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        theta, indicated = swept(rng, "up")
        theta = (theta + rng.uniform(0, 90)) % range_deg
        found = ta.check(ta.CalibrationRun(theta, indicated, period=360.0))
        assert "wrapped_reference" in {f.fault for f in found.data_faults}, seed


@pytest.mark.parametrize("per_count", [4, 8, 15])
def test_counts_of_unlike_sizes_are_no_fault(per_count):
    """A disc whose lines stand up to 30 % off: each count is read as often as it is wide."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        theta = np.linspace(0.0, 340.0, 6000)
        lines = np.cumsum(1.0 + 0.3 * rng.uniform(-1.0, 1.0, theta.size // per_count))
        lines *= 345.0 / lines[-1]
        read = lines[np.maximum(np.searchsorted(lines, theta, side="right") - 1, 0)]
        found = ta.check(ta.CalibrationRun(theta, read, 360.0))
        assert [fault.fault for fault in found.data_faults] == [], seed
