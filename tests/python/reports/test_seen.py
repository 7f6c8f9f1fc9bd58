"""What is seen but cannot be named stands in the first lines, with its size."""

from __future__ import annotations

import html
import re

import numpy as np
import pytest

import trueangle as ta

ARCSEC = 1.0 / 3600.0
#: Half of the reversal error of the joint, in arcsec, and the noise of a reading.
HALF, SIGMA = 6.05, 1.0


@pytest.fixture(scope="module")
def at_one_speed(tmp_path_factory):
    """Runs out and back at one speed: backlash and latency are one and the same step."""
    rng = np.random.default_rng(20261122)
    theta = np.concatenate([np.arange(0.0, 360.0, 2.5), np.arange(357.5, -2.5, -2.5)])
    way = np.repeat([1.0, -1.0], theta.size // 2)
    runs = []
    for number in range(4):
        error = HALF * way + rng.normal(0.0, SIGMA, theta.size)
        time = 0.5 * np.arange(theta.size) + np.where(way > 0.0, 0.0, 60.0)
        runs.append(
            ta.CalibrationRun(theta, theta + ARCSEC * error, 360.0, time=time, label=f"{number}")
        )
    path = tmp_path_factory.mktemp("seen") / "joint.toml"
    path.write_text(
        "[joint]\ngear_ratio = 100.0\nencoder_side = 'output'\n[noise]\nsigma_arcsec = 1.0\n"
    )
    return runs, ta.load_simulation(path)


def sizes(text):
    """Sizes of a backlash among the first lines, in arcsec, with their standard errors."""
    return [
        (float(value), float(std))
        for value, std in re.findall(
            r"(?:half width|backlash) \(?([0-9.]+) (?:\+-|±) ([0-9.]+)", text
        )
    ]


def test_it_stands_in_the_first_lines_of_the_summary(at_one_speed):
    found = ta.diagnose(*at_one_speed, gain=False)
    assert not any(finding.confirmed for finding in found.findings)
    first = " ".join(line.strip() for line in found.summary().split("\n\n")[0].splitlines())
    assert "Detected, not distinguished: " in first
    assert "backlash" in first
    assert any(abs(value - HALF) < 5.0 * std < 1.0 for value, std in sizes(first))


def test_it_stands_in_the_first_lines_of_the_report(at_one_speed):
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    runs, simulation = at_one_speed
    page = ta.report(runs, simulation=simulation, orders=[1]).html
    body = page[page.index("<body") :]
    first = body[: body.index('aria-labelledby="measured"')]
    text = " ".join(html.unescape(re.sub(r"<[^>]*>", "", first)).split())
    assert "Detected, not distinguished:" in text
    assert any(abs(value - HALF) < 5.0 * std < 1.0 for value, std in sizes(text))
