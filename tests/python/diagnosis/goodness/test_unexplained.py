"""What fires, how much of it is unexplained, and of what it is a share."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.goodness import FREE_PATH, LEVEL, Unexplained, goodness_of_fit
from trueangle.diagnosis.goodness.evidence import Evidence
from trueangle.diagnosis.goodness.noise import Noise

from .readings import leftover


def item(p: float, rms: float = 1.0, decides: bool = True, looks_like: str = "") -> Evidence:
    return Evidence(f"{p:g}", 1.0, p, "", decides, rms, None, looks_like)


def made(*evidence: Evidence) -> Unexplained:
    return Unexplained(True, 1.0, 1.0, list(evidence), Noise(1.0, 0.0, 0.1, 0.0, 10.0, 0.0))


def test_tests_fire_at_one_percent_for_all_of_their_kind_together() -> None:
    deciding = [item(part * LEVEL / 4.0) for part in (0.9, 1.1, 3.9)]
    path = item(0.7, 9.0, looks_like=FREE_PATH)
    noise = [item(part * LEVEL / 3.0, decides=False) for part in (0.95, 1.05, 2.9)]
    fit = made(*deciding, path, *noise)
    assert fit.firing == [deciding[0], path]
    assert fit.noise_firing == [noise[0]]


def test_what_is_beside_a_path_is_the_largest_that_fires() -> None:
    fit = made(item(0.0, 2.0), item(0.0, 5.0), item(0.0, 9.0, looks_like=FREE_PATH), item(0.9, 7.0))
    assert fit.beside_path == 5.0
    assert made(item(0.0, 9.0, looks_like=FREE_PATH)).beside_path == 0.0
    assert made(item(0.0, 0.0)).beside_path > 0.0


def test_the_share_is_of_the_variance_with_paths_in_time() -> None:
    left = leftover("rich", "gauss", 71, lambda m, rng: np.sin(12.0 * m.theta + 1.0), 2.0)
    slow = replace(left, residual=left.residual + 3.0 * np.sin(left.clock / 40.0))
    path = item(0.3, 2.5, looks_like=FREE_PATH)
    for loose, beside in ((None, None), (slow, path)):
        fit = goodness_of_fit(left, 40.0, loose=loose, path=beside)
        assert fit.found
        assert fit.rms == pytest.approx(max(e.rms for e in fit.firing))
        assert fit.share == pytest.approx(fit.rms**2 / np.var((loose or left).residual))
    assert fit.rms == pytest.approx(2.5)
