"""From a log as its source writes it to a model, by the commands of the how-to page."""

import datetime

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.formats import camonitor
from trueangle.formats.format import Selection

SEED = 21
#: Half a degree once, a fifth twice a turn; known to a hundredth of the noise of a reading.
AMPLITUDES, NOISE = (0.5, 0.2), 0.005
TIMES = np.arange(0.0, 80.0, 0.05)
TRUE = np.where(TIMES < 40.0, 9.0 * TIMES, 720.0 - 9.0 * TIMES)


def indicated(true):
    rng = np.random.default_rng(SEED)
    error = AMPLITUDES[0] * np.sin(np.radians(true)) + AMPLITUDES[1] * np.cos(np.radians(2 * true))
    return true + error + rng.normal(0.0, NOISE, true.size)


READ = indicated(TRUE)


def fitted(folder, *arguments):
    """Orders and amplitudes in degrees of what a command makes of a file."""
    assert main(["fit", *arguments, "-o", str(folder / "model.json")]) == 0
    model = ta.load_model(folder / "model.json")
    (shaft,) = model.shafts
    amplitudes = np.hypot(shaft.cosine, shaft.sine) * 360.0 / model.period
    return shaft.orders, amplitudes


def is_the_joint(found):
    orders, amplitudes = found
    return tuple(orders) == (1, 2) and np.allclose(amplitudes, AMPLITUDES, atol=NOISE / 5.0)


def pairs(*wanted):
    return [part for entry in wanted for part in ("--signal", entry)]


TALK = ("MOT: Monitor enabled!", "MOT: Init", "MOT: sensor_direction==CW", "MOT: Ready.", "Ready.")


@pytest.mark.parametrize("talk", [TALK, ()])
def test_simplefoc(talk, tmp_path):
    rows = zip(np.radians(TRUE % 360.0), np.radians(READ % 360.0), strict=True)
    lines = [*talk, *(f"{a:.5f}\t{b:.5f}" for a, b in rows)]
    path = tmp_path / "serial.csv"
    path.write_text("\r\n".join(lines) + "\r\n", newline="")
    wanted = pairs("reference=column1:rad", "indicated=column2:rad")
    assert is_the_joint(fitted(tmp_path, str(path), *wanted))


def test_twincat(tmp_path):
    head = [
        "Name\tYT Scope Project",
        "File\tC:\\x.tcscopex",
        "",
        "Name\tAxis 1.ActPos\tName\tAxis 1.EncPos",
        "Data-Type\tREAL64\tData-Type\tREAL64",
        "SampleTime[ms]\t50\tSampleTime[ms]\t50",
        "Port\t851\tPort\t851",
        "",
    ]
    rows = zip(1e3 * TIMES, TRUE % 360.0, READ % 360.0, strict=True)
    lines = [*head, *(f"{t:.3f}\t{a:.6f}\t{t:.3f}\t{b:.6f}" for t, a, b in rows)]
    path = tmp_path / "scope.csv"
    path.write_text("\n".join(lines) + "\n")
    wanted = pairs("reference=Axis 1.ActPos:deg", "indicated=Axis 1.EncPos:deg")
    assert is_the_joint(fitted(tmp_path, str(path), *wanted))


def monitored(name, times, angles):
    start = datetime.datetime(2024, 11, 21, 23, 59, 30)
    for time, angle in zip(times.tolist(), angles.tolist(), strict=True):
        stamp = start + datetime.timedelta(seconds=time)
        yield stamp, f"{name:30} {stamp:%Y-%m-%d %H:%M:%S.%f} {angle:.5f} HIHI MINOR\n"


@pytest.mark.parametrize("together", [False, True])
def test_epics(together, tmp_path):
    enc = list(monitored("IOC:enc.RBV", TIMES + 0.0125, READ))
    ref = list(monitored("IOC:ref.RBV", TIMES, TRUE))
    away = "IOC:enc.RBV *** Not connected (PV not found)\n"
    paths = tmp_path / "enc.txt", tmp_path / "ref.txt"
    if together:
        paths = (tmp_path / "both.txt",) * 2
        enc = ref = sorted(enc + ref)
    for path, lines in zip(paths, (enc, ref), strict=True):
        path.write_text(lines[0][1] + away + "".join(line for _, line in lines[1:]))
    runs = tmp_path / "runs.csv"
    wanted = pairs("a.indicated=IOC:enc.RBV:deg", "b.reference=IOC:ref.RBV:deg")
    clocks = ["--offset", "0", "--rate", "0"]
    command = ["join", str(paths[0]), str(paths[1]), "-o", str(runs), *wanted, *clocks]
    assert main(command) == 0
    orders, _ = fitted(tmp_path, str(runs), "--nuisance", "velocity,direction", "--orders", "1,2")
    assert orders == (1, 2)
    (run,) = ta.read_runs(runs)
    # 12.5 ms at 9 deg/s are in the reading, and no more.
    off = run.indicated - run.reference - (READ - TRUE)[: len(run)]
    assert abs(np.median(np.abs(off)) - 0.0125 * 9.0) < NOISE


def test_epics_with_other_variables_between(tmp_path):
    enc, ref = monitored("ENC", TIMES + 1e-3, READ), monitored("REF", TIMES, TRUE)
    states = ("Idle", "Moving", "3 0.5 0.25 0.125", "")
    start = datetime.datetime(2024, 11, 21, 23, 59, 30)
    others = [
        (start, f"IOC:m1.STAT {start:%Y-%m-%d %H:%M:%S.%f} {state} STATE MINOR\n")
        for state in states
    ]
    lines = [line for _, line in sorted([*enc, *ref, *others])]
    path = tmp_path / "both.txt"
    path.write_text("".join(lines))
    assert camonitor.columns(path) == ["time_s", "REF", "ENC"]
    runs = tmp_path / "runs.csv"
    wanted = pairs("a.indicated=ENC:deg", "b.reference=REF:deg")
    command = ["join", str(path), str(path), "-o", str(runs), *wanted, "--offset", "0"]
    assert main([*command, "--rate", "0"]) == 0
    _, found = fitted(tmp_path, str(runs), "--orders", "1,2", "--nuisance", "velocity")
    assert np.allclose(found, AMPLITUDES, atol=NOISE)


def test_epics_times_are_those_of_the_stamps_to_a_microsecond(tmp_path):
    """Over two days, and since 2000 a double has a tenth of a microsecond."""
    path = tmp_path / "log.txt"
    seconds = np.array([0.0, 0.000123, 1.5, 30.000001, 86400.25, 172800.654321])
    path.write_text("".join(line for _, line in monitored("PV", seconds, np.zeros(6))))
    (batch,) = camonitor.read(path, Selection(["time_s", "PV"]))
    np.testing.assert_allclose(batch["time_s"] - batch["time_s"][0], seconds, atol=5e-7)


def test_epics_that_is_damaged_or_to_be_corrected(tmp_path, capsys):
    path = tmp_path / "log.txt"
    good = next(monitored("PV", np.zeros(1), np.zeros(1)))[1]
    for bad, told in (("23:59:30", "25:61:30"), (" 2024-", " 2024")):
        path.write_text(good + good.replace(bad, told))
        with pytest.raises(FileError, match=r"log.txt, line 2: a variable, date, time and value"):
            list(camonitor.read(path, Selection(["PV"])))
    path.write_text(good + good.replace(" 0.00000", " open"))
    with pytest.raises(FileError, match=r"line 2, column 'PV': a number is needed, got 'open'"):
        list(camonitor.read(path, Selection(["PV"])))
    path = tmp_path / "log.camonitor"
    path.write_text(good * 3)
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0)
    model.save(tmp_path / "model.json")
    command = ["correct", str(path), "-m", str(tmp_path / "model.json"), "--column", "PV"]
    assert main([*command, "--unit", "deg", "-o", str(tmp_path / "out.camonitor")]) == 1
    printed = capsys.readouterr()
    assert "cannot hold corrected angles" in printed.out + printed.err
    assert not (tmp_path / "out.txt").exists()


def test_ros_topics_of_two_rates(tmp_path):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    from rosbags.typesys import Stores, get_typestore

    store, kind = get_typestore(Stores.LATEST), "sensor_msgs/msg/JointState"
    kinds = store.types

    def message(time, name, angle):
        stamp = kinds["builtin_interfaces/msg/Time"](sec=int(time), nanosec=int(time % 1 * 1e9))
        empty = np.zeros(0)
        made = kinds[kind](
            header=kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=""),
            name=[name],
            position=np.array([np.radians(angle)]),
            velocity=empty,
            effort=empty,
        )
        return store.serialize_cdr(made, kind)

    slow = TIMES[::2] + 0.003
    true = np.interp(slow, TIMES, TRUE)
    bag = tmp_path / "bag"
    with rosbag2.Writer(bag, version=9, storage_plugin=rosbag2.StoragePlugin.MCAP) as writer:
        joints = writer.add_connection("/joint_states", kind, typestore=store)
        laser = writer.add_connection("/laser", kind, typestore=store)
        rows = [(t, joints, "elbow", x) for t, x in zip(TIMES, READ, strict=True)]
        rows += [(t, laser, "laser", x) for t, x in zip(slow, true, strict=True)]
        for time, topic, name, angle in sorted(rows, key=lambda row: row[0]):
            writer.write(topic, int(time * 1e9), message(time, name, angle))
    runs = tmp_path / "runs.csv"
    wanted = pairs("a.indicated=elbow:rad", "b.reference=laser:rad")
    command = ["join", str(bag), str(bag), "-o", str(runs), *wanted, "--offset", "0", "--rate", "0"]
    assert main([*command, "--topic", "/joint_states,/laser"]) == 0
    assert is_the_joint(fitted(tmp_path, str(runs)))


def test_matlab(tmp_path):
    io = pytest.importorskip("scipy.io")
    fields = {"enc": np.radians(READ), "ref": np.radians(TRUE), "t": TIMES}
    io.savemat(tmp_path / "rig.mat", {"rig": fields})
    wanted = pairs("reference=rig/ref:rad", "indicated=rig/enc:rad")
    assert is_the_joint(fitted(tmp_path, str(tmp_path / "rig.mat"), *wanted))


def test_a_table_of_a_firmware(tmp_path):
    table = np.arange(16384) * 360.0 / 16384
    counts = np.round(indicated(table) / 360.0 * 16384) % 16384
    np.savetxt(tmp_path / "table.csv", counts, "%d")
    wanted = ["--counts-per-turn", "16384"]
    # Rounding to counts leaves small lines of every order, which are there: two are asked for.
    command = [str(tmp_path / "table.csv"), *wanted, "--orders", "1,2"]
    assert is_the_joint(fitted(tmp_path, *command))
