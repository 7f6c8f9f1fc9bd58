"""Outliers: their rows, their weights, and how well their share and size are known."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.outliers import Outliers
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs

from .test_outliers import SIM


@pytest.mark.parametrize("size", [12.0, 60.0, 400.0])
def test_their_rows_have_no_weight_and_their_share_is_known_to_what_none_shows(size: float) -> None:
    """Of a share of 3 / size at least no reading stands out; a fifth of it at the least."""
    print("seed 80425")
    signals = join_runs(ta.simulate(SIM, 3))
    rng = np.random.default_rng(80_425)
    noise = 1.5 * rng.normal(size=len(signals))
    wild = rng.choice(len(signals), 80, replace=False)
    noise[wild] += 1.5 * size * rng.normal(size=wild.size)
    found = Outliers.find_scatter(Regression.of(signals, noise, SIM.surroundings, rho=0.0))
    assert found is not None
    told = {(str(label), row) for label, row in found.parameters["rows"].value}
    labels = [
        (str(signals.labels[r]), int(k)) for r, k in zip(signals.run, signals.row, strict=True)
    ]
    rows = np.array([label in told for label in labels])
    assert found.weights[rows] == pytest.approx(1e-6)
    assert found.weights[~rows] == pytest.approx(1.0)
    # All that are far off, and next to none beside.
    assert rows[wild[np.abs(noise[wild]) > 10.0]].all()
    assert np.setdiff1d(np.flatnonzero(rows), wild).size <= 3
    fraction, spread = found.parameters["fraction"], found.parameters["size_arcsec"]
    hidden = float(np.clip(3.0 / (spread.value / 1.5), 0.2, 1.0))
    chance = np.sqrt(fraction.value * (1.0 - fraction.value) / len(signals))
    assert fraction.std == pytest.approx(max(chance, hidden * fraction.value), rel=0.1)
    assert abs(fraction.value - 80.0 / len(signals)) < 3.0 * fraction.std
    assert abs(spread.value / (1.5 * size) - 1.0) < 3.0 * spread.std / spread.value
