"""Numbers beside the patterns of two scales: facets, coupling, and clampings that are predicted."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

import trueangle as ta
from selfcalibration.rotor import ARCSEC, encoder

SEED = 67_000
SHIFTS = (0.0, 84.4, 240.7)
MINE = {1: (200.0, 0.4), 2: (90.0, 2.0)}
THEIRS = {1: (120.0, 1.0), 2: (60.0, 0.2)}


def clamped(
    seed: int, coupling: float = 0.0, n: int = 48, shifts: tuple[float, ...] = SHIFTS
) -> dict[str, np.ndarray]:
    """Both scales read with 2 arcsec at free places, a run a clamping."""
    rng = np.random.default_rng(seed)
    table: dict[str, list[np.ndarray]] = {"run": [], "indicated_rad": [], "reference_rad": []}
    for j, shift in enumerate(np.radians(shifts)):
        theta = 2.0 * np.pi * (np.arange(n) + rng.uniform(size=n)) / n
        waves = (f(k * theta) for k in (1, 2) for f in (np.cos, np.sin))
        bent = theta + sum(coupling * ARCSEC * rng.normal() * wave for wave in waves)
        noise = 2.0 * ARCSEC * rng.normal(size=(2, n))
        a = bent + encoder(bent, MINE) + noise[0]
        b = theta + shift + encoder(theta + shift, THEIRS) + noise[1]
        for name, values in (("run", np.full(n, j)), ("indicated_rad", a), ("reference_rad", b)):
            table[name].append(np.mod(values, 2.0 * np.pi) if name != "run" else values)
    return {name: np.concatenate(parts) for name, parts in table.items()}


def selfcal(log: dict[str, np.ndarray], orders: tuple[int, ...] = (1, 2)) -> ta.SelfCalibration:
    return ta.selfcal(log, method="shifts", orders=orders)


def test_a_clamping_left_out_is_predicted_as_the_noise_of_all_says() -> None:
    """Of 30 logs p is uniform, by Kolmogorov's distance; errors are those of both readings."""
    print("seeds", SEED, "to", SEED + 29)
    ps, squares = [], []
    for seed in range(SEED, SEED + 30):
        test = selfcal(clamped(seed)).held_out["clampings"]
        ps.append(test.p)
        squares.append(test.rms_after**2)
    away = np.abs(np.sort(ps) - (np.arange(30) + 0.5) / 30).max()
    assert away < 1.95 / math.sqrt(30.0)
    # 4.5 errors of the deviation of 30 uniform numbers.
    assert np.std(ps) == pytest.approx(1.0 / math.sqrt(12.0), abs=0.11)
    # Twice 4 of the readings, and up to a quarter of it by the patterns of the others.
    assert 7.5 < np.mean(squares) < 10.5


def test_what_a_clamping_left_out_shows_is_counted_reading_by_reading() -> None:
    """Before: differences of both scales about a zero a clamping, which takes one of them."""
    print("seed", SEED)
    log = clamped(SEED)
    found = selfcal(log)
    squares = 0.0
    for run in range(3):
        at = log["run"] == run
        turns = np.exp(1j * (log["indicated_rad"] - log["reference_rad"])[at])
        away = np.angle(turns / turns.mean())
        squares += float(((away - away.mean()) ** 2).sum()) / ARCSEC**2
    told = found.held_out["clampings"]
    assert told.rms_before == pytest.approx(math.sqrt(squares / (3.0 * 47.0)), rel=1e-9)
    assert found.readings == 3 * 48
    limit = found.noise_arcsec * math.sqrt(2.0 / found.readings)
    for o in found.orders:
        assert o.std_factor == pytest.approx(o.std / limit, rel=0.1)
    travel = sum(np.ptp(np.unwrap(log["indicated_rad"][log["run"] == run])) for run in range(3))
    assert found.turns == pytest.approx(travel / (2.0 * np.pi), rel=1e-12)


def test_a_coupling_is_told_with_its_size() -> None:
    """Of 5 arcsec in every coefficient of every clamping, to 4.5 errors of their rms."""
    print("seeds", SEED + 100, "to", SEED + 109)
    squares = []
    for seed in range(SEED + 100, SEED + 110):
        found = selfcal(clamped(seed, 5.0, shifts=(0.0, 40.0, 95.0, 170.0, 300.0)))
        squares.append(found.beside["coupling_arcsec"] ** 2)
        (note,) = [n for n in found.notes if n.startswith("the coupling changes by")]
        said = float(note.split("changes by ")[1].split()[0])
        assert said == pytest.approx(found.beside["coupling_arcsec"], rel=0.005)
    # What clampings have in common passes for the pattern: 16 coefficients of 20 are left.
    rms = math.sqrt(np.mean(squares))
    assert rms == pytest.approx(5.0, rel=4.5 / math.sqrt(2.0 * 16.0 * 10.0))


def polygon(seed: int, facets: np.ndarray) -> dict[str, np.ndarray]:
    """A joint read at the facets of a polygon, remounted by some of them, 1 arcsec."""
    n = facets.size
    rng = np.random.default_rng(seed)
    table: dict[str, list[np.ndarray]] = {
        "run": [], "indicated_rad": [], "reference_rad": [], "shift_deg": [],
    }  # fmt: skip
    for j, step in enumerate((0, 2, 5)):
        place = np.arange(n)
        theta = 2.0 * np.pi * place / n
        facet = (place + step) % n
        error = encoder(theta, MINE) - ARCSEC * facets[facet] + ARCSEC * rng.normal(size=n)
        table["run"].append(np.full(n, j))
        table["indicated_rad"].append(np.mod(theta + error, 2.0 * np.pi))
        table["reference_rad"].append(2.0 * np.pi * facet / n)
        table["shift_deg"].append(np.full(n, 360.0 * step / n))
    return {name: np.concatenate(parts) for name, parts in table.items()}


def test_errors_of_facets_are_what_seeds_scatter() -> None:
    """Each facet about the mean of all, over 30 calibrations of one polygon."""
    print("seeds", SEED + 200, "to", SEED + 229)
    facets = np.random.default_rng(SEED).normal(0.0, 2.0, 12)
    found, stated = [], []
    for seed in range(SEED + 200, SEED + 230):
        beside = ta.selfcal(polygon(seed, facets), method="shifts", orders=[1, 2, 3]).beside
        found.append(beside["facets_arcsec"])
        stated.append(np.square(beside["facets_std_arcsec"]))
    scatter = np.array(found).std(axis=0, ddof=1)
    ratio = math.sqrt(np.mean(stated) / np.mean(scatter**2))
    # 12 facets of 30 draws, their sum fixed.
    assert ratio == pytest.approx(1.0, abs=4.5 / math.sqrt(2.0 * 11.0 * 29.0) + 0.02)
    assert np.abs(np.sum(found, axis=1)).max() < 1e-6


@pytest.mark.parametrize("shifts", [SHIFTS, (0.0, 180.0)])
def test_exchanged_scales_exchange_their_numbers(shifts: tuple[float, ...]) -> None:
    """The other scale's pattern with its errors is the first one's of a log turned round."""
    print("seed", SEED + 300)
    log = clamped(SEED + 300, shifts=shifts)
    turned = {**log, "indicated_rad": log["reference_rad"], "reference_rad": log["indicated_rad"]}
    one, two = (selfcal(given, (1, 2, 3)) for given in (log, turned))
    # Half a turn is the same place of order 2 on both.
    assert [o.order for o in one.orders] == ([1.0, 2.0, 3.0] if shifts == SHIFTS else [1.0, 3.0])
    for mine, its in ((one, two), (two, one)):
        for o, other in zip(mine.orders, its.beside["other"], strict=True):
            told = {**o.to_dict(), "of": "the other encoder"}
            assert other.keys() == told.keys()
            for name, value in told.items():
                # The noise is taken at the other's places: 2 % of an error away.
                if name == "of":
                    assert other[name] == value
                elif name != "phase_deg" or o.amplitude > 10.0 * o.std:
                    assert other[name] == pytest.approx(value, rel=1e-3, abs=0.05 * o.std), name
    assert two.noise_arcsec == pytest.approx(one.noise_arcsec, rel=1e-4)


def test_errors_hold_where_neighbours_agree() -> None:
    """Pulls of noise that remembers some readings, of both scales, and the note that says so."""
    print("seeds", SEED + 400, "to", SEED + 415)
    pulls = []
    for seed in range(SEED + 400, SEED + 416):
        log = clamped(seed, n=300, shifts=SHIFTS[:2])  # of three a coupling takes it
        rng = np.random.default_rng(seed + 1000)
        slow = signal.lfilter([1.0], [1.0, -0.8], rng.normal(size=log["run"].size))
        log["indicated_rad"] = np.mod(log["indicated_rad"] + 3.0 * ARCSEC * slow, 2.0 * np.pi)
        found = selfcal(log)
        assert "neighbouring residuals correlate: standard errors allow for it" in found.notes
        for o, (size, phase) in zip(found.orders, MINE.values(), strict=True):
            pulls.append((o.cosine - size * math.sin(phase)) / o.std)
            pulls.append((o.amplitude - size) / o.std)
    print(np.mean(pulls), np.std(pulls))
    assert abs(np.mean(pulls)) < 4.5 / math.sqrt(64.0)
    # White errors are two and a half times too small.
    assert 0.75 < np.std(pulls) < 1.3


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_shifts_that_readings_contradict_are_told_by_how_much(sense: float) -> None:
    """Of either sense: what a clamping is off by most is said, and its readings are taken."""
    log = clamped(SEED + 500)
    log["shift_deg"] = (
        sense * (np.array(SHIFTS) + np.array([0.0, -2.5, 5.0]))[log["run"].astype(int)]
    )
    found = selfcal(log)
    (note,) = [n for n in found.notes if "deviate from shift_deg" in n]
    assert float(note.split("by up to ")[1].split()[0]) == pytest.approx(5.0, abs=0.02)
    assert found.beside["shifts_deg"] == pytest.approx(SHIFTS, abs=0.1)
    log["shift_deg"] = sense * np.array(SHIFTS)[log["run"].astype(int)]
    assert not any("shift_deg" in n for n in selfcal(log).notes)
