"""Benchmarks run and their ways agree; nothing is timed here."""

from __future__ import annotations

import json

import numpy as np
import pytest

from trueangle.bench import evaluation, latency
from trueangle.bench.evaluationpeers import peers
from trueangle.cli import main

#: The least accurate peer draws chords over 65536 places: h^2/8 times the curvature of
#: order 17, of its amplitude.
PEER_ACCURACY = (2 * np.pi / 65536) ** 2 / 8 * 17**2


def test_peers_compute_the_same():
    model = evaluation.harmonics(range(1, 18))
    theta = np.linspace(0.0, 6.0, 1001)
    expected = model.error(theta)
    scale = sum(np.hypot(model.shafts[0].cosine, model.shafts[0].sine))
    ready, missing = peers(model)
    assert "numpy per order (reference)" in ready
    assert not set(ready) & set(missing)
    for name, way in ready.items():
        error = abs(way(theta) - expected).max()
        assert error <= PEER_ACCURACY * scale, name


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
        assert "error, 512 orders, 2 threads" in out


def test_command_refuses_nonsense(capsys):
    assert main(["bench", "--samples", "0"]) == 1
    assert "--samples" in capsys.readouterr().err


def test_latency_counts_every_call():
    found = latency.paced("sine", np.sin, 1e5, 200)
    assert found.nanoseconds.shape == (200,)
    quantiles = found.quantiles()
    assert list(quantiles) == ["p50", "p99", "p99.9", "max"]
    assert list(quantiles.values()) == sorted(quantiles.values())
    lines = latency.histogram(found).splitlines()
    assert sum(int(line.split()[2]) for line in lines) == 200
