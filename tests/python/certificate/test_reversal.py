"""Play in a certificate: one line of the budget, known as well as the readings tell it."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.certificate.document import certify
from trueangle.certificate.identity import Identity

#: Half of the play and the noise of a reading, arcsec.
HALF, NOISE = 10.8, 0.7


def runs_of(count, half=HALF, seed=0):
    """Out and back at 36 places; order 1 of 36 arcsec."""
    rng = np.random.default_rng([seed, count])
    out = 10.0 * np.arange(37) + 1.0
    angle = np.concatenate([out, out[::-1] - 2.0])
    way = np.repeat([1.0, -1.0], 37)
    error = 36.0 * np.sin(np.radians(angle)) + half * way
    return [
        ta.CalibrationRun(angle, angle + (error + NOISE * rng.normal(size=74)) / 3600.0, 360.0)
        for _ in range(count)
    ]


@pytest.mark.parametrize("count", [1, 2, 3, 8])
def test_play_counts_once_however_few_the_runs(count):
    """With one run and with two U had been 263 arcsec, by play taken for noise that remembers."""
    made = certify(runs_of(count), Identity("1", "joint"), orders=[1]).content
    lines = {line["name"]: line for line in made["budget"]["lines"]}
    play = lines["half the reversal error"]
    error = NOISE / np.sqrt(74.0 * count)
    assert play["standard_arcsec"] == pytest.approx(HALF, abs=5.0 * error)
    # What is known to a hundredth has as many degrees of freedom as a Gaussian.
    assert play["degrees_of_freedom"] > 100.0
    noise = NOISE * np.sqrt(3.0 / (74.0 * count))
    assert lines["fit of the readings"]["standard_arcsec"] == pytest.approx(noise, rel=0.6)
    assert made["budget"]["coverage_factor"] == pytest.approx(2.0, abs=0.05)
    assert made["budget"]["expanded_arcsec"] == pytest.approx(2.0 * HALF, rel=0.05)
    row = made["harmonics"][0]
    assert row["amplitude_arcsec"] == pytest.approx(36.0, abs=row["amplitude_expanded_arcsec"] * 2)


def test_the_play_of_a_few_runs_has_the_freedom_of_how_well_it_is_known():
    """(h / u(h))² / 2 of JCGM 100, G.4.2; u(h) by the scatter over three runs."""
    halves = [-9.0, -10.0, -11.0]
    runs = [runs_of(1, half, 5)[0] for half in halves]
    made = certify(runs, Identity("1", "joint"), orders=[1]).content
    play = next(x for x in made["budget"]["lines"] if x["name"].endswith("reversal error"))
    assert play["standard_arcsec"] == pytest.approx(10.0, abs=0.3)
    assert play["degrees_of_freedom"] == pytest.approx(0.5 * (10.0 * np.sqrt(3.0)) ** 2, rel=0.3)


def test_no_play_is_no_line_of_it():
    made = certify(runs_of(3, 0.0), Identity("1", "joint"), orders=[1]).content
    play = next(x for x in made["budget"]["lines"] if x["name"].endswith("reversal error"))
    assert play["standard_arcsec"] == 0.0
    assert not any("reversal error" in note for note in made["notes"])
