"""Every target: its sign, its argument, what it refuses, and that it comes back."""

import re
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import TARGETS

from .conftest import golden_model
from .test_golden import printer_config

ENDINGS = {
    "c": ".h", "rust": ".rs", "csv": ".csv", "simplefoc": ".h", "moteus": ".cfg",
    "linuxcnc": ".comp", "twincat": ".lis", "klipper": ".cfg", "admt4000": ".txt",
    "mechaduino": ".cpp", "tinymovr": ".h", "minicheetah": ".h", "siemens840d": ".ini",
    "pmac": ".txt", "fmu": ".fmu", "mujoco": ".xml", "vesc": ".xml", "lerobot": ".json",
    "ax2000": ".txt", "ax5000": ".txt",
}  # fmt: skip
CASES = [
    ("c", {}), ("rust", {}), ("csv", {}),
    ("simplefoc", {"variant": "minus-u16"}), ("simplefoc", {"variant": "minus-float"}),
    ("simplefoc", {"variant": "plus-float"}), ("moteus", {}), ("linuxcnc", {"type": "0"}),
    ("linuxcnc", {"type": "1"}), ("twincat", {"variant": "cnc"}), ("twincat", {"variant": "nc"}),
    ("klipper", {}), ("mechaduino", {}), ("tinymovr", {"bits": 14, "entries": 256}),
    ("minicheetah", {}), ("siemens840d", {}), ("pmac", {"counts_per_turn": 1 << 20}),
]  # fmt: skip


def test_the_targets_are_those_of_the_contract():
    assert set(TARGETS) == set(ENDINGS)
    for target in TARGETS.values():
        assert target.sign in ("add", "subtract", "absolute")
        assert target.argument in ("indicated", "reference")


def made_of(model, target, options, folder):
    given = dict(options)
    if target == "klipper":
        given["existing"] = printer_config(folder)
    if "bits" in TARGETS[target].options:
        given.setdefault("bits", 14)
    path = folder / f"table{ENDINGS[target]}"
    return ta.export_model(model, target, path, **given), path


@pytest.mark.parametrize(("target", "options"), CASES)
def test_a_table_comes_back_as_its_model(target, options, tmp_path):
    model = golden_model()
    made, path = made_of(model, target, options, tmp_path)
    asked = {
        k: v for k, v in options.items() if k in ("variant", "type", "bits", "counts_per_turn")
    }
    back = ta.import_model(path, target, tmp_path / "back.json", **asked)
    result = ta.compare(model, ta.load_model(tmp_path / "back.json"))
    assert result.max_abs_arcsec <= made.max_difference_arcsec
    assert result.rms_arcsec <= made.rms_difference_arcsec
    assert set(model.orders) <= set(back.orders)
    assert back.fit.residual > 0.0
    # The wrong sign would leave twice the error.
    assert result.rms_arcsec < 100.0


#: Tables of one grid, and a unit of the last digit that they are written with.
DIGITS = [
    ("minicheetah", {}, 1.0), ("siemens840d", {}, 1e-7),
    ("pmac", {"counts_per_turn": 1 << 20}, 1.0),
    ("tinymovr", {"bits": 14, "entries": 256}, 1.0), ("moteus", {}, 1.0),
    ("simplefoc", {"variant": "minus-u16"}, 1.0), ("twincat", {"variant": "cnc"}, 1.0),
    ("klipper", {}, 1.0), ("admt4000", {}, 0.0), ("mujoco", {"joint": "elbow"}, 0.0),
    ("fmu", {}, 0.0),
]  # fmt: skip


def numbers_of(text):
    """All numbers of a file but those of its comments."""
    bare = re.sub(r"/\*.*?\*/|<!--.*?-->", "", text, flags=re.DOTALL)
    bare = re.sub(r"^\s*(//|#|;).*$", "", bare, flags=re.MULTILINE)
    return np.array([float(x) for x in re.findall(r"-?\d+\.?\d*(?:e[+-]?\d+)?", bare)])


@pytest.mark.parametrize(("target", "options", "digit"), DIGITS)
def test_what_was_read_is_written_again_to_its_digits(target, options, digit, tmp_path):
    made, path = made_of(golden_model(), target, options, tmp_path)
    known = {"variant", "bits", "counts_per_turn", "joint"} & set(options)
    back = ta.import_model(path, target, **{k: options[k] for k in known})
    (tmp_path / "again").mkdir()
    again, _ = made_of(back, target, options, tmp_path / "again")
    first, second = numbers_of(made.text), numbers_of(again.text)
    assert first.size > 10
    # A digit is rounded the other way where it stood between two.
    np.testing.assert_allclose(second, first, rtol=0.0, atol=1.001 * digit)


def test_registers_come_back(tmp_path):
    model = ta.HarmonicModel(
        (ta.Shaft("output", 1, (1, 2, 3, 8), (0.3, 0.1, 0.0, 0.1), (0.2, -0.4, 0.2, 0.0)),),
        period=360.0, argument="indicated",
    )  # fmt: skip
    made, path = made_of(model, "admt4000", {}, tmp_path)
    result = ta.compare(model, ta.import_model(path, "admt4000"))
    assert result.max_abs_arcsec <= made.max_difference_arcsec + 0.01
    assert made.max_difference_arcsec < 4 * 0.0090 * 3600 / 2 + 4 * 0.0008 * 0.5 * 3600


def test_registers_of_the_makers_formulas():
    """0.25 deg of order 1 at 90 deg: 0.25 * 0.6072 / 0.005493 = 27.6, and 90 / 0.087891 = 1024."""
    model = ta.HarmonicModel(
        (ta.Shaft("output", 1, (1, 8), (0.25, 0.0), (0.0, -0.5)),),
        period=360.0, argument="indicated",
    )  # fmt: skip
    text = ta.export_model(model, "admt4000", bits=12).text
    assert "H1MAG 0x15 0x01C 0x7FF" in text
    assert "H1PH 0x16 0x400 0xFFF" in text
    assert "H8MAG 0x1B 0x037 0x0FF" in text
    assert "H8PH 0x1C 0x800 0xFFF" in text
    assert "H2MAG 0x17 0x000" in text


def test_what_registers_cannot_hold_is_said():
    made = ta.export_model(golden_model(), "admt4000", bits=12)
    assert "order 4 has no register: 43" in made.notes[0]
    only4 = ta.HarmonicModel(
        (ta.Shaft("output", 1, (4,), (0.1,), (0.0,)),), period=360.0, argument="indicated"
    )
    with pytest.raises(ta.errors.ArgumentError, match="1, 2, 3 and 8"):
        ta.export_model(only4, "admt4000")
    large = ta.HarmonicModel(
        (ta.Shaft("output", 1, (8,), (3.0,), (0.0,)),), period=360.0, argument="indicated"
    )
    with pytest.raises(ta.errors.ArgumentError, match=r"order 8 has 3 deg.*holds 2\.307"):
        ta.export_model(large, "admt4000")


@pytest.mark.parametrize(
    ("target", "options", "sign"),
    [
        ("simplefoc", {"variant": "minus-float"}, 1.0),
        ("simplefoc", {"variant": "plus-float"}, -1.0),
        ("moteus", {}, -1.0),
        ("linuxcnc", {}, 1.0),
        ("twincat", {"variant": "cnc"}, -1.0),
        ("twincat", {"variant": "nc"}, 1.0),
        ("tinymovr", {"bits": 14, "entries": 64}, -1.0),
        ("csv", {}, 1.0),
    ],
)
def test_signs(target, options, sign, tmp_path):
    """The error is largest, +0.5 deg, a quarter turn on: the value there tells the sign."""
    model = ta.HarmonicModel((ta.Shaft("output", 1, (1,), (0.0,), (0.5,)),), period=360.0)
    _, path = made_of(model, target, options, tmp_path)
    text = path.read_text()
    if target == "moteus":
        value = float(text.split("compensation_table.64 ")[1].split("\n")[0])
    elif target == "linuxcnc":
        value = float(next(x for x in text.split("\n") if x.startswith("90.0")).split()[1])
    elif target == "twincat" and options["variant"] == "cnc":
        value = float(text.split("table[90].pos ")[1].split("\n")[0])
    elif target in ("twincat", "csv"):
        value = float(next(x for x in text.split("\n") if x.startswith("90.0")).split(",")[1])
    else:
        cells = text.split("{")[1].split("}")[0].split(",")
        entries = {"plus-float": 128, "minus-float": 200}.get(options.get("variant"), 64)
        value = float(cells[entries // 4])
    assert np.sign(value) == sign


def test_direction_becomes_two_columns(tmp_path):
    model = golden_model(360.0).replace(
        terms=(ta.Backlash(0.01), ta.PreslidingHysteresis(0.004, 2.0), ta.ThermalDrift(0.001))
    )
    for target, options in (("linuxcnc", {}), ("twincat", {"variant": "nc"}), ("twincat", {})):
        made, path = made_of(model, target, {**options, "entries": 120}, tmp_path)
        assert [row["term"] for row in made.left_out] == ["thermal_drift"]
        back = ta.import_model(path, target)
        (play,) = back.terms
        assert play.kind == "backlash"
        assert play.half_width == pytest.approx(0.014, abs=2e-4)
    made, _ = made_of(model, "moteus", {}, tmp_path)
    terms = [row["term"] for row in made.left_out]
    assert terms == ["backlash", "presliding_hysteresis", "thermal_drift"]


def test_travel_of_several_turns(tmp_path):
    path = tmp_path / "a.comp"
    made = ta.export_model(
        golden_model(), "linuxcnc", path, start=-360, stop=360, entries=120, bits=14
    )
    lines = [line for line in path.read_text().split("\n") if line and line[0] != "#"]
    assert (made.entries, len(lines)) == (241, 241)
    assert lines[0].split()[1] == lines[120].split()[1] == lines[240].split()[1]
    assert ta.compare(golden_model(), ta.import_model(path, "linuxcnc")).max_abs_arcsec < 0.1
    with pytest.raises(ta.errors.ArgumentError, match=r"takes 256.*`entries=127` or less"):
        ta.export_model(golden_model(), "linuxcnc", start=-360, stop=360, entries=180)


def test_klipper_keeps_the_rotation_of_the_list(tmp_path):
    for reversed_ in (False, True):
        path = printer_config(tmp_path, reversed_)
        made = ta.export_model(golden_model(), "klipper", tmp_path / "b.cfg", existing=path)
        cells = made.text.split("calibrate =")[1].replace("\n", "").split(",")
        old = np.array(
            [
                float(x)
                for x in Path(path).read_text().split("calibrate =")[1].split("step")[0].split(",")
            ]
        )
        new = np.array([float(x) for x in cells])
        off = (new - old + 32768) % 65536 - 32768
        assert len(new) == len(old)
        assert np.max(np.abs(off)) < 4.0
        assert made.rms_difference_arcsec < 9.5
        assert made.text.startswith("[angle my_angle]")


def test_klipper_wants_its_list(tmp_path):
    with pytest.raises(ta.errors.ArgumentError, match="needs `existing=`"):
        ta.export_model(golden_model(), "klipper")
    bad = tmp_path / "printer.cfg"
    bad.write_text("[angle a]\ncalibrate = 1, 2, 3\n")
    with pytest.raises(ta.errors.FileError, match=r"line 2.*one reading"):
        ta.export_model(golden_model(), "klipper", existing=str(bad))
    bad.write_text("[fan]\npin: x\n")
    with pytest.raises(ta.errors.FileError, match="none there"):
        ta.export_model(golden_model(), "klipper", existing=str(bad))
    other = golden_model().replace(constant=0.5, argument="indicated")
    flipped = other.replace(
        shafts=tuple(ta.Shaft(s.name, 1, (8,), (-0.03,), (0.05,)) for s in other.shafts)
    )  # a third of a radian: not this motor
    with pytest.raises(ta.errors.ArgumentError, match="disagree by"):
        ta.export_model(flipped, "klipper", existing=printer_config(tmp_path))


def test_klipper_does_not_overwrite_its_list(tmp_path):
    path = printer_config(tmp_path)
    before = Path(path).read_text()
    with pytest.raises(ta.errors.FileError, match="overwritten"):
        ta.export_model(golden_model(), "klipper", path, existing=path)
    assert Path(path).read_text() == before


def test_mechaduino_keeps_the_zero_of_the_present_lookup(tmp_path):
    _, path = made_of(golden_model(), "mechaduino", {}, tmp_path)
    turned = golden_model().replace(constant=0.25)
    made = ta.export_model(turned, "mechaduino", tmp_path / "b.cpp", existing=str(path))
    again = ta.export_model(golden_model(), "mechaduino")
    new, old = (
        np.array(m.text.split("{")[1].split("}")[0].split(","), float) for m in (made, again)
    )
    off = (new - old + 180.0) % 360.0 - 180.0
    assert abs(np.mean(off)) < 1e-3
    assert made.bytes == 65536


@pytest.mark.parametrize(
    ("target", "limit", "orders"),
    [
        ("moteus", 127, "200, 400"),
        ("tinymovr", 31, "100, 200, 400"),
        ("simplefoc", 99, "100, 200, 400"),
        ("linuxcnc", 89, "100, 200, 400"),
    ],
)
def test_tables_name_the_orders_they_cannot_hold(target, limit, orders, joint):
    with pytest.raises(ta.errors.ArgumentError, match=f"up to {limit}, the model has .*{orders}"):
        ta.export_model(joint, target)


def test_max_arcsec_of_a_fixed_table_is_kept_or_refused(tmp_path):
    with pytest.raises(ta.errors.ArgumentError, match=r"moteus differs by up to .* 2 is allowed"):
        ta.export_model(golden_model(), "moteus", tmp_path / "a.cfg", max_arcsec=2.0, bits=14)
    assert list(tmp_path.iterdir()) == []
    made = ta.export_model(
        golden_model(), "simplefoc", variant="minus-float", max_arcsec=2.0, bits=14
    )
    assert made.entries == 256


@pytest.mark.parametrize(
    ("target", "text"),
    [
        ("simplefoc", "float t[3] = {1, 2, 3};"),
        ("simplefoc", "uint16_t t[4] = {0.1, 0.2, 0.3, 0.2};"),
        ("simplefoc", "uint16_t t[5] = {1, 2, x, 4, 5};"),
        ("moteus", "conf set motor_position.sources.0.compensation_table.0 1\n"),
        ("moteus", "conf set motor_position.sources.0.compensation_table.0 nan\n"),
        ("moteus", "conf set motor_position.sources.0.compensation_table.0 300\n"),
        ("linuxcnc", "0 0 0\n1 1 1\n"),
        ("linuxcnc", "nominal forward reverse\n0 0 0\n90 0 0\n180 0 0\n270 0 0\n"),
        ("linuxcnc", "0 0 0\n90 0 0\n80 0 0\n270 0 0\n360 0 0\n"),
        ("twincat", "kw.ssfk.interval 10000\nkw.ssfk.kw_nr_max 5\nkw.ssfk.table[0].pos 1\n"),
        ("twincat", "kw.ssfk.table[0].pos x\n"),
        ("klipper", "[angle a]\ncalibrate = 1, x\n"),
        ("admt4000", "H1MAG 0x15 0x123\n"),
        ("mechaduino", "float lookup[4] = {0, 90, 180, 270};"),
        ("tinymovr", ".rec_table = {0.5, 1, 2, 3},"),
        ("tinymovr", ".rec_table = {1, 2, 3, 4, 5},"),
        ("minicheetah", "int offset_lut[4] = {1, 2, 3, 4};"),
        ("siemens840d", "$AA_ENC_COMP[0,0,AX1]=0\n$AA_ENC_COMP_STEP[0,AX1]=1\n"),
        ("siemens840d", "$AA_ENC_COMP[0,x,AX1]=0\n"),
        *(
            (
                "siemens840d",
                f"$AA_ENC_COMP[0,0,AX1]=0\n$AA_ENC_COMP_STEP[0,AX1]=1e-300\n"
                f"$AA_ENC_COMP_MIN[0,AX1]=0\n$AA_ENC_COMP_MAX[0,AX1]={last}\n",
            )
            for last in ("1e300", "-1e300", "360")
        ),
        ("pmac", "#1 DEFINE COMP 8,4000\n1 2 3\n"),
        ("pmac", "#1 DEFINE COMP 4,4000\n1 2 x 0\n"),
        ("pmac", "DELETE COMP\n"),
    ],
)
def test_what_is_no_table_is_refused_in_one_line(target, text, tmp_path):
    path = tmp_path / "present"
    path.write_text(text)
    with pytest.raises(ta.errors.TrueAngleError) as caught:
        ta.import_model(path, target)
    assert "\n" not in str(caught.value)
    assert "present" in str(caught.value)


@pytest.mark.parametrize("scale", ["1e200", "-4e38"])
def test_a_scale_that_no_float_holds_is_refused(scale, tmp_path):
    shaft = ta.Shaft("output", 1, [1], [0.3], [0.4])
    made = ta.export_model(ta.HarmonicModel([shaft], period=360.0), "moteus")
    text = re.sub(r"(compensation_scale )\S+", rf"\g<1>{scale}", made.text)
    assert text != made.text
    path = tmp_path / "table.cfg"
    path.write_text(text)
    with pytest.raises(ta.errors.TrueAngleError, match="none of the firmware's floats"):
        ta.import_model(path, "moteus")


def test_a_choice_of_digits_is_taken_as_a_number_too():
    """`fmi=2` and `fmi="2"` are one; other numbers are refused by the words allowed."""
    tried = [
        (target, name, word)
        for target in TARGETS.values()
        for name, option in target.options.items()
        if isinstance(option.values, tuple)
        for word in option.values
        if word.isdigit()
    ]
    assert len(tried) >= 6
    for target, name, word in tried:
        assert target.checked({name: int(word)}) == target.checked({name: word})
        with pytest.raises(ta.errors.ArgumentError, match=f"{name} must be one of"):
            target.checked({name: 7})


@pytest.mark.parametrize("target", ["c", "rust", "csv", "moteus", "simplefoc", "tinymovr"])
def test_a_table_with_a_byte_order_mark_is_read_as_without(target, tmp_path):
    """Editors of Windows write one: the table is not refused, and no order is lost."""
    plain, marked = (tmp_path / f"{name}{ENDINGS[target]}" for name in ("plain", "marked"))
    more = {"bits": 14} if "bits" in TARGETS[target].options else {}
    ta.export_model(golden_model(), target, plain, **more)
    marked.write_bytes(b"\xef\xbb\xbf" + plain.read_bytes())
    expected, found = (ta.import_model(path, target) for path in (plain, marked))
    assert expected.shafts
    assert found.shafts == expected.shafts
    assert found.constant == expected.constant
