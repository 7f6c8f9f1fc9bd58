"""Model files: round trip, refusals, nothing half-written."""

import json
import math
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle.errors import ModelFileError
from trueangle.model.records import MOST_TURNS, FitRecord, Provenance
from trueangle.support.files import InputFile

numbers = st.floats(-1e-3, 1e-3, allow_nan=False).map(lambda x: x + 0.0)


@st.composite
def models(draw):
    shafts = []
    for name, cycles in (("output", 1.0), ("motor", draw(st.floats(0.1, 200.0)))):
        orders = sorted(draw(st.sets(st.integers(1, 500), max_size=4)))
        values = st.lists(numbers, min_size=len(orders), max_size=len(orders))
        shafts.append(ta.Shaft(name, cycles, orders, draw(values), draw(values)))
    size = 1 + 2 * sum(len(s.orders) for s in shafts)
    return ta.HarmonicModel(
        shafts,
        constant=draw(st.floats(-180, 180)),
        period=draw(st.sampled_from([360.0, 2 * math.pi, 1.0, 65536.0])),
        argument="indicated",
        covariance=draw(st.sampled_from([None, np.eye(size) / 3])),
        condition_number=draw(st.none() | st.floats(1, 1e9)),
        fit=FitRecord(37, 2, (0.0, 360.0), 0.1, offsets=(draw(numbers), 1 / 3), note="n"),
        provenance=Provenance((InputFile("a.csv", "00ff"),), "trueangle 0"),
        indicated_sign=draw(st.sampled_from([1, -1])),
    )


@given(model=models())
def test_save_then_load_is_the_same_model_bit_for_bit(model, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "joint.json"
    model.save(path)
    assert ta.load_model(path) == model


def written(tmp_path, change=None, text=None):
    path = tmp_path / "joint.json"
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1, 2], [0.1, 0], [0.5, 0])], period=360.0)
    model.save(path)
    if change is not None:
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))
    if text is not None:
        path.write_text(text(path.read_text()))
    return path


FIT = {"samples": 1, "runs": 1, "span": [0.0, 360.0], "residual": 0.1}
MANY = {
    "orders": list(range(1, 20_001)),
    "cosine": [0.0] * 20_000,
    "sine": [0.0] * 20_000,
}
REFUSED = {
    "truncated": ({"text": lambda s: s[: len(s) // 2]}, "truncated"),
    "empty": ({"text": lambda s: ""}, "not complete JSON"),
    "another format": ({"change": lambda c: c.update(format="x")}, "format"),
    "a later version": ({"change": lambda c: c.update(version=99)}, "later.*upgrade"),
    "a text as version": ({"change": lambda c: c.update(version="1")}, "version"),
    "an unknown key": ({"change": lambda c: c.update(colour="red")}, "colour.*unknown"),
    "no format": ({"change": lambda c: c.pop("format")}, "is not a model file"),
    "no version": ({"change": lambda c: c.pop("version")}, "version.*whole number.*null"),
    "a missing key": ({"change": lambda c: c.pop("period")}, "period.*missing"),
    "an unknown shaft key": ({"change": lambda c: c["shafts"][0].update(x=1)}, r"shafts\[0\]\.x"),
    "a NaN": ({"text": lambda s: s.replace("0.5", "NaN")}, "NaN"),
    "an infinity": ({"text": lambda s: s.replace("0.5", "1e999")}, r"sine\[0\].*finite"),
    "a huge integer": ({"text": lambda s: s.replace("0.5", "9" * 6000)}, "cannot be read"),
    "a big integer": ({"text": lambda s: s.replace("0.5", "9" * 400)}, r"sine\[0\].*finite"),
    "a doubled key": ({"text": lambda s: s.replace("{", '{"period": 1,', 1)}, "period.*twice"),
    "true for a number": ({"change": lambda c: c.update(constant=True)}, "constant.*got true"),
    "a turn of no size": ({"change": lambda c: c.update(period=5e-324)}, "period"),
    "a negative condition": ({"change": lambda c: c.update(condition_number=-1)}, "condition"),
    "an order of 1e9": (
        {"text": lambda s: s.replace("[1, 2]", "[1, 1000000000]")},
        r"shafts.*cycles per output turn are more than 1000000",
    ),
    "too many lines": ({"change": lambda c: c["shafts"][0].update(MANY)}, "too many"),
    "an overflow": ({"text": lambda s: s.replace("0.5", "1e308")}, r"sine\[0\].*turns"),
    "the greatest value of a signal first": (
        {"change": lambda c: c.update(fit={**FIT, "signals": [["torque", 2.0, 1.0]]})},
        r"fit\.signals\[0\].*the least value comes first",
    ),
    "a span backwards": (
        {"change": lambda c: c.update(fit={**FIT, "span": [5e300, -5e300]})},
        r"fit\.span",
    ),
    "a span a little backwards": (
        {"change": lambda c: c.update(fit={**FIT, "span": [10.0, 9.999]})},
        r"fit\.span.*first the smaller, are needed, got \(10\.0, 9\.999\)",
    ),
    "no correction": (
        {"change": lambda c: c.update(terms=[{"kind": "thermal_drift", "pattern_per_K": 1e9}])},
        "terms",
    ),
    "half an order": ({"text": lambda s: s.replace("[1, 2]", "[1, 2.5]")}, "orders"),
    "falling orders": ({"text": lambda s: s.replace("[1, 2]", "[2, 1]")}, "orders"),
    "text as number": ({"change": lambda c: c.update(constant="0")}, "constant.*number"),
    "a steep model": ({"text": lambda s: s.replace("0.5", "90.0")}, "may reach"),
    "a wrong covariance": ({"change": lambda c: c.update(covariance=[[1.0]])}, "covariance"),
    "a ragged covariance": ({"change": lambda c: c.update(covariance=[[1], [2, 3]])}, "square"),
    "terms of the future": ({"change": lambda c: c.update(terms=[{"kind": "x"}])}, "term"),
    "a sign of 0": (
        {"change": lambda c: c.update(indicated={"sign": 0})},
        r"\.sign.*1 or -1, got 0",
    ),
    "a sign that is true": ({"change": lambda c: c.update(indicated={"sign": True})}, "1 or -1"),
    "a sign of no object": ({"change": lambda c: c.update(indicated=-1)}, "indicated.*object"),
    "two signs": ({"change": lambda c: c.update(indicated={"sign": 1, "x": 1})}, r"indicated\.x"),
    "nested too deep": ({"text": lambda s: "[" * 100_000}, "not"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_damaged_files_are_refused_with_file_and_key(case, tmp_path):
    how, message = REFUSED[case]
    path = written(tmp_path, **how)
    with pytest.raises(ModelFileError, match=message) as caught:
        ta.load_model(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("orders", [range(3057, 4001, 4), [1_000_002]])
def test_what_would_not_be_read_back_is_not_written(orders, tmp_path):
    """236 orders that may be steep together, and one of more cycles than a joint has."""
    sizes = 0.35 / max(orders) * np.exp(1j * np.arange(len(orders)) ** 2)
    shaft = ta.Shaft("output", 1.0, orders, sizes.real.tolist(), sizes.imag.tolist())
    model = ta.HarmonicModel([shaft], period=360.0)
    with pytest.raises(
        ta.errors.ArgumentError, match=r"many to look for .*use fewer|are more than"
    ):
        model.save(tmp_path / "m.json")
    assert not list(tmp_path.iterdir())


def test_what_a_file_does_not_say_of_its_fit_is_nothing(tmp_path):
    least = {**FIT, "samples": 7, "runs": 3}
    path = written(tmp_path, lambda c: (c.pop("indicated"), c.update(fit=least)))
    record = ta.load_model(path).fit
    assert ta.load_model(path).indicated_sign == 1
    assert (record.samples, record.runs, record.residual) == (7, 3, 0.1)
    assert (record.method, record.loss) == ("plain", "linear")
    assert (record.wild, record.ridge, record.offset_spread) == (0, 0.0, 0.0)
    assert (record.positions, record.freedom, record.table) == (None, None, None)
    assert record.offsets == record.blind == record.signals == ()
    assert (record.note, record.calibrated_without_reference) == ("", False)


def test_a_failed_save_leaves_the_old_file(tmp_path, monkeypatch):
    path = written(tmp_path)
    before = path.read_bytes()

    def full_disk(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="No space"):
        ta.load_model(path).save(path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == [path.name]


def test_the_file_is_readable_by_people_and_states_its_convention(tmp_path):
    content = json.loads(written(tmp_path).read_text())
    assert content["format"] == "trueangle-model"
    assert content["argument"] == "reference"
    assert content["period"] == 360.0
    assert content["shafts"][0]["cosine"] == [0.1, 0.0]
    assert max(len(line) for line in written(tmp_path).read_text().splitlines()) < 100


def test_a_hundred_thousand_keys_are_searched_for_doubles_at_once(tmp_path):
    keys = ", ".join(f'"k{i}": {i}' for i in range(100_000))
    path = tmp_path / "wide.json"
    path.write_text("{" + keys + ', "k7": 1}')
    with pytest.raises(ModelFileError, match=r"k7.*appears twice"):
        ta.load_model(path)  # comparing every pair of keys would take minutes


@pytest.mark.parametrize("key", ["cosine", "sine"])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_line_has_so_many_turns_at_most_either_way(key, sign, tmp_path):
    most = sign * MOST_TURNS * 360.0

    def change(content):
        content["shafts"][0][key][0] = amplitude
        content["argument"] = "indicated"  # else it stands for several true angles, too

    amplitude = most
    ta.load_model(written(tmp_path, change))
    amplitude = 1.001 * most
    with pytest.raises(ModelFileError, match=rf"shafts\[0\]\.{key}\[0\].*more than .* turns"):
        ta.load_model(written(tmp_path, change))
