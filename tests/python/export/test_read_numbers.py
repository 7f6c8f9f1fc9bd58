"""Tables read back: errors by pulls, zeros, and digits, against what each format says."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

SEED = 92_400
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
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
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
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
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
    print("seed", SEED + 2)
    values = np.random.default_rng(SEED + 2).integers(-900, 900, 40)
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


@pytest.mark.parametrize("decimals", [2, 4])
def test_a_lookup_of_a_mechaduino_is_known_to_its_last_digit_of_a_degree(decimals, tmp_path):
    """Sixteen thousand angles; orders below three deviations of their rounding are left out."""
    count = 16384
    read = np.arange(count) * (360.0 / count)
    pattern = 0.4 * np.sin(np.radians(read)) + 0.1 * np.cos(np.radians(3.0 * read))
    table = np.mod(read - pattern + 123.0, 360.0)
    path = tmp_path / "lookup.cpp"
    body = ", ".join(f"{value:.{decimals}f}" for value in table)
    path.write_text(f"const PROGMEM float lookup[{count}] = {{\n{body}\n}};\n")
    model = ta.import_model(path, "mechaduino")
    step = 10.0**-decimals
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
