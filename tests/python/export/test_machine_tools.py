"""Tables of machine tools and of Mini Cheetah's controllers, run as their descriptions have it."""

import re
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.export import TARGETS
from trueangle.export.channelform import ChannelTarget
from trueangle.model.records import FitRecord

from .conftest import golden_model
from .test_machines import STRICT, run, tool
from .test_targets import made_of
from .test_told import CHANNELS

#: Of a printed degree, and of a float that holds a turn in degrees, in arcsec.
ROUNDING = 1e-4
TEXT = [name for name in TARGETS if name not in ("fmu",)]


def arc_model(start=20.0, stop=140.0):
    shaft = ta.Shaft("output", 1, [1, 2, 5], [0.3, 0.0, 0.01], [0.0, 0.1, 0.02])
    return ta.HarmonicModel([shaft], period=360.0, fit=FitRecord(900, 1, (start, stop), 0.001))


def degrees():
    return golden_model(360.0)


def test_the_offset_lut_in_the_firmwares_own_arithmetic(tmp_path):
    """Its lines of interpolation, over all readings of 16 bits, against Newton's iteration."""
    tool("gcc")
    made = ta.export_model(degrees(), "minicheetah", tmp_path / "lut.h")
    (tmp_path / "run.c").write_text(
        '#include <stdio.h>\n#include "lut.h"\nint main(void)\n{\n    int raw;\n'
        "    for (raw = 0; raw < 65536; raw++) {\n"
        "        const int low = offset_lut[raw >> 9], high = offset_lut[((raw >> 9) + 1) % 128];\n"
        '        printf("%d\\n", raw + low + (((high - low) * (raw & 511)) >> 9));\n'
        "    }\n    return 0;\n}\n"
    )
    run(["gcc", *STRICT, tmp_path / "run.c", "-o", tmp_path / "run"])
    out = subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=True).stdout
    found = np.array(out.split(), float) / 65536.0 * 360.0
    truth = degrees().correct(np.arange(65536) / 65536.0 * 360.0)
    worst = np.max(np.abs((found - truth + 180.0) % 360.0 - 180.0)) * 3600.0
    print(f"{worst} of {made.max_difference_arcsec}")
    assert worst <= made.max_difference_arcsec + ROUNDING
    assert worst > 0.9 * made.max_difference_arcsec
    assert made.max_difference_arcsec < 30.0  # a tick is 19.8
    assert made.entries == 128


def sinumerik(text):
    """Positions and values of a file, as the control's description has them."""
    values = [float(v) for v in re.findall(r"^\$AA_ENC_COMP\[0,\d+,C1\]=(\S+)$", text, re.M)]
    step, low, high = (
        float(re.search(rf"^\$AA_ENC_COMP_{key}\[0,C1\]=(\S+)$", text, re.M)[1])
        for key in ("STEP", "MIN", "MAX")
    )
    assert low + step * (len(values) - 1) == pytest.approx(high, abs=1e-6)
    return np.linspace(low, high, len(values)), np.array(values)


@pytest.mark.parametrize("model", [degrees(), arc_model()], ids=["turn", "arc"])
def test_what_the_value_is_added_to_is_the_true_angle(model):
    made = ta.export_model(model, "siemens840d", axis="C1")
    places, values = sinumerik(made.text)
    assert ("IS_MODULO[0,C1]=1" in made.text) == (model.fit is None)
    if model.fit is None:
        assert values[0] == values[-1]
    else:
        assert (places[0], places[-1]) == (20.0, 140.0)
        assert "Calibrated from 20 to 140 deg" in made.text
    reading = np.linspace(places[0], places[-1], 20011)
    actual = reading + np.interp(reading, places, values)
    worst = np.max(np.abs(actual - model.replace(fit=None).correct(reading))) * 3600.0
    print(f"{worst} of {made.max_difference_arcsec}")
    assert worst <= made.max_difference_arcsec + ROUNDING
    assert worst > 0.9 * made.max_difference_arcsec
    assert made.max_difference_arcsec < 2.0
    # The check for the operator: by how much the axis moves where the value is largest.
    flowing = made.text.replace("\n; ", " ")
    place = float(re.search(r"move to (\S+) deg and switch", flowing)[1])
    moved = float(re.search(r"must move by (\S+) deg", flowing)[1])
    assert moved == pytest.approx(-np.interp(place, places, values), rel=1e-5)
    assert made.text.endswith("M17\n")


def test_an_entry_is_added_to_the_commanded_position():
    counts = 360_000
    model = degrees()
    made = ta.export_model(model, "pmac", counts_per_turn=counts, entries=180)
    head, *lines = made.text[made.text.index("#1 DEFINE") :].strip().split("\n")
    assert head == f"#1 DEFINE COMP 180,{counts}"
    assert lines.pop() == "I51=1"
    entries = np.array(" ".join(lines).split(), int)
    assert len(entries) == 180
    assert entries[-1] == 0
    command = np.linspace(0.0, counts, 20011)
    places = np.arange(181) * counts / 180
    # The encoder is brought to command and correction: where is the joint then?
    encoder = command + np.interp(command, places, np.append(0, entries) / 16.0)
    joint = model.correct(encoder / counts * 360.0 + made.zero_deg)
    worst = np.max(np.abs(joint - command / counts * 360.0)) * 3600.0
    print(f"{worst} of {made.max_difference_arcsec}")
    assert worst <= made.max_difference_arcsec + ROUNDING
    assert worst > 0.9 * made.max_difference_arcsec
    assert made.max_difference_arcsec < 5.0


def test_counts_are_asked_for():
    with pytest.raises(ArgumentError, match="needs `counts_per_turn=`"):
        ta.export_model(degrees(), "pmac")
    with pytest.raises(ArgumentError, match=r"divisor of 360000.*got 7; near it are 6, 8"):
        ta.export_model(degrees(), "pmac", counts_per_turn=360_000, entries=7)


def test_a_table_over_a_part_of_a_turn_rolls_over(tmp_path):
    """Eight entries over a quarter of a turn are orders of four."""
    values = np.rint(1600.0 * np.sin(2.0 * np.pi * np.arange(1, 33) / 32.0)).astype(int)
    path = tmp_path / "table.pmc"
    path.write_text("#2\nDEFINE COMP 32,1000 ; one quarter\n" + " ".join(map(str, values)) + "\n")
    back = ta.import_model(path, "pmac", counts_per_turn=4000)
    assert back.orders[0] == 4.0
    # A hundred counts of four thousand; the lines between 32 entries lose 0.6 %.
    assert back.amplitudes[0] == pytest.approx(9.0, rel=0.01)


@pytest.mark.parametrize(
    ("target", "options", "ending"),
    [
        ("linuxcnc", {"type": "0"}, ".comp"),
        ("twincat", {"variant": "cnc"}, ".lis"),
        ("twincat", {"variant": "nc"}, ".csv"),
        ("siemens840d", {}, ".txt"),
    ],
)
def test_a_table_of_less_than_a_turn_is_read_back(target, options, ending, tmp_path):
    model = arc_model()
    path = tmp_path / f"part{ending}"
    made = ta.export_model(model, target, path, **options)
    asked = {key: value for key, value in options.items() if key in ("type",)}
    back = ta.import_model(path, target, **asked)
    assert back.fit.span == (20.0, 140.0)
    assert back.partial_span == (20.0, 140.0)
    assert "covers 20 to 140 deg" in back.fit.note
    x = np.linspace(20.0, 140.0, 4001)
    off = np.max(np.abs(back.error(x) - model.error(x))) * 3600.0
    table = back.fit.table.max_abs * 3600.0
    print(f"{target}: {off} of {made.max_difference_arcsec} and {table} of the arithmetic")
    assert off <= made.max_difference_arcsec * 1.05 + table
    with pytest.warns(ta.errors.OutsideSpanWarning):
        back.correct(300.0)


@pytest.mark.parametrize("target", TEXT)
def test_every_text_may_end_in_txt(target, tmp_path):
    from .test_told import export

    path = tmp_path / "table.txt"
    made = export(degrees(), target, tmp_path, path=path)
    assert path.read_text() == made.text


@pytest.mark.parametrize("bilateral", ["0", "1", None])
def test_a_list_for_one_direction_is_that_of_both(bilateral, tmp_path):
    """What stands under ``neg`` counts only where the list is bilateral."""
    pos = np.rint(900.0 * np.sin(2.0 * np.pi * np.arange(36) / 36.0)).astype(int)
    models = []
    for number, neg in enumerate((pos, pos + 400, None)):
        lines = ["kw.ssfk.interval 100000", "kw.ssfk.kw_startpos 0", "kw.ssfk.kw_nr_max 36"]
        lines += [] if bilateral is None else [f"kw.ssfk.bilateral {bilateral}"]
        for column, values in (("pos", pos), ("neg", neg)):
            if values is not None:
                lines += [f"kw.ssfk.table[{i}].{column} {v}" for i, v in enumerate(values)]
        path = tmp_path / f"{number}.lis"
        path.write_text("\n".join(lines) + "\n")
        models.append(ta.import_model(path, "twincat"))
    same, other, alone = models
    assert (same.terms, alone.terms) == ((), ())
    np.testing.assert_array_equal(alone.amplitudes, same.amplitudes)
    # Actual less programmed, 0.0001 deg: half of the difference either way.
    widths = [term.half_width for term in other.terms]
    assert widths == ([pytest.approx(0.02)] if bilateral == "1" else [])
    if bilateral != "1":
        np.testing.assert_array_equal(other.amplitudes, same.amplitudes)
        assert other.constant == same.constant


@pytest.mark.parametrize("counts", [1 << 20, 36_000, 1_000_000, 4320, 1 << 12])
def test_tables_of_a_controller_are_round_parts_of_a_turn(counts):
    """Between two entries stand whole counts, and sizes have no other factors than 2, 3 and 5."""
    sizes = TARGETS["pmac"].sizes({"counts_per_turn": counts, "entries": None})
    assert {1 << k for k in range(5, 12) if counts % (1 << k) == 0} <= set(sizes)
    assert sizes == sorted(sizes)
    for size in sizes:
        assert counts % size == 0
        assert 30**11 % size == 0


@pytest.mark.parametrize(
    ("start", "stop", "modulo"),
    [(0.0, 360.0, 1), (-180.0, 180.0, 1), (90.0, 450.0, 1), (90.0, 270.0, 0), (170.0, 190.0, 0)],
)
def test_a_list_comes_round_where_it_is_of_a_whole_turn(start, stop, modulo):
    made = ta.export_model(degrees(), "twincat", start=start, stop=stop, entries=360)
    assert f"kw.ssfk.modulo {modulo}\n" in made.text
    assert f"kw.ssfk.kw_startpos {round(start * 1e4)}\n" in made.text


A = 1.0 / 3600.0


def renumbered(text, pattern, turn):
    """With other numbers in the places of the first group of every match."""
    return re.sub(pattern, lambda m: m[0].replace(m[1], turn(float(m[1])), 1), text)


def without(text, pattern):
    return "\n".join(line for line in text.split("\n") if not re.search(pattern, line))


def set_points(text):
    """A list of TwinCAT with a position for each entry in place of an interval."""
    count = int(re.search(r"kw_nr_max (\d+)", text)[1])
    rest = without(text, r"interval|startpos")
    return rest + "".join(f"kw.ssfk.table[{i}].setpoint {30000 * i}\n" for i in range(count))


def turned(text):
    """A list of Klipper from another full step on, the other way round."""
    head, _, body = text.partition("calibrate =")
    cells = [cell.strip() for cell in body.replace("\n", "").split(",")][::-1]
    # As Klipper saves it: by whole periods of four steps.
    return f"{head}calibrate = " + ", ".join(cells[8:] + cells[:8]) + "\nother: 1\n"


def floats_of_c(text):
    """An array of SimpleFOC without its length and without the number beyond its end."""
    head, _, body = without(text, "n_lut = ").partition("{")
    cells = re.findall(r"[-+.\de]+", body.partition("}")[0])[:-1]
    lines = "\n".join(f"  {cell}f, // {k}" for k, cell in enumerate(cells))
    return f"{head.replace('n_lut + 1', '200')}{{\n{lines}\n}};"


def shuffled(text):
    lines = text.split("\n")
    return "\n".join(np.random.default_rng(5).permutation(lines).tolist())


#: Target, options of the export, other text, options of reading the other.
WAYS = {
    "twincat: set points": ("twincat", {"entries": 120}, set_points, {}),
    "twincat: lines in any order": ("twincat", {"entries": 120}, shuffled, {}),
    "twincat nc: no names": (
        "twincat", {"variant": "nc"}, lambda t: t.partition("\n")[2], {"variant": "nc"}),
    "twincat nc: one column": (
        "twincat", {"variant": "nc"},
        lambda t: "\n".join(line.rpartition(",")[0] for line in t.split("\n") if line), {}),
    "linuxcnc: words behind": (
        "linuxcnc", {}, lambda t: t.partition("\n#")[0].replace("\n", "  here\n"), {}),
    "linuxcnc: a turn further": (
        "linuxcnc", {},
        lambda t: renumbered(t, r"(?m)^(\d+\.\d+)", lambda x: f"{x + 360.0:.7f}"), {}),
    "linuxcnc: the last line not again": ("linuxcnc", {}, lambda t: without(t, r"^360"), {}),
    "linuxcnc: positions": (
        "linuxcnc", {},
        lambda t: re.sub(
            r"(?m)^(\d\S+) (\S+) (\S+)$",
            lambda m: f"{m[1]} {float(m[1]) - float(m[2]):.7f} {float(m[1]) - float(m[3]):.7f}", t),
        {"type": "0"}),
    "siemens840d: small letters, another axis": (
        "siemens840d", {"axis": "C2"},
        lambda t: t.lower().replace("=", " = ")
        + "$AA_ENC_COMP[0,0,B1]=5\n$AA_ENC_COMP_MIN[0,B1]=7\n", {}),
    "siemens840d: lines in any order": ("siemens840d", {}, shuffled, {}),
    "siemens840d: the last point not again": (
        "siemens840d", {}, lambda t: re.sub(r"(MAX\S+=)360", r"\g<1>359", t), {}),
    "siemens840d: a turn below": (
        "siemens840d", {},
        lambda t: re.sub(r"(MAX\S+=)360", r"\g<1>0", re.sub(r"(MIN\S+=)0", r"\g<1>-360", t)), {}),
    "pmac: small letters, names of motors": (
        "pmac", {"counts_per_turn": 36000},
        lambda t: t.replace("#1 DEFINE COMP 360,", "# 1 define comp 360, #2, "), {}),
    "pmac: more lines behind": (
        "pmac", {"counts_per_turn": 36000}, lambda t: t + "; 5 6\nI52=1\n", {}),
    "klipper: from another step, the other way": ("klipper", {}, turned, {}),
    "moteus: as the tool dumps it": (
        "moteus", {"source": 1},
        lambda t: shuffled(t.replace("conf set ", "") + t.replace("sources.1", "sources.0")
                           .replace("scale ", "scale 9")), {"source": 1}),
    "simplefoc: no length, floats of C": (
        "simplefoc", {"variant": "minus-float"}, floats_of_c, {"variant": "minus-float"}),
    "admt4000: reserved bits": (
        "admt4000", {},
        lambda t: re.sub(r"(MAG 0x1[579B] 0x)", r"\g<1>F", re.sub(r"(PH 0x\w+ 0x)", r"\g<1>A", t)),
        {}),
    "mechaduino: another zero": (
        "mechaduino", {},
        lambda t: renumbered(t, r"(\d+\.\d{4})", lambda x: f"{(x + 17.25) % 360.0:.4f}"), {}),
    "csv: blanks": ("csv", {}, lambda t: t.replace(",", " , "), {}),
    "csv: ends of lines": ("csv", {}, lambda t: t.replace("\n", "\r\n"), {}),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_a_table_written_otherwise_is_the_same_model(way, tmp_path):
    target, options, other, reading = WAYS[way]
    orders = (1, 2, 3, 8) if target == "admt4000" else (1, 3, 7)
    size = np.array((0.4, 0.2, 0.1, 0.05))[: len(orders)]
    shaft = ta.Shaft("output", 1, orders, size, -0.5 * size)
    model = golden_model() if target == "klipper" else ta.HarmonicModel([shaft], period=360.0)
    made, path = made_of(model, target, options, tmp_path)
    known = {k: options[k] for k in ("variant", "source", "counts_per_turn") if k in options}
    plain = ta.import_model(path, target, **known)
    text = other(path.read_text())
    assert text != path.read_text()
    second = tmp_path / f"other{path.suffix}"
    second.write_bytes(text.encode())
    found = ta.import_model(second, target, **reading)
    assert [term.kind for term in found.terms] == [term.kind for term in plain.terms]
    result = ta.compare(plain, found)
    # Of tables that end at another place the grid between the entries is another.
    assert result.max_abs_arcsec < 1e-3 * made.rms_difference_arcsec + 1e-3 + 5e-5 * 3600.0 * (
        "step" in way
    )
    assert found.fit.samples == pytest.approx(plain.fit.samples, abs=1)
    if target != "mechaduino":
        assert abs(result.zero_deg) < 1e-5


#: Targets whose one table holds nothing of terms, as asked in `test_told`.
PLAIN = [name for name, target in TARGETS.items() if not target.takes_direction]


@pytest.mark.parametrize("target", sorted({*PLAIN} - {"c", "rust", "fmu", "mujoco"}))
def test_what_a_table_leaves_out_does_not_change_it(target, tmp_path):
    """Play is on both sides of the one table: it is off by half of it either way, not by all."""
    model = golden_model(360.0)
    if isinstance(TARGETS[target], ChannelTarget):
        model = model.replace(channels=CHANNELS)
    play = model.replace(terms=(ta.Backlash(180 * A), ta.Latency(0.002)))
    options = {"counts_per_turn": 1 << 20} if target == "pmac" else {}
    plain, _ = made_of(model, target, options, tmp_path)
    with_play, _ = made_of(play, target, options, tmp_path)
    for name in ("max_difference_arcsec", "rms_difference_arcsec", "zero_deg", "lost", "entries"):
        assert getattr(with_play, name) == getattr(plain, name), name
    texts = [re.sub(r"<!--.*?-->", "", made.text, flags=re.S) for made in (plain, with_play)]
    numbers = [re.findall(r"^[^#/;*\n].*\d.*$", text, re.M) for text in texts]
    assert numbers[0] == numbers[1]
    sizes = [row["size_arcsec"] for row in with_play.left_out]
    assert sizes == pytest.approx([180.0, 0.002 * 3600.0], rel=0.06)
