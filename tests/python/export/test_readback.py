"""Tables read back, steep ones too, and compared as functions of the reading."""

import json
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.export.pattern import inverse_rising

from .test_bounds import AT_READINGS, existing, random_model, wrapped

SEED = 90_217

#: A model read from a table ends at the table's own Nyquist order: of a table of 64 entries that
#: is degrees off its model, that end takes some of the table's own difference more.
COARSE = 1.25

#: Of a Mechaduino's 16384 angles, orders below three deviations of their rounding are left out:
#: arcsec where the correction rises thirtyfold.
BETWEEN_COUNTS = 10.0

ENDINGS = {
    "c": ".h", "rust": ".rs", "csv": ".csv", "simplefoc": ".h", "moteus": ".cfg",
    "linuxcnc": ".comp", "twincat": ".lis", "klipper": ".cfg", "admt4000": ".txt",
    "mechaduino": ".cpp", "tinymovr": ".h",
}  # fmt: skip
CASES = [
    ("c", {"number": "f32", "entries": 256}), ("rust", {"number": "f32", "method": "cubic"}),
    ("csv", {}), ("simplefoc", {"variant": "minus-u16"}), ("simplefoc", {"variant": "minus-float"}),
    ("simplefoc", {"variant": "plus-float"}), ("moteus", {}), ("linuxcnc", {"type": "0"}),
    ("linuxcnc", {"type": "1"}), ("twincat", {"variant": "cnc"}), ("twincat", {"variant": "nc"}),
    ("klipper", {}), ("mechaduino", {}), ("tinymovr", {"bits": 14, "entries": 256}),
]  # fmt: skip


def there_and_back(model, target, options, folder, name="table"):
    given = dict(options)
    if target == "klipper":
        given["existing"] = existing(folder, model)
    if target not in ("mechaduino", "tinymovr"):
        given["bits"] = 14
    path = folder / f"{name}{ENDINGS[target]}"
    made = ta.export_model(model, target, path, **given)
    asked = {k: v for k, v in given.items() if k in ("variant", "type", "bits")}
    return made, ta.import_model(path, target, **asked)


def without_mean(degrees):
    off = wrapped(degrees - degrees[0])
    return off - np.mean(off)


@pytest.mark.parametrize("steep", [0.49, 0.7, 0.97])
@pytest.mark.parametrize(("target", "options"), CASES)
def test_a_steep_table_is_read_back(target, options, steep, tmp_path):
    seed = SEED + len(target) + int(100 * steep)
    print(f"seed {seed}")
    model = random_model(np.random.default_rng(seed), steep, top=5, count=2)
    made, back = there_and_back(model, target, options, tmp_path)
    x = np.arange(16384) * (360.0 / 16384)
    if made.argument == "indicated":
        off = without_mean(np.asarray(back.correct(x)) - np.asarray(model.correct(x)))
    else:
        off = np.asarray(back.error(x)) - np.asarray(model.error(x)) + model.constant
    worst = float(np.max(np.abs(off))) * 3600.0
    print(f"stated {made.max_difference_arcsec}, model read back {worst}")
    # Table against model, and model read back against the table: both say theirs.
    assert worst <= made.max_difference_arcsec + back.fit.table.max_abs * 3600.0
    finer = 0.1 + BETWEEN_COUNTS * (target == "mechaduino")  # it looks between the counts
    assert worst <= COARSE * made.max_difference_arcsec + finer
    result = ta.compare(model, back)
    assert result.max_abs_arcsec == pytest.approx(worst, rel=0.05, abs=finer)


def test_order_4_of_seven_degrees_is_read_back(tmp_path):
    shaft = ta.Shaft("output", 1, [4], [0.0], [7.02])
    model = ta.HarmonicModel([shaft], period=360.0)
    made, back = there_and_back(model, "csv", {}, tmp_path)
    result = ta.compare(model, back)
    assert result.max_abs_arcsec <= made.max_difference_arcsec
    assert result.orders[0]["amplitude_arcsec"] < 1.0


def test_what_is_not_monotone_is_refused(tmp_path):
    lines = ["indicated_deg,correction_deg"]
    values = 20.0 * np.sin(np.radians(4 * np.arange(0.0, 361.0)))
    lines += [f"{i},{v:.9f}" for i, v in enumerate(values)]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ta.errors.FileError, match=r"not monotone between .* and .* deg"):
        ta.import_model(path, "csv")


def test_brackets_hold_where_newton_would_not():
    seed = SEED
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(40):
        knots = np.cumsum(rng.exponential(1.0, 64) ** 3 + 1e-6)
        knots = np.append(0.0, knots) / knots[-1]

        def line(x, knots=knots):
            return np.floor(x) + np.interp(x % 1.0, np.arange(65) / 64, knots)

        x = rng.uniform(-3.0, 3.0, 500)
        np.testing.assert_allclose(line(inverse_rising(line, line(x), 256)), line(x), atol=1e-13)


@pytest.mark.parametrize("name", [n for n in AT_READINGS if n != "klipper"] + ["admt4000"])
def test_right_and_wrong_tables_of_a_model_with_a_zero(name, tmp_path):
    """A table of the model is near, one with the pattern at the model's own zero is far."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    _, options, _ = AT_READINGS.get(name, (None, {}, None))
    target = name.split(",")[0]
    orders = [1, 2, 3] if target == "admt4000" else [1, 2, 4]
    size, phase = np.array([0.4, 0.3, 0.1]), rng.uniform(0.0, 6.0, 3)
    shaft = ta.Shaft("output", 1, orders, size * np.sin(phase), size * np.cos(phase))
    model = ta.HarmonicModel([shaft], constant=109.4, period=360.0)
    made, right = there_and_back(model, target, options, tmp_path, "right")
    _, wrong = there_and_back(model.replace(constant=0.0), target, options, tmp_path, "wrong")
    near, far = ta.compare(model, right), ta.compare(model, wrong)
    assert near.argument == far.argument == "indicated"
    assert near.max_abs_arcsec <= made.max_difference_arcsec * 1.05 + 0.01
    x = np.arange(3600.0) / 10.0
    true = without_mean(np.asarray(wrong.correct(x)) - np.asarray(model.correct(x)))
    assert far.rms_arcsec == pytest.approx(float(np.std(true)) * 3600.0, rel=1e-3)
    assert far.rms_arcsec > 500.0
    # Table against table, and whichever comes first.
    assert ta.compare(right, wrong).rms_arcsec == pytest.approx(far.rms_arcsec, rel=0.1)
    assert ta.compare(wrong, model).rms_arcsec == pytest.approx(far.rms_arcsec, rel=1e-9)


def test_tables_of_other_targets_counts_and_units(tmp_path):
    model = random_model(np.random.default_rng(SEED), 0.1, zero=-75.0)
    radians = ta.HarmonicModel(
        [
            ta.Shaft(s.name, 1, s.orders, np.radians(s.cosine), np.radians(s.sine))
            for s in model.shafts
        ],
        constant=np.radians(model.constant),
    )
    _, coarse = there_and_back(radians, "tinymovr", {"bits": 14, "entries": 128}, tmp_path)
    _, fine = there_and_back(model, "simplefoc", {"variant": "minus-float"}, tmp_path)
    _, lines = there_and_back(model, "csv", {"entries": 90}, tmp_path)
    for a, b in ((coarse, fine), (fine, lines), (radians, fine), (lines, radians)):
        assert ta.compare(a, b).max_abs_arcsec < 60.0
    assert abs(ta.compare(model, radians).max_abs_arcsec) < 1e-6
    assert ta.compare(model, fine).zero_deg == pytest.approx(75.0, abs=0.01)


@pytest.mark.parametrize(
    ("target", "options"), [("moteus", {}), ("tinymovr", {}), ("csv", {"entries": 60})]
)
def test_the_tables_own_arithmetic_is_added(target, options, tmp_path, capsys):
    """What the machine makes is within what is compared and what its arithmetic adds."""
    rng = np.random.default_rng(SEED)
    model = random_model(rng, 0.15, zero=20.0)
    made, back = there_and_back(model, target, options, tmp_path)
    result = ta.compare(model, back)
    total = result.max_abs_arcsec + result.table_max_abs_arcsec
    assert made.max_difference_arcsec <= total * 1.01 + 0.5 / 8192 * 1_296_000 * (
        target == "tinymovr"
    )
    assert result.table_max_abs_arcsec > 3.0 * result.max_abs_arcsec
    assert "Interpolation and whole numbers of the table add at most" in result.summary()
    back.save(tmp_path / "back.json")
    model.save(tmp_path / "model.json")
    paths = [str(tmp_path / name) for name in ("model.json", "back.json")]
    assert main(["compare", *paths, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["table_max_abs_arcsec"] == pytest.approx(result.table_max_abs_arcsec)
    assert ta.compare(model, model).table_max_abs_arcsec is None


def damaged_table(target, options, old, new, folder):
    """The table of a target with one word exchanged."""
    shaft = ta.Shaft("output", 1, [1], [0.1], [0.3])
    model = ta.HarmonicModel([shaft], period=360.0)
    path = folder / "table.txt"
    ta.export_model(model, target, path, **options)
    text = path.read_text()
    found = re.search(old, text)
    assert found is not None, text[:500]
    path.write_text(text[: found.start(1)] + new + text[found.end(1) :])
    return path


@pytest.mark.parametrize(
    ("target", "options", "old", "told"),
    [
        ("twincat", {"variant": "cnc"}, r"pos\s+(-?\d+)", "is no number of a key"),
        ("pmac", {"counts_per_turn": 65536}, r"\n(-?\d+)", "an entry is beyond"),
        ("twincat", {"variant": "nc"}, r"\n[^,\n]*,([-\d.]+)", "no table of twincat that makes a"),
    ],
)
def test_numbers_that_no_table_holds_are_refused_by_file(target, options, old, told, tmp_path):
    number = "9" * (30 if options.get("variant") == "nc" else 400)
    path = damaged_table(target, options, old, number, tmp_path)
    with pytest.raises(ta.errors.FileError, match=told) as caught:
        ta.import_model(path, target, **options)
    assert caught.value.path == str(path)


READ_NUMBERS_SEED = 92_400
STEP, GAIN = 360.0 / 65536.0, 0.6072


def series(text, x):
    """The maker's formula: magnitude times sine of order times reading plus phase, degrees."""
    total = np.zeros_like(x)
    for order, code in re.findall(r"^H(\d)MAG 0x\w+ 0x(\w+)", text, re.M):
        phase = int(re.search(rf"^H{order}PH 0x\w+ 0x(\w+)", text, re.M)[1], 16) * 360.0 / 4096.0
        total += int(code, 16) * STEP / GAIN * np.sin(np.radians(int(order) * x + phase))
    return total


def registers(rng, constant, argument):
    orders = (1, 2, 3, 8)
    size, phase = rng.uniform(0.1, 1.0, 4) * (1.0, 1.0, 0.4, 0.4), rng.uniform(0.0, 7.0, 4)
    shaft = ta.Shaft("output", 1, orders, size * np.sin(phase), size * np.cos(phase))
    return ta.HarmonicModel([shaft], period=360.0, constant=constant, argument=argument)


@pytest.mark.parametrize("argument", ["indicated", "reference"])
@pytest.mark.parametrize("constant", [0.0, -30.0])
@pytest.mark.parametrize("bump", [0.0, 0.3])
def test_registers_take_off_the_correction_and_the_zero_that_is_told(bump, constant, argument):
    """A bump on one side has a mean, which no register holds: it is in the zero."""
    print("seed", READ_NUMBERS_SEED)
    rng = np.random.default_rng(READ_NUMBERS_SEED)
    x = np.arange(0.0, 360.0, 0.25)
    for _ in range(10):
        model = registers(rng, constant, argument)
        if bump:
            terms = (ta.terms.LocalDefect(rng.uniform(0.0, 360.0), 20.0, bump),)
            model = model.replace(terms=terms)
        made = ta.export_model(model, "admt4000", bits=12)
        left = x - series(made.text, x) - np.asarray(model.correct(x)) - made.zero_deg
        left -= 360.0 * np.rint(left / 360.0)
        # The bound, over 4096 readings, is reached.
        worst = np.max(np.abs(left)) * 3600.0
        assert 0.99 * made.max_difference_arcsec < worst <= made.max_difference_arcsec * 1.0001
        # What is left is that of four roundings and has no mean of its own.
        assert abs(float(np.mean(left))) < 1e-4


def test_pulls_of_magnitudes_that_are_read_back(tmp_path):
    """Rounded to whole steps: one standard deviation, of the covariance as well."""
    print("seed", READ_NUMBERS_SEED + 1)
    rng = np.random.default_rng(READ_NUMBERS_SEED + 1)
    pulls = []
    for draw in range(40):
        path = tmp_path / f"{draw}.txt"
        model = registers(rng, 0.0, "indicated")
        ta.export_model(model, "admt4000", path, bits=12)
        back = ta.import_model(path, "admt4000")
        std = np.sqrt(np.diag(back.covariance)[1::2])
        np.testing.assert_allclose(std, back.fit.residual)
        pulls.append((np.asarray(back.amplitudes) - np.asarray(model.amplitudes)) / std)
    assert np.sqrt(np.mean(np.square(pulls))) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(pulls)) < 4.5 / np.sqrt(160.0)


@pytest.mark.parametrize("shift", [800, -3200])
def test_a_table_that_rolls_over_has_its_last_entry_before_the_first(shift, tmp_path):
    """As much more in every entry is another zero, and the same pattern."""
    print("seed", READ_NUMBERS_SEED + 2)
    values = np.random.default_rng(READ_NUMBERS_SEED + 2).integers(-900, 900, 40)
    models = []
    for more in (0, shift):
        path = tmp_path / f"{more}.pmc"
        path.write_text("#1\nDEFINE COMP 40,4000\n" + " ".join(map(str, values + more)) + "\n")
        models.append(ta.import_model(path, "pmac", counts_per_turn=4000))
    plain, moved = models
    np.testing.assert_allclose(moved.amplitudes, plain.amplitudes, rtol=1e-9)
    np.testing.assert_allclose(moved.phases, plain.phases, atol=1e-9)
    assert moved.constant - plain.constant == pytest.approx(shift / 16.0 / 4000.0 * 360.0)
    # The mean of lines between entries is that of the entries, but for the grid it is taken on.
    assert plain.constant == pytest.approx(np.mean(values) / 16.0 / 4000.0 * 360.0, rel=1e-4)


@pytest.mark.parametrize("finest", [0, 1, 2])
@pytest.mark.parametrize("decimals", [4, 6])
def test_numbers_are_known_to_the_last_digit_of_any_column(finest, decimals, tmp_path):
    wanted = [3, 3, 3]
    wanted[finest] = decimals
    path = tmp_path / "a.comp"
    rows = []
    for x in np.arange(0.0, 361.0, 10.0):
        trim = 0.2 * np.sin(np.radians(x))
        numbers = zip((x, trim, trim), wanted, strict=True)
        rows.append(" ".join(f"{value:.{digits}f}" for value, digits in numbers))
    path.write_text("\n".join(rows) + "\n")
    model = ta.import_model(path, "linuxcnc")
    step = 10.0**-decimals
    assert model.fit.residual == pytest.approx(step / np.sqrt(12.0))
    np.testing.assert_allclose(np.diag(model.covariance)[1:], step**2 / 12.0 * 2.0 / 36.0)
    assert model.covariance[0, 0] == pytest.approx(step**2 / 12.0 / 36.0)  # that of a mean
    assert model.fit.samples == 36


@pytest.mark.parametrize("decimals", [1, 2, 3, 4])
def test_a_lookup_of_a_mechaduino_is_known_to_its_last_digit_of_a_degree(decimals, tmp_path):
    """Sixteen thousand angles; the orders of their rounding, in the thousands, are left out."""
    count = 16384
    read = np.arange(count) * (360.0 / count)
    pattern = 0.4 * np.sin(np.radians(read)) + 0.1 * np.cos(np.radians(3.0 * read))
    table = np.mod(read - pattern + 123.0, 360.0)
    path = tmp_path / "lookup.cpp"
    body = ", ".join(f"{value:.{decimals}f}" for value in table)
    path.write_text(f"const PROGMEM float lookup[{count}] = {{\n{body}\n}};\n")
    ta.import_model(path, "mechaduino", tmp_path / "m.json")
    model = ta.load_model(tmp_path / "m.json")
    step = 10.0**-decimals
    assert max(model.orders) < 100
    assert model.fit.residual == pytest.approx(step / np.sqrt(12.0))
    std = step / np.sqrt(6.0 * count)
    np.testing.assert_allclose(np.sqrt(np.diag(model.covariance)[1:]), std)
    assert {1, 3} <= set(model.orders)
    assert min(model.amplitudes) > 3.0 * std
    assert model.constant == pytest.approx(-123.0, abs=step)
    off = np.mod(np.asarray(model.correct(read)) - table + 180.0, 360.0) - 180.0
    np.testing.assert_allclose(off, 0.0, atol=0.51 * step + 1e-3 * step * 16.0)


@pytest.mark.parametrize(("zero", "noise"), [(41.5, 0.006), (-163.0, 0.013), (179.8, 0.02)])
def test_a_measured_lookup_keeps_its_zero_and_its_noise_is_smoothed(zero, noise, tmp_path, capsys):
    """Noise of about an entry makes angles go backward: they are smoothed, and it is reported."""
    rng = np.random.default_rng(8)
    read = np.arange(16384) * (360.0 / 16384)
    true = read - zero - 0.9 * np.sin(np.radians(read + 10.0)) - 0.1 * np.sin(np.radians(50 * read))
    table = np.mod(true + noise * rng.normal(size=read.size), 360.0)
    path = tmp_path / "Parameters.cpp"
    body = ", ".join(f"{value:.2f}" for value in table)
    path.write_text(f"const PROGMEM float lookup[] = {{\n{body}\n}};\n")
    model = ta.import_model(path, "mechaduino")
    off = np.mod(np.asarray(model.correct(read)) - true + 180.0, 360.0) - 180.0
    assert np.abs(off).max() < 2.0 * noise
    assert "go backward" in model.fit.note
    assert main(["import", str(path), "--from", "mechaduino", "-o", str(tmp_path / "m.json")]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert f"note: {model.fit.note}" in printed
    path.write_text(f"const PROGMEM float lookup[] = {{\n{', '.join(map(str, table[::-1]))}\n}};\n")
    with pytest.raises(ta.TrueAngleError, match="do not go once around"):
        ta.import_model(path, "mechaduino")
