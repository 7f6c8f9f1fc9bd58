"""What the angles of a run are made of: reversed sensors, errors, offsets, facets; and when."""

import numpy as np
import pandas as pd
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError

ROWS = 36
NOMINAL = np.arange(ROWS) * 10.0
ERROR = 20.0 * np.sin(np.radians(NOMINAL)) + 7.0  # arcsec
READ = NOMINAL + ERROR / 3600.0


def saved(path, **columns):
    """A CSV of columns, texts or numbers."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def each_door(path, tmp_path, sign=1, **reading):
    """First order in arcsec, in memory, in one pass, and of the table in memory."""
    fits = [ta.fit(path, [1], **reading), ta.fit_logs(path, [1], loss="linear", **reading)]
    import trueangle.logs.fitting as fitting

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(fitting, "logs_hold_at_most", lambda *_args: False)
        fits.append(ta.fit_logs(path, [1], loss="linear", **reading))
    found = []
    for fit in fits:
        (shaft,) = fit.model.shafts
        arcsec = 1_296_000.0 / fit.model.period
        found.append((shaft.cosine[0] * arcsec, shaft.sine[0] * arcsec))
    assert {fit.model.indicated_sign for fit in fits} == {sign}
    np.testing.assert_allclose(found[1:], found[:1] * 2, atol=1e-6)
    return found[0]


def test_a_reversed_sensor_by_every_door(tmp_path):
    path = saved(tmp_path / "a.csv", reference_deg=NOMINAL, enc=-READ)
    signals = {"indicated": ("-enc", "deg")}
    assert np.allclose(each_door(path, tmp_path, -1, signals=signals), (0.0, 20.0), atol=1e-6)
    path = saved(tmp_path / "b.csv", ref=-NOMINAL, indicated_deg=READ)
    signals = {"reference": ("-ref", "deg")}
    assert np.allclose(each_door(path, tmp_path, signals=signals), (0.0, 20.0), atol=1e-6)


def test_a_column_whose_name_begins_with_a_minus_is_itself(tmp_path):
    columns = {"reference_deg": NOMINAL, "enc": READ + 90.0, "-enc": READ}
    path = saved(tmp_path / "a.csv", **columns)
    (run,) = ta.read_runs(path, signals={"indicated": ("-enc", "deg")})
    np.testing.assert_array_equal(run.indicated, READ)
    assert run.indicated_sign == -1
    with pytest.raises(FileError, match=r"column 'encoder': no such column"):
        ta.read_runs(path, signals={"indicated": ("-encoder", "deg")})


@pytest.mark.parametrize("partial", [False, True])
def test_a_reversed_sensor_is_corrected_in_its_own_sense(partial, tmp_path):
    angles = np.arange(0.0, 180.0 if partial else 360.0, 2.5)
    error = 0.5 * np.sin(np.radians(angles)) + 0.1
    run = ta.CalibrationRun(angles, angles + error, 360.0)
    model = ta.fit([run], [1]).model
    path = saved(tmp_path / "log.csv", enc=-(angles + error), x=angles)
    columns = {"indicated": ("-enc", "deg")}
    report = ta.correct_logs(path, model, tmp_path / "out.csv", signals=columns)
    assert report.is_done, report.logs[0].error
    after = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(after[:, -1], -model.correct(angles + error), atol=1e-12)
    (joint,) = report.logs[0].result["joints"]
    size = np.abs(model.correct(angles + error) - angles - error)
    assert joint["max_abs_correction_arcsec"] == pytest.approx(3600.0 * size.max())
    plain = saved(tmp_path / "plain.csv", enc=angles + error)
    report = ta.correct_logs(plain, model, tmp_path / "other.csv", column="enc", unit="deg")
    assert report.logs[0].result["joints"][0]["outside_span"] == joint["outside_span"]


@pytest.mark.parametrize("name", ["enc", "-enc"])
@pytest.mark.parametrize("period", [360.0, 1.0])
def test_a_model_of_a_reversed_sensor_corrects_what_it_reads_by_every_door(name, period, tmp_path):
    """The minus is taken once, whether the column is named with it or not."""
    unit = period / 360.0
    run = ta.CalibrationRun(NOMINAL * unit, (READ + 3.0) * unit, period, indicated_sign=-1)
    model = ta.fit([run], [1]).model
    read, wanted = -(READ + 3.0), -NOMINAL
    path = saved(tmp_path / "log.csv", enc=read)
    columns = {"indicated": (name, "deg")}
    assert ta.correct_logs(path, model, tmp_path / "out.csv", signals=columns).is_done
    after = np.loadtxt(tmp_path / "out.csv", delimiter=",", skiprows=1)[:, -1]
    np.testing.assert_allclose(after, wanted, atol=1e-7)
    table = pd.DataFrame({"enc": read})
    after = ta.correct(table, model, signals=columns)["corrected_deg"]
    np.testing.assert_allclose(after, wanted, atol=1e-7)
    for bare in (read * unit, table["enc"] * unit):
        np.testing.assert_allclose(ta.correct(bare, model), wanted * unit, atol=1e-7)
    np.testing.assert_allclose(model.correct((READ + 3.0) * unit), NOMINAL * unit, atol=1e-7)


def test_runs_of_a_reversed_sensor_are_written_and_read_as_such(tmp_path):
    run = ta.CalibrationRun(NOMINAL, READ, 360.0, indicated_sign=-1)
    path = tmp_path / "runs.csv"
    ta.write_runs(run, path)
    assert np.allclose(each_door(path, tmp_path, -1), (0.0, 20.0), atol=1e-6)
    model = ta.fit([run], [1]).model
    assert ta.correct_logs(path, model, tmp_path / "out.csv").is_done
    table = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True, deletechars="")
    np.testing.assert_allclose(table["-corrected_deg"], NOMINAL, atol=1e-7)


def test_sensors_that_count_either_way_are_not_fitted_as_one(tmp_path):
    runs = [ta.CalibrationRun(NOMINAL, READ, 360.0, indicated_sign=s) for s in (1, -1)]
    refused = pytest.raises(ArgumentError, match="indicated angles of some runs are minus what")
    with refused:
        ta.fit(runs, [1])
    for k, run in enumerate(runs):
        ta.write_runs(run, tmp_path / f"{k}.csv")
    with pytest.MonkeyPatch.context() as patched, refused:
        patched.setattr("trueangle.logs.fitting.logs_hold_at_most", lambda *_args: False)
        ta.fit_logs(tmp_path, [1])
    for wrong in (0, 2, True, "-1"):
        with pytest.raises(ArgumentError, match="indicated_sign must be 1, or -1 where"):
            ta.CalibrationRun(NOMINAL, READ, 360.0, indicated_sign=wrong)


@pytest.mark.parametrize("beside", ["reference", "indicated"])
def test_an_error_stands_for_one_of_the_angles(beside, tmp_path):
    angle = NOMINAL if beside == "reference" else READ
    path = saved(tmp_path / "a.csv", **{f"{beside}_deg": angle, "error_arcsec": ERROR})
    assert np.allclose(each_door(path, tmp_path), (0.0, 20.0), atol=1e-6)
    (run,) = ta.read_runs(path)
    np.testing.assert_allclose(run.reference, NOMINAL, atol=1e-12)
    np.testing.assert_allclose(run.indicated, READ, atol=1e-12)
    assert "error_arcsec" not in run.columns


def test_an_error_beside_both_angles(tmp_path):
    path = saved(
        tmp_path / "a.csv", reference_deg=NOMINAL, indicated_deg=READ, error_arcsec=0 * READ
    )
    (run,) = ta.read_runs(path)  # found by their names, the angles are enough
    np.testing.assert_array_equal(run.indicated, READ)
    np.testing.assert_array_equal(run.columns["error_arcsec"], 0.0)
    with pytest.raises(FileError, match="an error is given with one of the two angles"):
        ta.read_runs(path, signals={"error": "error_arcsec"})
    path = saved(tmp_path / "b.csv", reference_deg=NOMINAL, e=ERROR)
    with pytest.raises(FileError, match=r"'e': its unit is not known.*'error': \('e', 'arcsec'\)"):
        ta.read_runs(path, signals={"error": "e"})


def test_what_is_added_to_the_reference(tmp_path):
    first, second = 0.3 * np.cos(np.radians(NOMINAL)), np.linspace(-1.0, 2.0, ROWS)
    columns = {"reference_deg": NOMINAL, "indicated_deg": READ + (first * 60.0 + second) / 3600.0}
    path = saved(tmp_path / "a.csv", **columns, ac=first, level=-second)
    offsets = [("ac", "arcmin"), ("-level", "arcsec")]
    found = each_door(path, tmp_path, signals={"reference_offset": offsets})
    assert np.allclose(found, (0.0, 20.0), atol=1e-3)  # the nominal angle stands in the sine
    with pytest.raises(FileError, match=r"'ac': its unit is not known"):
        ta.read_runs(path, signals={"reference_offset": "ac"})
    path = saved(tmp_path / "b.csv", indicated_deg=READ, error_arcsec=ERROR, ac=first)
    with pytest.raises(FileError, match="is added to a reference, and the file has only"):
        ta.read_runs(path, signals={"reference_offset": ("ac", "arcsec")})


FACETS = np.arange(12) * 30.0
DEVIATIONS = np.array([0.0, 3.1, -2.0, 1.0, 4.5, -0.5, 2.2, -3.3, 0.7, 1.9, -1.1, 0.4])


def polygon(tmp_path, mounts=(0.0,), facets=FACETS, deviations=DEVIATIONS):
    """Readings at the facets of a polygon, and the table of its calibration."""
    saved(tmp_path / "facets.csv", reference_deg=facets, deviation_arcsec=deviations)
    rows = []
    for mount in mounts:
        for place in FACETS:
            facet = int(np.argmin(np.abs((FACETS - place - mount + 180.0) % 360.0 - 180.0)))
            true = place + DEVIATIONS[facet] / 3600.0
            error = (20.0 * np.sin(np.radians(true)) + 7.0) / 3600.0
            rows.append((f"m{mount:g}", mount, place, true + error))
    names = ("run", "mount_deg", "reference_deg", "indicated_deg")
    columns = dict(zip(names, zip(*rows, strict=True), strict=True))
    return saved(tmp_path / "runs.csv", **columns)


@pytest.mark.parametrize("mounts", [(0.0,), (0.0, 90.0, 210.0)])
def test_deviations_of_facets_are_added_where_they_lie(mounts, tmp_path):
    path = polygon(tmp_path, mounts)
    found = each_door(path, tmp_path, facets=tmp_path / "facets.csv")
    assert np.allclose(found, (0.0, 20.0), atol=1e-4)
    assert np.hypot(*np.subtract(each_door(path, tmp_path), (0.0, 20.0))) > 0.01
    order = np.random.default_rng(3).permutation(12)  # in any order, by any turn
    polygon(tmp_path, mounts, FACETS[order] - 360.0, DEVIATIONS[order])
    # The mount stays what a run knows of itself.
    runs = ta.read_runs(path, facets=tmp_path / "facets.csv")
    assert [set(run.mount) for run in runs] == [{mount} for mount in mounts]
    again = each_door(path, tmp_path, facets=tmp_path / "facets.csv")
    np.testing.assert_allclose(again, found, atol=1e-9)


@pytest.mark.parametrize(("unit", "turn"), [("rad", 2.0 * np.pi), ("turn", 1.0)])
def test_deviations_of_facets_are_added_in_the_unit_of_the_run(unit, turn, tmp_path):
    polygon(tmp_path)
    columns = {
        f"reference_{unit}": FACETS / 360.0 * turn,
        f"indicated_{unit}": FACETS / 360.0 * turn,
    }
    path = saved(tmp_path / "runs.csv", **columns)
    (run,) = ta.read_runs(path, facets=tmp_path / "facets.csv")
    arcsec = (run.reference / run.period - FACETS / 360.0) * 1_296_000.0
    np.testing.assert_allclose(arcsec, DEVIATIONS, atol=1e-7)


def test_facets_that_do_not_fit_are_told(tmp_path, capsys):
    path = saved(tmp_path / "runs.csv", reference_deg=FACETS + 5.0, indicated_deg=FACETS + 5.0)
    polygon(tmp_path)
    runs, facets = str(tmp_path / "off.csv"), str(tmp_path / "facets.csv")
    saved(tmp_path / "off.csv", reference_deg=FACETS + 5.0, indicated_deg=FACETS + 5.0)
    assert main(["fit", runs, "--facets", facets, "-o", str(tmp_path / "m.json")]) == 1
    assert "reading 1 is at 5 deg, which is not a facet of facets.csv: the nearest is at 0 deg" in (
        capsys.readouterr().err
    )
    saved(
        tmp_path / "facets.csv", reference_deg=[0.0, 30.0, 360.0], deviation_arcsec=[1.0, 2.0, 3.0]
    )
    with pytest.raises(FileError, match=r"facets.csv, line \d.*listed once each"):
        ta.read_runs(path, facets=facets)
    saved(tmp_path / "facets.csv", angle=[0.0, 30.0], deviation_arcsec=[1.0, 2.0])
    with pytest.raises(FileError, match="reference_deg and deviation_arcsec are needed"):
        ta.read_runs(path, facets=facets)


def test_calibrations_of_units_and_days(tmp_path):
    days = ["2026-11-20T23:59:00+01:00"] * 6 + ["2026-11-21T08:00:00+01:00"] * 6
    columns = {
        "unit": ["A"] * 12 + ["B"] * 12,
        "when": days * 2,
        "run": (["fwd"] * 3 + ["rev"] * 3) * 4,
        "reference_deg": NOMINAL[:24],
        "indicated_deg": READ[:24],
    }
    path = saved(tmp_path / "a.csv", **columns)
    runs = ta.read_runs(path)
    assert [len(run) for run in runs] == [3] * 8
    assert [(r.unit, r.when[:10], r.label) for r in runs[:3]] == [
        ("A", "2026-11-20", "fwd"),
        ("A", "2026-11-20", "rev"),
        ("A", "2026-11-21", "fwd"),
    ]
    ta.write_runs(runs, tmp_path / "b.csv")
    again = ta.read_runs(tmp_path / "b.csv")
    assert [(r.unit, r.when, r.label) for r in again] == [(r.unit, r.when, r.label) for r in runs]


@pytest.mark.parametrize("zone", ["", "Z", "+05:30"])
def test_times_as_dates(zone, tmp_path):
    start = np.datetime64("2026-12-31T23:59:50", "ms")
    stamps = [f"{start + np.timedelta64(250 * i, 'ms')}{zone}" for i in range(ROWS)]
    path = saved(tmp_path / "a.csv", stamp=stamps, reference_deg=NOMINAL, indicated_deg=READ)
    (run,) = ta.read_runs(path, signals={"time": "stamp"})
    np.testing.assert_allclose(run.time, 0.25 * np.arange(ROWS), atol=1e-9)
    stamps[7] = "yesterday"
    saved(path, stamp=stamps, reference_deg=NOMINAL, indicated_deg=READ)
    with pytest.raises(FileError, match=r"line 9, column 'stamp'.*ISO 8601.*'yesterday'"):
        ta.read_runs(path, signals={"time": "stamp"})


def test_units_by_the_names_of_files(tmp_path, capsys):
    for name in ("A12", "B07"):
        saved(tmp_path / f"joint-{name}.csv", reference_deg=NOMINAL, indicated_deg=READ)
    pattern = str(tmp_path / "joint-*.csv")
    runs = ta.read_runs(pattern, unit_from=r"joint-(\w+)")
    assert [run.unit for run in runs] == ["A12", "B07"]
    assert [run.unit for run in ta.read_runs(pattern, unit_from="[AB]1?")] == ["A1", "B"]
    with pytest.raises(
        FileError, match=r"joint-A12.csv: the pattern of `unit_from=` finds nothing"
    ):
        ta.read_runs(pattern, unit_from="motor")
    with pytest.raises(ArgumentError, match="unit_from must be a regular expression"):
        ta.read_runs(pattern, unit_from="(")
    command = ["fit", pattern, "--unit-from", "motor", "-o", str(tmp_path / "m.json")]
    assert main(command) == 1
    assert "--unit-from" in capsys.readouterr().err
    assert main([*command[:3], r"joint-(\w+)", *command[4:], "--orders", "1"]) == 0


def test_runs_by_a_pattern_of_their_labels(tmp_path, capsys):
    labels = ["fwd-1", "fwd-2", "rev-1"]
    path = saved(
        tmp_path / "a.csv",
        run=np.repeat(labels, 12),
        reference_deg=NOMINAL,
        indicated_deg=READ,
    )
    model = str(tmp_path / "m.json")
    command = ["fit", str(path), "-o", model, "--orders", "1", "--json", "--run"]
    assert main([*command, "fwd-*"]) == 0
    assert ta.load_model(model).fit.runs == 2
    assert main([*command, "side-*"]) == 1
    assert "--run side-*: no such run; the runs are fwd-1, fwd-2, rev-1" in capsys.readouterr().err
    # Of several the one that there is not.
    assert main([*command, "rev-1", "--run", "fwd-3"]) == 1
    said = capsys.readouterr().err
    assert "fwd-3: no such run; the runs are fwd-1, fwd-2, rev-1; did you mean fwd-2?" in said


@pytest.mark.parametrize("command", ["check", "fit", "orders", "report", "correct"])
def test_quoted_patterns_are_expanded_by_every_command(command, tmp_path, capsys, monkeypatch):
    rng = np.random.default_rng(8)
    for i in range(3):
        read = READ + rng.normal(0.0, 1e-4, ROWS)
        saved(tmp_path / f"log{i}.csv", reference_deg=NOMINAL, indicated_deg=read)
    monkeypatch.chdir(tmp_path)
    ta.fit("log*.csv", [1]).model.save("joint.json")
    more = {"fit": ["-o", "m.json"], "report": ["-o", "r.html"]}.get(command, [])
    more = ["-m", "joint.json", "-o", "out"] if command == "correct" else more
    if command == "report":
        pytest.importorskip("matplotlib")
    assert main([command, "log*.csv", *more]) == 0
    assert main([command, "nothing*.csv", *more]) == 1
    assert "nothing*.csv: no file matches this pattern" in capsys.readouterr().err


@pytest.mark.parametrize(
    "name", ["ac_arcsec", "Autocollimator", "deviation [arcmin]", "x (arcsec)"]
)
def test_check_sees_a_deviation_that_nobody_has_asked_for(name, tmp_path, capsys):
    columns = {"reference_deg": NOMINAL, "indicated_deg": READ, name: ERROR, "speed": NOMINAL}
    path = saved(tmp_path / "runs.csv", **columns)

    def told(**reading):
        found = ta.check(path, **reading)
        return [e for e in found.cannot if "nominal" in e["what"]]

    (entry,) = told()
    assert name in entry["because"]
    assert main(["check", str(path)]) == 0
    assert "the role reference_offset" in " ".join(capsys.readouterr().out.split())
    assert not told(signals={"reference_offset": (name, "arcsec")})
    assert not told(signals={"torque": name})


@pytest.mark.parametrize("kind", ["texts", "dates", "pandas"])
def test_days_of_tables_in_memory(kind):
    start = np.datetime64("2026-11-21T23:59", "us")
    when = start + np.arange(ROWS) * np.timedelta64(4, "s")
    table = {"when": when, "reference_deg": NOMINAL, "indicated_deg": READ}
    if kind == "texts":
        table["when"] = [str(stamp) for stamp in when]
    if kind == "pandas":
        table = pytest.importorskip("pandas").DataFrame(table)
    runs = ta.read_runs(table)
    assert [(len(run), run.when[:10]) for run in runs] == [(15, "2026-11-21"), (21, "2026-11-22")]
    # When the first of its readings was taken.
    assert [np.datetime64(run.when[:19]) for run in runs] == [when[0], when[15]]


@pytest.mark.filterwarnings("ignore::trueangle.errors.UnreadColumnWarning")
def test_a_column_called_when_that_holds_no_dates(tmp_path):
    columns = {"reference_deg": NOMINAL, "indicated_deg": READ}
    for when in (np.arange(ROWS), ["early", "late"] * (ROWS // 2)):
        path = saved(tmp_path / "a.csv", when=when, **columns)
        (run,) = ta.read_runs(path)
        assert run.when is None
        assert np.allclose(each_door(path, tmp_path), (0.0, 20.0), atol=1e-6)
        with pytest.raises(FileError, match=r"line 2, column 'when': a date and time \(ISO 8601\)"):
            ta.read_runs(path, signals={"when": "when"})


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_a_time_in_any_unit_is_found_by_its_name(unit, tmp_path):
    seconds = np.arange(ROWS) * 0.25
    scaled = seconds / {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
    columns = {f"time_{unit}": scaled, "reference_deg": NOMINAL, "indicated_deg": READ}
    (run,) = ta.read_runs(saved(tmp_path / "a.csv", **columns))
    np.testing.assert_allclose(run.time, seconds, atol=1e-9)
    # One clock written in two units is one: its seconds are taken.
    both = saved(tmp_path / "b.csv", **{**columns, "time_s": seconds + 1.0})
    np.testing.assert_allclose(ta.read_runs(both)[0].time, seconds + 1.0, atol=1e-9)


def test_a_check_tells_of_a_clock_that_nobody_asked_for(tmp_path, capsys):
    from datetime import datetime, timedelta

    start = datetime(2026, 3, 1, 23, 59, 58)
    # A space between date and time, as pandas writes them: no log of camonitor.
    clock = [str(start + timedelta(milliseconds=250 * i + 1)) for i in range(ROWS)]
    path = saved(tmp_path / "a.csv", time=clock, reference_deg=NOMINAL, indicated_deg=READ)
    (entry,) = [e for e in ta.check(path).cannot if "delay" in e["what"]]
    assert entry["because"] == "column 'time' is not used"
    (run,) = ta.read_runs(path, signals={"time": "time"})
    np.testing.assert_allclose(run.time, 0.25 * np.arange(ROWS), atol=1e-9)
    known = ta.check(path, signals={"time": "time"}).cannot
    assert not any("not used" in e["because"] for e in known)
    assert main(["correct", str(path), "-m", "none.json", "-o", str(tmp_path / "b.csv")]) == 1
    assert "camonitor" not in capsys.readouterr().err


@pytest.mark.parametrize(("places", "span"), [([7.0], 0.0), ([7.0, 7.5], 0.5), ([90.0, 90.0], 0.0)])
def test_readings_at_one_place_span_nothing(places, span):
    run = ta.CalibrationRun(np.array(places), np.array(places) + 0.1, period=360.0)
    assert ta.check(run).extent.span_deg == pytest.approx(span, abs=1e-9)


@pytest.mark.parametrize("offset", ["deg", "rad", "turn", "count", "arcsec"])
@pytest.mark.parametrize("indicated", ["deg", "rad", "turn", "count"])
@pytest.mark.parametrize("reference", ["deg", "rad", "turn", "count"])
def test_every_column_has_its_own_unit_and_counts(reference, indicated, offset):
    """In counts the reference and what is added to it are of the reference's turn."""
    turn = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "arcsec": 1_296_000.0}
    own = {"reference": 4096.0, "indicated": 8192.0, "reference_offset": 4096.0}
    true = np.arange(0.0, 2.0, 0.05)
    added = 0.002 * np.cos(5.0 * true)
    said = true + 0.001 * np.sin(2.0 * np.pi * true)
    table, signals = {}, {}
    columns = (
        ("reference", reference, true - added),
        ("indicated", indicated, said),
        ("reference_offset", offset, added),
    )
    for number, (role, unit, values) in enumerate(columns):
        name = f"q{number}"
        table[name] = values * (own[role] if unit == "count" else turn[unit])
        signals[role] = [(name, unit)] if role == "reference_offset" else (name, unit)
    (run,) = ta.read_runs(
        table, signals=signals, counts_per_turn=8192, counts_per_turn_reference=4096
    )
    np.testing.assert_allclose(run.reference / run.period, true, atol=1e-12)
    np.testing.assert_allclose(run.indicated / run.period, said, atol=1e-12)


def test_counts_of_a_turn_are_of_the_column_whose_unit_nothing_states():
    """Else it has the unit of the reference."""
    true = np.arange(0.0, 6.0, 0.1)
    table = {"reference_rad": true, "enc": np.round(true * 5000 / (2.0 * np.pi))}
    (run,) = ta.read_runs(table, signals={"indicated": "enc"}, counts_per_turn=5000)
    np.testing.assert_allclose(run.indicated, true, atol=np.pi / 5000)
    (run,) = ta.read_runs(table, signals={"indicated": "enc"})
    assert run.indicated.tolist() == table["enc"].tolist()
    table = {"step": true, "indicated_turn": true}
    (run,) = ta.read_runs(table, signals={"reference": "step"}, counts_per_turn_reference=2.5)
    np.testing.assert_allclose(run.reference / run.period, true / 2.5)


@pytest.mark.parametrize("start", [0.0, 351.0])
def test_uneven_facets_are_matched_within_a_hundredth_of_their_closest_two(start, tmp_path):
    """Two facets are 5 deg apart, so a reading may be 0.05 deg off any of them."""
    facets = np.mod(start + np.array([0.0, 5.0, 90.0, 260.0]), 360.0)
    saved(tmp_path / "facets.csv", reference_deg=facets, deviation_arcsec=[1.0, -2.0, 3.0, -4.0])
    off = np.array([0.04, -0.04, 0.04, -0.04])
    path = saved(tmp_path / "near.csv", reference_deg=facets + off, indicated_deg=facets)
    (run,) = ta.read_runs(path, facets=tmp_path / "facets.csv")
    added = (run.reference - facets - off) * 3600.0
    np.testing.assert_allclose(added, [1.0, -2.0, 3.0, -4.0], atol=1e-6)
    off[3] = -0.06
    path = saved(tmp_path / "off.csv", reference_deg=facets + off, indicated_deg=facets)
    with pytest.raises(FileError, match=r"off.csv.*reading 4 is at .*not a facet of facets.csv"):
        ta.read_runs(path, facets=tmp_path / "facets.csv")
