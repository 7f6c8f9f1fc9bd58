"""A line that is believed, judged by the change that was fitted."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.diagnosis.beliefs import judge_line


def test_errors_of_a_line_are_those_along_and_across_it() -> None:
    """By the covariance turned into its own direction; of one that is zero across, none."""
    print("seed 91500")
    rng = np.random.default_rng(91_500)
    for angle in rng.uniform(0.0, 2.0 * np.pi, 300):
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-along[1], along[0]])
        size = float(rng.uniform(3.0, 30.0))
        for a, b in ((0.04, 0.01), (0.04, 0.0), (0.0, 0.01)):
            covariance = a * np.outer(along, along) + b * np.outer(across, across)
            told = judge_line("output 1", (0.0, 10.0), size * along - (0.0, 10.0), covariance).std
            assert told["amplitude_arcsec"] == pytest.approx(np.sqrt(a), abs=1e-7)
            turn = np.degrees(np.sqrt(b) / size)
            assert told["phase_deg"] == pytest.approx(turn, abs=1e-6)
