"""Tables of machine tools and of Mini Cheetah's controllers, run as their descriptions have it."""

import re
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.export import TARGETS
from trueangle.model.records import FitRecord

from .conftest import golden_model
from .test_machines import STRICT, run, tool

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
