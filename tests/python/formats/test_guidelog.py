"""Guide logs of PHD2: a mount is simulated with its guiding, and its worm found again."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError, MessageLinesWarning
from trueangle.formats import guidelog
from trueangle.formats.format import Selection
from trueangle.formats.guidelog import SIDEREAL

SEED = 44
WORMS, AMPLITUDES = 144, (9.0, 2.5)  # arcsec, once and twice a turn of the worm
SCALE, DECLINATION, RATE, ANGLE = 1.5, 40.0, 3.75, 30.0
NAMES = (
    "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RAGuideDistance,DECGuideDistance,"
    "RADuration,RADirection,DECDuration,DECDirection,XStep,YStep,StarMass,SNR,ErrorCode"
)


def error(seconds):
    """Of the axis, in arcsec: commanded less true angle."""
    turns = np.radians(WORMS * SIDEREAL * seconds)
    return AMPLITUDES[0] * np.sin(turns) + AMPLITUDES[1] * np.cos(2.0 * turns)


def header(clock, more=""):
    return [
        f"Guiding Begins at {clock}",
        "Equipment Profile = Rig",
        "Dither = both axes, Dither scale = 1.000",
        f"Pixel scale = {SCALE:.2f} arc-sec/px, Binning = 1, Focal length = 500 mm",
        "Camera = Test",
        f"Mount = EQ, connected, guiding enabled, xAngle = {ANGLE}, xRate = {RATE:.3f}, "
        "yAngle = 120.0, yRate = 4.900, parity = +/+",
        "RA Guide Speed = 7.5 a-s/s, Dec Guide Speed = 7.5 a-s/s, Cal Dec = 20.0",
        f"RA = 5.00 hr, Dec = {DECLINATION} deg, Hour angle = 1.00 hr, Pier side = East",
        "Lock position = 500.000, 400.000, Star position = 500.1, 400.2, HFD = 2.5 px",
        NAMES,
    ]


def guided(begin, clock, frames, rng, step=2.0, dithers=()):
    """Lines of a section: what a camera sees while pulses keep the star in its place."""
    lines, moved, lock = header(clock), 0.0, np.array([500.0, 400.0])
    cosine, settling = np.cos(np.radians(DECLINATION)), 0
    start = None
    for k in range(1, frames + 1):
        if k in dithers:
            shift = np.array(dithers[k])
            lock = lock + shift
            a = np.radians(ANGLE)
            moved -= shift @ (np.cos(a), np.sin(a))
            lines += [
                f"INFO: DITHER by {shift[0]:.3f}, {shift[1]:.3f}, "
                f"new lock pos = {lock[0]:.3f}, {lock[1]:.3f}",
                "INFO: SETTLING STATE CHANGE, Settling started",
            ]
            settling = 6
        if k % 97 == 0:
            lines.append(f'{k},{step * k:.3f},"DROP",,,,,,,,,,,,,11,1.20,2,"Star lost - low SNR"')
            continue
        lag = error(begin + step * k) * cosine / SCALE
        start = lag if start is None else start
        raw = lag - start + moved + rng.normal(0.0, 0.02)
        pulse = round(0.7 * abs(raw) / RATE * 1000.0)
        west = raw > 0.0
        lines.append(
            f'{k},{step * k:.3f},"Mount",0.1,0.2,{raw:.3f},0.010,{0.7 * raw:.3f},0.000,'
            f"{pulse},{'W' if west else 'E'},0,,,,12345,45.67,0"
        )
        moved -= (1.0 if west else -1.0) * RATE * pulse / 1000.0
        if settling:
            settling -= 1
            if not settling:
                lines.append("INFO: SETTLING STATE CHANGE, Settling complete")
    return [*lines, f"Guiding Ends at {clock}", ""]


def night():
    rng = np.random.default_rng(SEED)
    return [
        "PHD2 version 2.6.13 [Linux], Log version 2.5. Log enabled at 2026-11-20 22:00:00",
        "",
        "Calibration Begins at 2026-11-20 22:00:30",
        "Pixel scale = 1.50 arc-sec/px, Binning = 1, Focal length = 500 mm",
        "Direction,Step,dx,dy,x,y,Dist",
        "West,0,0.000,0.000,500.0,400.0,0.000",
        "Calibration complete, mount = EQ.",
        "",
        *guided(0.0, "2026-11-20 22:10:00", 700, rng, dithers={300: (1.2, -0.7), 500: (-2.0, 0.4)}),
        *guided(1800.0, "2026-11-20 22:40:00", 800, rng, dithers={400: (0.5, 2.5)}),
        "Log closed at 2026-11-20 23:10:00",
    ]


def written(folder, lines):
    path = folder / "PHD2_GuideLog_2026-11-20_220000.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def log(tmp_path):
    return written(tmp_path, night())


def test_guiding_dithers_and_lost_stars_are_taken_out(log):
    with pytest.warns(MessageLinesWarning, match="15 frames without a star and 18 while the guid"):
        first, second = ta.read_runs(log)
    assert [len(first), len(second)] == [700 - 7 - 12, 800 - 8 - 6]
    assert (first.label, first.when) == ("1", "2026-11-20T22:10:00")
    assert second.time[0] == 1802.0
    for run in (first, second):
        np.testing.assert_allclose(run.indicated, SIDEREAL * run.time, rtol=1e-12)
        off = 3600.0 * run.error - error(run.time)
        # The noise of a frame, its rounding, and nothing that grows with the pulses.
        assert np.std(off) < 1.3 * 0.02 * SCALE / np.cos(np.radians(DECLINATION))


def test_the_sky_turns_once_more_a_year_than_there_are_days():
    """Tropical year of 365.2422 days; precession takes 1.4e-7 of it."""
    year = 365.2422
    assert SIDEREAL * 86_400.0 * year == pytest.approx(360.0 * (year + 1.0), rel=3e-7)


@pytest.mark.filterwarnings("ignore::trueangle.errors.MessageLinesWarning")
def test_what_stands_beside_the_error_is_told_with_its_line(log):
    """The other axis in seconds of arc, the star's signal to noise, and the frame's own line."""
    (batch,) = guidelog.read(log, Selection(["time_s", "declination_arcsec", "snr"]))
    np.testing.assert_allclose(batch["declination_arcsec"], 0.010 * SCALE, rtol=1e-12)
    np.testing.assert_array_equal(batch["snr"], 45.67)
    lines = log.read_text().splitlines()
    for row in (0, 1, 350, 700, 1200, batch["snr"].size - 1):
        cells = lines[guidelog.line_of(log, row) - 1].split(",")
        begins = 0.0 if row < 681 else 1800.0
        assert begins + float(cells[1]) == pytest.approx(batch["time_s"][row])


@pytest.mark.filterwarnings("ignore::trueangle.errors.MessageLinesWarning")
def test_a_worm_is_found_by_one_command(log, tmp_path, capsys):
    model = tmp_path / "mount.json"
    command = ["fit", str(log), "-o", str(model), "--shaft", "worm=144", "--orders", "worm:1,2"]
    assert main(command) == 0
    (shaft,) = [s for s in ta.load_model(model).shafts if s.name == "worm"]
    found = 3600.0 * np.hypot(shaft.cosine, shaft.sine)
    np.testing.assert_allclose(found, AMPLITUDES, atol=0.02)
    table = ["export", str(model), "--to", "csv", "--entries", "1728", "-o"]
    assert main([*table, str(tmp_path / "table.csv")]) == 0
    capsys.readouterr()
    # What a star does is no joint that was exchanged for its reference.
    assert main(["check", str(log)]) == 0
    assert "No fault found in the data" in capsys.readouterr().out
    out = str(tmp_path / "out.txt")
    assert main(["correct", str(log), "-m", str(model), "-o", out]) == 1
    assert "trueangle export" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "other", "told"),
    [
        ("Pixel scale = 1.50 arc-sec/px, B", "B", r"line 18: the guiding that begins at line 9 "),
        (f"Dec = {DECLINATION} deg", "Dec = Unknown", "states no declination"),
        (f"Dec = {DECLINATION} deg", f"Dec = {'9' * 400} deg", "states no declination"),
        ("Pixel scale = 1.50", f"Pixel scale = {'9' * 400}", "states no pixel scale"),
        ("xRate = 3.750", "xRate = none", "states no guide rate"),
        ('"Mount",0.1', '"AO",0.1', "line 19, column 'mount': frames of .* are not read"),
        ("RARawDistance,", "RawDistance,", "line 18: frames have no column RARawDistance"),
        ("2026-11-20 22:10:00", "2026-13-20 22:10:00", "line 9: no date and time"),
    ],
)
def test_what_is_missing_is_told_by_its_line(line, other, told, tmp_path):
    lines = night()
    text = "\n".join(lines[:8]) + "\n" + "\n".join(lines[8:]).replace(line, other)
    path = written(tmp_path, text.split("\n"))
    with pytest.raises(FileError, match=told):
        ta.read_runs(path)


def frames(rng, count=40):
    """Lines of frames with pulses either way and none, and their distances and moves in pixels."""
    raw, pulse = rng.normal(0.0, 2.0, count).round(3), rng.integers(-900, 900, count)
    pulse[rng.random(count) < 0.3] = 0
    lines = [
        f'{k + 1},{2.0 * (k + 1):.3f},"Mount",,,{raw[k]:.3f},,,,{abs(pulse[k]) or ""},'
        f"{'W' if pulse[k] > 0 else 'E'},,,,,,,0"
        for k in range(count)
    ]
    return lines, raw, RATE * pulse / 1000.0


def errors_of(folder, lines):
    """Errors in arcsec, and so many as the file is said to hold."""
    path = written(folder, lines)
    wanted = Selection(["time_s", "error_arcsec", "declination_arcsec"])
    (batch,) = guidelog.read(path, wanted)
    assert guidelog.contents(path).rows == batch["error_arcsec"].size
    assert np.isnan(batch["declination_arcsec"]).all()  # nothing was written there
    return batch["error_arcsec"]


@pytest.mark.parametrize("dithered", [False, True])
def test_the_error_is_the_distance_and_all_that_pulses_and_dithers_moved(dithered, tmp_path):
    """The sum written out; a pulse counts from the next frame on, a dither at once."""
    print(f"seed {SEED}")
    lines, raw, moves = frames(np.random.default_rng(SEED))
    before = np.concatenate([[0.0], np.cumsum(moves)[:-1]])
    if dithered:
        way = np.radians(ANGLE)
        for at, (x, y) in ((30, (497.0, 405.5)), (10, (502.0, 401.0))):
            lines.insert(at, f"INFO: SET LOCK POSITION, new lock pos = {x:.3f}, {y:.3f}")
        moved = np.array([[2.0, 1.0], [-5.0, 4.5]]) @ (np.cos(way), np.sin(way))
        before[10:] += moved[0]
        before[30:] += moved[1]
    found = errors_of(tmp_path, [*header("2026-11-20 22:10:00"), *lines])
    wanted = (raw + before) * SCALE / np.cos(np.radians(DECLINATION))
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-12)


def test_the_order_of_what_stands_before_frames_does_not_matter(tmp_path):
    """Of declinations that of the sky counts, of rates that of the mount, which is the first."""
    print(f"seed {SEED}")
    lines, _, _ = frames(np.random.default_rng(SEED))
    begin, *middle, names = header("2026-11-20 22:10:00")
    told = errors_of(tmp_path, [begin, *middle, names, *lines])
    more = ["AO = a device, xAngle = 12.0, xRate = 9.000", "Cal Dec = 20.0 deg"]
    again = errors_of(tmp_path, [begin, *middle[::-1], *more, names, *lines])
    np.testing.assert_array_equal(told, again)


def test_a_calibration_ends_guiding_that_was_broken_off(tmp_path):
    print(f"seed {SEED}")
    lines, _, _ = frames(np.random.default_rng(SEED))
    section = [*header("2026-11-20 22:10:00"), *lines]
    calibration = [
        "Calibration Begins at 2026-11-20 22:30:00", "Direction,Step,dx,dy,x,y,Dist",
        "West,0,0.000,0.000,500.0,400.0,0.000",
    ]  # fmt: skip
    np.testing.assert_array_equal(
        errors_of(tmp_path, section), errors_of(tmp_path, [*section, *calibration])
    )


@pytest.mark.parametrize(("scale", "taken"), [("0.00100", True), ("0.00099", False)])
def test_a_scale_of_nothing_is_refused(scale, taken, tmp_path):
    lines, _, _ = frames(np.random.default_rng(SEED), 3)
    before = [line.replace(f"{SCALE:.2f}", scale) for line in header("2026-11-20 22:10:00")]
    if taken:
        assert errors_of(tmp_path, [*before, *lines]).size == 3
    else:
        with pytest.raises(FileError, match=r"line 10: the guiding .* states no pixel scale"):
            errors_of(tmp_path, [*before, *lines])


@pytest.mark.parametrize(("column", "name"), [(1, "Time"), (5, "RARawDistance")])
def test_a_frame_without_a_number_that_is_needed_is_named(column, name, tmp_path):
    lines, _, _ = frames(np.random.default_rng(SEED), 3)
    cells = lines[1].split(",")
    cells[column] = ""
    lines[1] = ",".join(cells)
    with pytest.raises(FileError, match=f"line 12, column '{name}': a number is needed"):
        errors_of(tmp_path, [*header("2026-11-20 22:10:00"), *lines])
