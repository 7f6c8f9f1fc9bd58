"""First lines: what a fit is worth, how large the error was, what would have been found."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import NoOrderError
from trueangle.runs.run import CalibrationRun

ARCSEC = 3600.0


def swept(error, seed, noise=1.5, count=240, span=360.0, runs=2):
    rng = np.random.default_rng([1127, seed])
    x = np.linspace(0.0, span, count, endpoint=False)
    return [
        CalibrationRun(x, x + (error(x) + rng.normal(0.0, noise, count)) / ARCSEC, 360.0)
        for _ in range(runs)
    ]


def line(order, amplitude):
    return lambda x: amplitude * np.sin(np.radians(order * x) + 0.7)


@pytest.mark.parametrize("seed", range(3))
def test_an_order_above_the_stated_size_is_retained(seed):
    nothing = ta.select_orders(swept(line(1, 0.0), seed))
    assert not nothing.orders
    size = float(re.search(r"an order above about (\S+) arcsec would", nothing.reason)[1])
    for order in (2, 9, 31):
        assert ta.select_orders(swept(line(order, 1.4 * size), seed + 50)).orders == (order,)
        assert not ta.select_orders(swept(line(order, 0.3 * size), seed + 50)).orders
    with pytest.raises(NoOrderError, match=re.escape(nothing.reason)):
        ta.fit(swept(line(1, 0.0), seed))


def test_a_fit_below_twice_its_error_says_so_first_and_one_above_does_not():
    weak = ta.fit(swept(line(5, 0.0), 7), orders=[5])
    size, error = (ARCSEC * x for x in weak.curve_and_error)
    assert size < 2.0 * error
    first = weak.summary()
    assert first.startswith("NOT DETERMINED: ")
    # Amplitudes of one order are their own curve.
    assert size == pytest.approx(ARCSEC * weak.amplitudes[0], rel=1e-6)
    needed = int(re.search(r"about (\d+) runs like these", " ".join(first.split()))[1])
    assert needed == pytest.approx(2 * (2.0 * error / size) ** 2, abs=1.0)
    assert "NOT DETERMINED" not in ta.fit(swept(line(5, 9.0), 7), orders=[5]).summary()


@pytest.mark.parametrize("span", [55.0, 360.0])
def test_the_error_before_is_that_of_the_readings(span):
    runs = swept(line(1, 30.0), 3, span=span)
    errors = [run.indicated - run.reference for run in runs]
    truth = ARCSEC * np.std(np.concatenate([e - e.mean() for e in errors]))
    text = ta.fit(runs, orders=[1]).summary()
    assert float(re.search(r"error (\S+) ->", text)[1]) == pytest.approx(truth, rel=1e-3)


def test_orders_and_fit_of_one_file_are_the_same(tmp_path, capsys):
    # Steps, of which four readings look like spikes until the curve is known.
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 500.0, 700)
    steps = 300.0 * np.sign(np.sin(np.arange(700) / 9.0)) * (rng.random(700) < 0.3)
    e = 900.0 * np.sin(np.radians(x)) + steps + 2.0 * rng.normal(size=700)
    file = tmp_path / "pair.csv"
    rows = "\n".join(f"{a},{b}" for a, b in zip(x, x + e / ARCSEC, strict=True))
    file.write_text(f"reference_deg,indicated_deg\n{rows}\n", "utf-8")
    assert main(["orders", str(file)]) == 0
    told = capsys.readouterr().out
    assert main(["fit", str(file), "-o", str(tmp_path / "m.json")]) == 0
    fitted = capsys.readouterr().out
    ours = re.findall(r"^ +(\d+) .* retained$", told, re.MULTILINE)
    theirs = re.findall(r"^ +output +(\d+) ", fitted, re.MULTILINE)
    assert ours == theirs != []
    assert f"{x.size} readings" in told
