"""Benchmarks run and their ways agree; nothing is timed here."""

from __future__ import annotations

import json
import re
import sys

import numpy as np
import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))

import latency
import public
import scaling as scalingbench
from harness import compiled, evaluation, scaling
from harness.evaluationpeers import evaluation_peers
from harness.interleaved import Timing

#: The least accurate peer draws chords over 65536 places: h^2/8 times the curvature of
#: order 17, of its amplitude.
PEER_ACCURACY = (2 * np.pi / 65536) ** 2 / 8 * 17**2


def test_peers_compute_the_same():
    model = evaluation.evaluated_model(range(1, 18))
    theta = np.linspace(0.0, 6.0, 1001)
    expected = model.error(theta)
    scale = sum(np.hypot(model.shafts[0].cosine, model.shafts[0].sine))
    ready, missing = evaluation_peers(model)
    assert "numpy per order (reference)" in ready
    assert not set(ready) & set(missing)
    for name, way in ready.items():
        error = abs(way(theta) - expected).max()
        assert error <= PEER_ACCURACY * scale, name


def test_latency_counts_every_call():
    found = latency.paced("sine", np.sin, 1e5, 200)
    assert found.nanoseconds.shape == (200,)
    quantiles = found.quantiles()
    assert list(quantiles) == ["p50", "p99", "p99.9", "max"]
    assert list(quantiles.values()) == sorted(quantiles.values())
    lines = latency.histogram(found).splitlines()
    assert sum(int(line.split()[2]) for line in lines) == 200


@pytest.mark.parametrize("arguments", [[], ["--json"]])
def test_scaling(arguments, tmp_path, capsys):
    picture = tmp_path / "scaling.svg"
    if not arguments:
        pytest.importorskip("matplotlib")
        arguments = ["--plot", str(picture)]
    assert scalingbench.main(["--largest", "1e4", "--rounds", "1", *arguments]) == 0
    out = capsys.readouterr().out
    if "--json" in arguments:
        found = json.loads(out)
        sizes = {m["readings"] for m in found["measured"]}
        assert sizes == {1000, 10_000}
        assert {m["orders"] for m in found["measured"]} == {1, 4, 8, 16, 17, 64}
        works = {m["work"] for m in found["measured"]}
        assert works == {
            "correct", "fit", "moments", "watch, 500", "watch, 2000", "watch, 20000",
        }  # fmt: skip
        assert {(c["work"], c["threads"]) for c in found["costs"]} == {
            (work, n) for work in ("correct", "fit") for n in (1, 2)
        }
    else:
        assert "model of cost" in out
        told = re.findall(r": (\S+) us \+ (\S+) ns a reading .*; 1e12 readings: (\S+) h", out)
        assert len(told) == 4
        for call, reading, hours in (map(float, line) for line in told):
            taken = 1e-6 * call + 1e-9 * reading * 1e12
            assert 3600.0 * hours == pytest.approx(taken, rel=0.012)  # both of three digits
        assert picture.stat().st_size > 1000


@pytest.mark.parametrize("words", [["--largest", "10"], ["--workers", "2,no"], ["--workers", "0"]])
def test_scaling_refuses_nonsense(words):
    with pytest.raises(SystemExit, match="--largest"):
        scalingbench.main(words)


def test_the_model_of_cost_is_found():
    def taken(n, factor=1.0):
        return Timing(*[factor * (2e-6 + 3e-9 * n)] * 3)

    exact = [scaling.MeasuredWork("fit", n, 17, 1, taken(n)) for n in (10**3, 10**5, 10**7)]
    off = [m._replace(threads=2) for m in exact]
    off[1] = off[1]._replace(timing=taken(10**5, 1.1))
    one, two = scaling.work_costs(exact + off)
    assert one.call == pytest.approx(2e-6, rel=1e-9)
    assert one.reading == pytest.approx(3e-9, rel=1e-9)
    assert one.spread < 1e-9 < two.spread < 0.11
    costs = {m.readings: two.seconds(m.readings) / m.timing.median for m in off}
    assert two.spread == pytest.approx(max(abs(cost - 1.0) for cost in costs.values()))
    assert one.seconds(1e12) == pytest.approx(3000.0, rel=1e-6)
    # A call that comes out below nothing is none.
    (bare,) = scaling.work_costs(
        [m._replace(timing=Timing(*[1e-18 * m.readings**2] * 3)) for m in exact]
    )
    assert bare.call == 0.0


def test_units_of_a_fleet_and_their_fits_are_timed():
    found = scaling.scaling_by_units(100)
    assert [(m.work, m.readings) for m in found] == [
        ("fleet", 1800), ("fit of each", 1800), ("fleet", 18_000), ("fit of each", 18_000),
    ]  # fmt: skip
    assert all(m.timing.median > 0.0 for m in found)


def test_workers_share_logs():
    pytest.importorskip("distributed")
    pytest.importorskip("pyarrow")
    (found,) = scaling.scaling_by_workers([1], 80_000)
    assert (found.work, found.readings, found.threads) == ("fit of logs", 80_000, 1)
    assert found.timing.median > 0.0


def test_loops_in_c_take_any_number_of_angles():
    if not compiled.is_available():
        pytest.skip("no gcc")
    model = evaluation.evaluated_model(range(1, 6))
    for size in (0, 1, 511, 512, 1300):
        theta = np.linspace(-3.0, 9.0, size)
        for name in ("per_order", "horner"):
            found = compiled.compiled_peer(name)(model)(theta)
            assert np.abs(found - model.error(theta)).max(initial=0.0) < 1e-17
    assert np.array([5e-324])[0] * 1.0 > 0.0, "numbers below 2e-308 are taken for 0"


def test_corrections_are_judged_by_runs_they_did_not_see(monkeypatch, tmp_path, capsys):
    names = ("numpy, orders 1-12", "`ta.fit(runs)`")
    monkeypatch.setattr(public, "METHODS", {name: public.METHODS[name] for name in names})
    assert public.main(["--data", str(tmp_path)]) == 0
    out, err = capsys.readouterr()
    for source in public.SOURCES.values():  # neither is there: the reader is told from where
        assert f"missing: {tmp_path / source.file}: `{source.path}`" in err
        assert source.commit in out
    table = out[out.index("| method |") :].splitlines()[2:]
    rows = {line.split(" | ")[0].strip("| "): line.split(" | ")[1:6] for line in table if line}
    assert list(rows) == [*names, *public.TOLD]
    # At 36 positions gear orders pass for low ones; two mounts and the ratio tell them apart.
    default, told = rows["`ta.fit(runs)`"], [cell.strip("*") for cell in rows[list(rows)[-1]]]
    assert float(default[2].strip("*")) < 5 < float(default[3].strip("*"))
    assert float(told[4]) < 5
