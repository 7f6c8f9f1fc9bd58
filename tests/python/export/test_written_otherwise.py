"""One table written in several ways that its reader takes is one model."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import TARGETS
from trueangle.export.channelform import ChannelTarget

from .conftest import golden_model
from .test_targets import made_of
from .test_told import CHANNELS

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
