"""The package's own bench: what it times is right, and what it prints follows from the times."""

import itertools
import json

import numpy as np
import pytest

from trueangle.cli import bench, main


@pytest.mark.parametrize("arguments", [[], ["--json"]])
def test_command(arguments, capsys):
    assert main(["bench", "--samples", "2000", "--rounds", "1", *arguments]) == 0
    out = capsys.readouterr().out
    if arguments:
        found = json.loads(out)
        assert found["path"].startswith("table-")
        assert found["nanoseconds"]["single_samples"]["step"] > 0
    else:
        assert "numpy per order (reference)" in out
        assert "fit 2000 readings 17 orders" in out


PRINTED = """\
default path: here

part one: median of 3, over the last line
  a                                  300000000.00 ns    75.000
  b                                    4000000.00 ns     1.000

Against other libraries, and over sizes: benches/ in the source repository
"""


def test_medians_are_divided_by_the_count_and_compared_with_the_last(monkeypatch, capsys):
    """A clock that steps by 1, 2, 3 s ... times two ways in turn: medians 3 and 4 s."""
    ways = {"part_one": {"a": (lambda: None, 10), "b": (lambda: None, 1000)}}
    monkeypatch.setattr(bench, "_ways", lambda samples: ways)
    monkeypatch.setattr(bench, "_series_path", lambda: "here")
    for arguments in ([], ["--json"]):
        steps = itertools.chain.from_iterable((0.0, float(n)) for n in itertools.count(1))
        total = itertools.accumulate(steps)
        monkeypatch.setattr(bench.time, "perf_counter", total.__next__)
        assert main(["bench", "--rounds", "3", *arguments]) == 0
        out = capsys.readouterr().out
        if arguments:
            assert json.loads(out)["nanoseconds"]["part_one"] == {"a": 0.3e9, "b": 0.004e9}
        else:
            assert out == PRINTED


def test_peers_compute_the_same():
    parts = bench._ways(500)
    batches = parts["batches"]
    ours, theirs = (batches[name][0]() for name in ("error", "numpy per order (reference)"))
    assert np.abs(ours - theirs).max() <= 1e-12 * np.abs(theirs).max() + 1e-15
    fits = parts["fit_500_readings_17_orders"]
    model = fits["trueangle.fit(...).model"][0]()
    columns = fits["numpy.linalg.lstsq"][0]()[0]
    (shaft,) = model.shafts
    pairs = np.column_stack([shaft.cosine, shaft.sine]).ravel()
    np.testing.assert_allclose(np.r_[model.constant, pairs], columns, rtol=0, atol=1e-12)


@pytest.mark.parametrize("words", [["--samples", "0"], ["--rounds", "0"]])
def test_refuses_nonsense(words, capsys):
    assert main(["bench", *words]) == 1
    assert words[0] in capsys.readouterr().err
