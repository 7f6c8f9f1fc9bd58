"""What speaks against white noise: how seldom by chance, from where on, how large it is told."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.estimation.linear import NormalEquations
from trueangle.fitting import correlation
from trueangle.fitting.correlation import correlation_found
from trueangle.fitting.unlikeruns import far_runs

SEED = 47_700


def said(monkeypatch, parts):
    """What is said of residuals in the order of time, of a fit that took nothing from them."""
    monkeypatch.setattr(correlation, "_in_time", lambda *_: parts)
    count = sum(part.size for part in parts)
    solution = SimpleNamespace(residual_variance=1.0, degrees_of_freedom=float(count))
    fitted, problem = SimpleNamespace(solution=solution), SimpleNamespace(unknowns=0)
    return correlation_found(problem, fitted, [], [])


def test_white_noise_is_told_to_correlate_once_in_some_hundred(monkeypatch):
    """Three looks at 3.1 standard deviations; a mean square has a longer tail: 0.1 to 0.3 %."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    words = [said(monkeypatch, list(rng.normal(size=(2, 2000)))) for _ in range(2000)]
    for look in ("neighbours in time correlate", "means of 8 ", "means of 64"):
        share = np.mean([text.startswith(look) for text in words])
        assert share < 0.0035 + 0.003 * (look == "means of 64"), look
    assert np.mean([text != "" for text in words]) < 0.012


@pytest.mark.parametrize("length", [8, 64])
@pytest.mark.parametrize("runs", [1, 3])
def test_means_of_neighbours_count_from_their_standard_deviations_on(length, runs, monkeypatch):
    """Steps of each stretch's own: the ratio of squares is known, and its root is what is told.

    Within a stretch signs alternate, so that next neighbours tell nothing.
    """
    blocks = 4800 // length // runs // 2 * 2
    deviations = 3.1 * np.sqrt(2.0 / (blocks * runs))
    signs = np.tile([1.0, -1.0], length // 2)
    for times, seen in ((1.03, True), (0.97, False)):
        ratio = 1.0 + times * deviations
        # Of squares 1 + s^2 a block's mean has s^2.
        step = np.sqrt(ratio / (length - ratio))
        levels = step * np.tile([1.0, -1.0], blocks // 2)
        part = np.concatenate([signs + level for level in levels])
        text = said(monkeypatch, [part] * runs)
        assert (f"means of {length} neighbours" in text) == seen
        if seen:
            told = float(re.search(r"scatter (\S+) times", text)[1])
            assert told == pytest.approx(np.sqrt(ratio), rel=0.051)


@pytest.mark.parametrize("times", [1.02, 0.98])
def test_neighbours_count_from_their_standard_deviations_on(times, monkeypatch):
    """A cosine in the time: neighbours correlate by its step, of either sign of the residuals."""
    near = times * 3.1 / np.sqrt(3999.0)
    wave = np.sqrt(2.0) * np.cos(np.arccos(near) * np.arange(4000))
    found = float(wave[1:] @ wave[:-1]) / float(wave @ wave)
    assert found == pytest.approx(near, abs=1e-3 * near + 2e-4)
    for sign in (1.0, -1.0):
        text = said(monkeypatch, [sign * wave])
        assert text.startswith("neighbours") == (times > 1.0)
        if times > 1.0:
            assert text == f"neighbours in time correlate by {near:.2f}"


def sums_of(pairs, count=90, noise=None):
    """Of a run at places all around, with these coefficients of one order and others."""
    x = 2.0 * np.pi * np.arange(count) / count
    design = np.column_stack([f(k * x) for k in range(1, len(pairs) // 2 + 1)
                              for f in (np.cos, np.sin)])  # fmt: skip
    error = design @ np.asarray(pairs)
    return NormalEquations.of_rows(design, error if noise is None else error + noise)


@pytest.mark.parametrize("turn", [0.0, 1.3, -2.0])
@pytest.mark.parametrize("runs", [2, 3, 5])
def test_a_run_is_unlike_the_others_from_a_fifth_of_its_energy_on(runs, turn):
    """Of two runs as of many: by how far it is from the other, whose half is in what they share."""
    size = np.array([np.cos(turn), np.sin(turn), 0.5, -0.5])
    rng = np.random.default_rng(SEED + 2)
    small = 1e-4 * rng.normal(size=(runs, 90))
    for share, seen in ((0.205, True), (0.195, False)):
        # One coefficient less than the others': of the run's own energy it is this share.
        own = float(size @ size)
        across = np.array([-size[1], size[0], 0.5, 0.5])
        across *= np.sqrt(own / float(across @ across) * share / (1.0 - share))
        odd = size + across
        assert float(across @ across) / float(odd @ odd) == pytest.approx(share)
        pairs = [size] * (runs - 1) + [odd]
        for place in (0, runs - 1):
            order = np.roll(pairs, place + 1, axis=0)
            found = far_runs([sums_of(p, noise=n) for p, n in zip(order, small, strict=True)])
            named = [i for i, _ in found]
            if runs > 2:
                assert named == ([place] if seen else [])
            else:  # of two either may be the odd one; the smaller is farther by its own energy
                assert (place in named) == seen


@pytest.mark.parametrize("runs", [2, 4])
def test_how_far_a_run_is_is_told_in_the_scatter_of_its_coefficients(runs):
    """n/2 of the squares of the distance, over the noise of all and its coefficients."""
    print("seed", SEED + 3)
    rng = np.random.default_rng(SEED + 3)
    noise = 0.05 * rng.normal(size=(runs, 90))
    pairs = np.array([[1.0, 0.0]] * (runs - 1) + [[-1.0, 0.5]])
    sums = [sums_of(p, noise=n) for p, n in zip(pairs, noise, strict=True)]
    alone = np.array([np.linalg.solve(one.gram, one.moment) for one in sums])
    left = sum(one.squares - float(one.moment @ b) for one, b in zip(sums, alone, strict=True))
    variance = left / (runs * (90.0 - 3.0))
    apart = alone[1] - alone[0] if runs == 2 else alone[-1] - np.median(alone, axis=0)
    found = dict(far_runs(sums))
    assert found[runs - 1] == pytest.approx(45.0 * float(apart @ apart) / (2.0 * variance))
