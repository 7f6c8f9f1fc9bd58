"""Structure that no cause has a name for is seen, and by the test that should see it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.goodness import goodness_of_fit
from trueangle.diagnosis.goodness.evidence import Evidence
from trueangle.diagnosis.goodness.unexplained import FREE_PATH

from .readings import Array, Motion, leftover


def by_direction(m: Motion, rng: np.random.Generator) -> Array:
    return np.asarray(m.direction * np.sin(3.0 * m.theta))


def bent(m: Motion, rng: np.random.Generator) -> Array:
    return np.asarray(np.sin(12.0 * m.theta + 2.0 * np.sin(m.theta)))


def pick_up(m: Motion, rng: np.random.Generator) -> Array:
    phase = rng.uniform(0.0, 2.0 * np.pi, int(m.run.max()) + 1)[m.run]
    return np.asarray(np.sin(2.0 * np.pi * 50.0 * m.clock + phase))


def by_speed(m: Motion, rng: np.random.Generator) -> Array:
    return np.asarray((m.speed - 17.5) * np.sin(53.0 * m.theta))


def slipping(m: Motion, rng: np.random.Generator) -> Array:
    phase = rng.uniform(0.0, 2.0 * np.pi, int(m.run.max()) + 1)[m.run]
    return np.asarray(np.sin(17.3 * m.theta + phase))


def warm_play(m: Motion, rng: np.random.Generator) -> Array:
    return np.asarray(m.direction * (m.temperature - 27.5))


def new_zeros(m: Motion, rng: np.random.Generator) -> Array:
    return np.asarray(rng.laplace(size=int(m.run.max()) + 1)[m.run])


STRUCTURES = {
    "place x direction": (by_direction, "rich", 0.5),
    "place": (bent, "rich", 0.5),
    "time periodogram": (pick_up, "rich", 0.5),
    "place x speed": (by_speed, "rich", 0.5),
    "place within runs": (slipping, "split", 0.7),
    "place x direction x temperature": (warm_play, "rich", 0.5),
    "zeros of the runs": (new_zeros, "rich", 1.0),
}


@pytest.mark.parametrize("kind", ["gauss", "ar 0.5"])
@pytest.mark.parametrize("test", STRUCTURES)
def test_structure_is_seen(test: str, kind: str) -> None:
    structure, design, size = STRUCTURES[test]
    for seed in range(2):
        fit = goodness_of_fit(leftover(design, kind, 90 + seed, structure, size), 150)
        assert fit.found
        firing = {item.test: item for item in fit.firing}
        assert test in firing, (seed, fit.firing)
        # Half of what is there is the least to be said of it, a fifth more the most.
        assert 0.5 * size < firing[test].rms < 1.2 * size, (seed, firing[test])


def test_pick_up_has_its_frequency() -> None:
    fit = goodness_of_fit(leftover("rich", "gauss", 1, pick_up, 0.6), 150)
    assert fit.firing[0].test == "time periodogram"
    found = float(fit.firing[0].says.split("a line of ")[1].split(" Hz")[0])
    assert abs(found - 50.0) < 0.01, fit.firing[0]


def test_small_structure_is_no_structure() -> None:
    fit = goodness_of_fit(leftover("few", "gauss", 4, by_direction, 0.02), 150)
    assert not fit.found
    assert fit.rms == 0.0


@pytest.mark.parametrize("size", [0.3, 4.0])
def test_a_free_path_is_a_share_of_what_is_left_with_it(size: float) -> None:
    """It is taken out of what other tests are asked about, and has no name all the same."""
    left = leftover("rich", "gauss", 41)
    path = size * np.sin(2.0 * np.pi * left.clock / np.ptp(left.clock))
    with_path = replace(left, residual=left.residual + path)
    told = Evidence("free path in time", 99.0, 1e-9, "", rms=np.std(path), looks_like=FREE_PATH)
    found = goodness_of_fit(left, loose=with_path, path=told)
    assert found.rms == pytest.approx(np.std(path))
    wanted = np.var(path) / (np.var(path) + np.var(left.residual))
    assert found.share == pytest.approx(wanted, rel=0.05)
    assert found.share < 0.97
