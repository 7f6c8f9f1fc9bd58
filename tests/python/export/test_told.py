"""What a file and a summary say of a table: all that is left out, and where it comes from."""

import json
import math
import re
import shutil
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.export import TARGETS
from trueangle.export.channelform import ChannelTarget
from trueangle.export.proof import prove_export
from trueangle.model.records import FitRecord, Provenance
from trueangle.support.files import InputFile

from .test_bounds import existing

A = 1.0 / 3600.0

#: A period of 360 deg on an ellipse, for the targets that decode.
CHANNELS = ta.Channels(0.02, -0.01, 1.1, 0.98, 1.5, period=360.0)

#: Formats that no reader takes a comment in.
NO_COMMENT = {"csv", "moteus", "lerobot", "ax2000", "ax5000"}


@pytest.fixture
def model():
    """Half a degree, a play of 180 arcsec and a latency of 2 ms, found at up to 90 deg/s."""
    shaft = ta.Shaft("output", 1, [1, 2], [0.3, 0.0], [0.0, 0.1])
    fit = FitRecord(900, 1, (20.0, 140.0), 0.001, signals=(("velocity", -90.0, 60.0),))
    return ta.HarmonicModel(
        [shaft],
        period=360.0,
        terms=(ta.Backlash(180 * A), ta.Latency(0.002)),
        fit=fit,
        provenance=Provenance((InputFile("rig/axis_7.csv", "0" * 64),), "trueangle"),
    )


def export(model, target, folder, **options):
    if target == "klipper":
        options["existing"] = existing(folder, model.replace(terms=()))
    if target == "pmac":
        options["counts_per_turn"] = 1 << 20
    if isinstance(TARGETS[target], ChannelTarget):
        model = model.replace(channels=CHANNELS)
    return ta.export_model(model, target, **options)


@pytest.mark.parametrize("target", list(TARGETS))
def test_what_is_left_out_is_named_with_its_size(target, model, tmp_path):
    made = export(model, target, tmp_path)
    if target not in NO_COMMENT:
        flowing = re.sub(r"\n(?: +| \*|//!|//|#|;) *", " ", made.text)
        assert re.search(r"[Dd]iffers from the model by at most \S+ arcsec", flowing)
        for row in made.left_out:
            assert re.search(rf"omitted: .*{row['term']} \S+ arcsec", flowing)
        assert made.sha256 in flowing
        assert "rig/axis_7.csv" in flowing
        assert "trueangle " in flowing
        assert "20 to 140 deg" in flowing
    if target in ("fmu", "mujoco"):
        assert made.left_out == []
        assert made.max_difference_total_arcsec < 1e-3
        return
    if target in ("c", "rust"):
        assert made.left_out == []
        assert [row["term"] for row in made.at_run_time] == ["backlash", "latency"]
        assert "at run time: backlash" in made.summary().split("\n")[0]
        return
    sizes = {row["term"]: row["size_arcsec"] for row in made.left_out}
    # At the joint: 1 / (1 - slope) of it at most, and the slope is below a hundredth.
    assert sizes["latency"] == pytest.approx(0.002 * 90.0 * 3600.0, rel=0.015)
    if TARGETS[target].takes_direction:
        assert "backlash" not in sizes
    else:
        assert sizes["backlash"] == pytest.approx(180.0, rel=0.015)
    total = made.max_difference_total_arcsec
    assert total == pytest.approx(made.max_difference_arcsec + sum(sizes.values()), rel=1e-4)
    assert total >= made.max_difference_arcsec + sum(sizes.values())
    first = made.summary().split("\n")[0]
    for term in sizes:
        assert term in first
    size, unit = re.search(r"at most (\S+) (arcsec|deg)", first).groups()
    assert float(size) * {"arcsec": 1.0, "deg": 3600.0}[unit] >= total * 0.9999
    assert "latency" in made.to_dict()["left_out"][-1]["term"]


@pytest.mark.parametrize("target", ["linuxcnc", "klipper", "twincat", "admt4000"])
def test_a_file_with_comments_is_read_back(target, model, tmp_path):
    ending = {"admt4000": ".txt", "linuxcnc": ".comp", "twincat": ".lis", "klipper": ".cfg"}[target]
    options = {"start": 0, "stop": 360} if target in ("linuxcnc", "twincat") else {}
    if target == "klipper":
        options["existing"] = existing(tmp_path, model.replace(terms=()))
    path = tmp_path / f"a{ending}"
    made = ta.export_model(model, target, path, **options)
    back = ta.import_model(path, target)
    plain = model.replace(terms=(), fit=None)
    assert ta.compare(plain, back).max_abs_arcsec <= made.max_difference_arcsec + 0.01


def test_max_arcsec_is_of_all_that_is_left(model, tmp_path):
    path = tmp_path / "a.h"
    with pytest.raises(ta.errors.ArgumentError, match=r"omits backlash 18.* latency 6"):
        ta.export_model(model, "tinymovr", path, max_arcsec=2.0)
    assert list(tmp_path.iterdir()) == []
    made = ta.export_model(model, "c", path, max_arcsec=2.0, bits=14)
    assert made.max_difference_arcsec < made.max_difference_total_arcsec <= 2.0
    made = ta.export_model(model, "csv", tmp_path / "a.csv", max_arcsec=840.0, bits=14)
    assert made.max_difference_total_arcsec <= 840.0


def test_without_terms_the_whole_is_the_table(model, tmp_path, capsys):
    plain = model.replace(terms=())
    plain.save(tmp_path / "m.json")
    out = str(tmp_path / "a.h")
    assert main(["export", str(tmp_path / "m.json"), "--to", "c", "-o", out, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["left_out"] == []
    assert found["max_difference_total_arcsec"] == found["max_difference_arcsec"]
    assert "m.json, sha256" in re.sub(r"\n \* ", " ", (tmp_path / "a.h").read_text())


def test_a_signal_of_unknown_range_is_counted_by_one_unit(model):
    made = ta.export_model(model.replace(fit=None), "csv")
    assert made.left_out[1]["over"] == "+-1 deg/s"
    assert made.left_out[1]["size_arcsec"] == pytest.approx(7.2, rel=0.015)


@pytest.mark.parametrize(("target", "variant"), [("linuxcnc", "1"), ("twincat", "cnc")])
def test_only_the_calibrated_travel_is_written(target, variant, model):
    made = ta.export_model(model, target, entries=180)
    if target == "linuxcnc":
        places = [float(x.split()[0]) for x in made.text.split("\n") if x[:1].isdigit()]
    else:
        start, count = (
            int(re.search(rf"{key} (\d+)", made.text)[1]) for key in ("kw_startpos", "kw_nr_max")
        )
        places = [start / 1e4, start / 1e4 + (count - 1) * 2.0]
        assert "modulo 0" in made.text
    assert (places[0], places[-1]) == (20.0, 140.0)
    whole = ta.export_model(model, target, entries=180, start=0.0, stop=360.0)
    assert whole.entries == 181


def test_a_record_of_signals_and_tables_is_kept(model, tmp_path):
    model.save(tmp_path / "m.json")
    assert ta.load_model(tmp_path / "m.json").fit == model.fit
    ta.export_model(model, "csv", tmp_path / "a.csv")
    back = ta.import_model(tmp_path / "a.csv", "csv", tmp_path / "b.json")
    assert ta.load_model(tmp_path / "b.json").fit == back.fit
    assert back.fit.table.target == "csv"


def test_a_corrected_model_records_the_signals_it_was_found_over():
    sim = ta.load_simulation
    assert sim is not None
    rng = np.random.default_rng(11)
    theta = np.concatenate([np.arange(0.0, 720.0, 1.0), np.arange(720.0, 0.0, -1.0)])
    time = np.arange(theta.size) * 0.05
    play = 0.01 * np.sign(np.gradient(theta))
    error = 0.2 * np.sin(np.radians(theta)) + play + rng.normal(0.0, 1e-3, theta.size)
    run = ta.CalibrationRun(theta, theta + error, period=360.0, time=time)
    from trueangle.diagnosis.correction import extend_model
    from trueangle.simulation import Backlash, Joint, Simulation

    base = ta.fit([run], orders=[1]).model
    extended = Simulation(Joint()).with_effects([Backlash(36.0)])
    found = extend_model(base, [run], extended)
    ((name, low, high),) = found.fit.signals
    assert name == "velocity"
    assert low == pytest.approx(-20.0, rel=0.1)
    assert high == pytest.approx(20.0, rel=0.1)


#: Words of Rust and C, and names that generated code has or had.
NAMES = (
    "self_test", "SELF_TEST", "self", "Self", "super", "crate", "fn", "match", "type", "async",
    "await", "dyn", "abstract", "yield", "try", "static", "int", "float", "double", "register",
    "const", "volatile", "inline", "correct", "correct_unwrapped", "correction", "knots", "left",
    "start", "angle", "table", "linear_i16", "linear_i32", "cubic_i32", "between", "scaled", "u32",
    "i64", "main", "core", "std", "_", "9", "a b", "a*/b", "output_place", "shifts_arithmetically",
)  # fmt: skip


@pytest.mark.parametrize("cycles", [1.0, 7.5])
@pytest.mark.parametrize("target", ["rust", "c"])
def test_any_name_of_a_shaft_compiles(target, cycles, tmp_path):
    compiler = {"rust": "rustc", "c": "gcc"}[target]
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    includes = []
    for i in range(0, len(NAMES), 6):
        shafts = [
            ta.Shaft(name, cycles * (k + 1), [1], [0.01], [0.0])
            for k, name in enumerate(NAMES[i : i + 6])
        ]
        method, number = (("linear", "q15"), ("cubic", "q31"), ("cubic", "f32"))[i // 6 % 3]
        model = ta.HarmonicModel(shafts, period=360.0, constant=1.0)
        name = f"t{i}"
        path = tmp_path / f"{name}{ENDING[target]}"
        options = {"method": method, "number": number, "entries": 16, "bits": 8}
        ta.export_model(model, target, path, **options)
        back = ta.import_model(path, target)
        assert [s.cycles_per_turn for s in back.shafts] == [s.cycles_per_turn for s in shafts]
        assert ta.compare(model, back).max_abs_arcsec < 3.0
        includes.append(name)
    if target == "rust":
        (tmp_path / "lib.rs").write_text("".join(f"pub mod {name};\n" for name in includes))
        command = ["rustc", "--edition", "2021", "-D", "warnings", "--crate-type", "rlib", "lib.rs"]
    else:
        body = "".join(f'#include "{name}.h"\n' for name in includes)
        calls = " + ".join(f"{name}_self_test()" for name in includes)
        (tmp_path / "p.c").write_text(f"{body}int main(void) {{ return {calls}; }}\n")
        command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror",
                   "-ffp-contract=off", "p.c", "-o", "p"]  # fmt: skip
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[:3000]
    if target == "c":
        assert subprocess.run([str(tmp_path / "p")]).returncode == 0


ENDING = {"rust": ".rs", "c": ".h"}


def test_a_file_name_does_not_end_a_comment(model, tmp_path):
    source = InputFile("rig*/ #include <x>\\\n.csv", "0" * 64)
    odd = model.replace(provenance=Provenance((source,), "trueangle"))
    text = ta.export_model(odd, "c", bits=8).text
    assert text.count("*/\n#ifndef") == 1
    assert text.index("*/") == text.index("*/\n#ifndef")
    for line in ta.export_model(odd, "simplefoc", bits=8).text.split("const int")[0].splitlines():
        assert line.startswith("//")
        assert not line.endswith("\\")


PERIODS = {"rad": 2.0 * math.pi, "turn": 1.0, "count": 4096.0}


def described(period: float = 360.0, std: float = 1e-4, **more) -> ta.HarmonicModel:
    """Two shafts, a play, a latency and a friction over part of a turn, in one unit."""
    unit = period / 360.0
    shafts = [
        ta.Shaft("output", 1, [1, 2], [0.3 * unit, 0.0], [0.0, 0.1 * unit]),
        ta.Shaft("motor", 3, [1], [0.02 * unit], [0.01 * unit]),
    ]
    terms = (ta.Backlash(0.05 * unit), ta.Latency(0.002), ta.terms.PreslidingHysteresis(
        0.01 * unit, 5.0 * unit))  # fmt: skip
    fit = FitRecord(900, 1, (20.0 * unit, 140.0 * unit), 0.001 * unit,
                    signals=(("velocity", -90.0 * unit, 60.0 * unit),))  # fmt: skip
    covariance = np.diag([25.0, *[1.0] * 6]) * (std * unit) ** 2
    given = {"terms": terms, "fit": fit, "constant": 0.25 * unit, "covariance": covariance}
    return ta.HarmonicModel(shafts, period=period, **{**given, **more})


@pytest.mark.parametrize(
    ("target", "unit"),
    [("csv", "rad"), ("csv", "count"), ("c", "turn"), ("simplefoc", "rad"), ("twincat", "turn")],
)
def test_a_model_in_another_unit_makes_the_same_table(target: str, unit: str) -> None:
    options = {"entries": 64} if target != "twincat" else {"entries": 72}
    made, other = (
        ta.export_model(described(period), target, bits=12, **options).to_dict()
        for period in (360.0, PERIODS[unit])
    )
    for one in (made, other):
        del one["sha256"]
    # Bounds are those of the rounding of angles too; words have their numbers to four digits.
    for name, value in made.items():
        if isinstance(value, float):
            assert other[name] == pytest.approx(value, rel=1e-5, abs=1e-7), name
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for row, its in zip(value, other[name], strict=True):
                assert row.keys() == its.keys()
                for key, one in row.items():
                    near = pytest.approx(one, rel=1e-5, abs=1e-6) if isinstance(one, float) else one
                    assert its[key] == near, (name, key)
        else:
            assert other[name] == value, name


@pytest.mark.parametrize(("std", "said"), [(1e-6, True), (1e-2, False)])
def test_a_format_coarser_than_what_is_known_is_told(std: float, said: bool) -> None:
    """Of a 16-bit table: what its numbers leave against the model's own uncertainty."""
    model = described(std=std, terms=(), fit=None)
    made = ta.export_model(model, "c", entries=64, number="q15", bits=12)
    notes = [n for n in made.notes if n.startswith("the number format adds")]
    assert len(notes) == said
    # Six coefficients of one variance: half of each is what a turn has on the mean.
    known = math.sqrt(3.0) * std * 3600.0
    for note in notes:
        floor, uncertainty = map(float, re.findall(r"\d[\d.e-]*(?= arcsec| *$)|[\d.e-]+$", note))
        assert floor == pytest.approx(made.floor_arcsec, rel=5e-3)
        assert uncertainty == pytest.approx(known, rel=5e-3)


def test_the_order_that_loses_most_is_the_one_that_the_summary_names() -> None:
    lines = ta.Shaft("output", 1, [3, 7], [0.2, 0.0], [0.0, 1e-4])
    made = ta.export_model(ta.HarmonicModel([lines], period=360.0), "csv", entries=24, bits=12)
    worst = max(made.lost, key=lambda row: row["arcsec"])
    assert worst["order"] < max(row["order"] for row in made.lost)
    said = re.search(r"largest loss: order (\S+), (\S+) arcsec", made.summary("arcsec"))
    assert said is not None
    assert float(said[1]) == worst["order"]
    assert float(said[2]) == pytest.approx(worst["arcsec"], rel=0.01)


@pytest.mark.parametrize("target", ["csv", "c"])
def test_the_smallest_table_leaves_room_for_what_is_beside_it(target: str) -> None:
    """A bound that the smallest table keeps without the terms, and not with them."""
    model = described()
    options = {"bits": 12}
    size = {"csv": 36, "c": 8}[target]
    small = ta.export_model(model, target, entries=size, **options)
    beside = small.max_difference_total_arcsec - small.max_difference_arcsec
    asked = beside + 0.9 * small.max_difference_arcsec
    made = ta.export_model(model, target, max_arcsec=asked, **options)
    assert made.max_difference_total_arcsec <= asked
    assert made.entries > small.entries


def test_tables_of_several_shafts_add_up_and_name_the_outputs_orders() -> None:
    """The motor's first order is the third of the output; two tables of 17 knots of 4 bytes."""
    made = ta.export_model(described(terms=()), "c", entries=16, number="q31", bits=12)
    assert [row["order"] for row in made.lost] == [1.0, 2.0, 3.0]
    assert made.entries == sum(row["entries"] for row in made.tables) == 32
    assert made.bytes == sum(row["bytes"] for row in made.tables) == 2 * 17 * 4
    assert [row["cycles_per_turn"] for row in made.tables] == [1.0, 3.0]


@pytest.mark.parametrize(
    ("target", "options"),
    [
        ("c", {"max_arcsec": 1.0}),
        ("rust", {"max_arcsec": 2.0, "number": "f32"}),
        ("simplefoc", {"max_arcsec": 90.0}),
        ("moteus", {"max_arcsec": 90.0}),
        ("c", {}),
    ],
)
def test_every_input_is_evaluated_once_for_the_table_that_is_written(
    target: str, options: dict[str, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    proven: list[int] = []

    def counted(corrections: object, exact: object, bits: int, *rest: object) -> object:
        proven.append(bits)
        return prove_export(corrections, exact, bits, *rest)

    monkeypatch.setattr("trueangle.export.export.prove_export", counted)
    made = ta.export_model(described(terms=()), target, bits=17, **options)
    assert proven.count(17) == 1
    assert "every one of 131072 inputs" in made.proof
