"""Numbers of several heads beside the patterns: errors, angles, what a mean of heads keeps."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC, encoder

SEED = 66_000
SEEDS = range(SEED, SEED + 16)
PLACES = (0.0, 84.4, 203.7)
LINES = {1: (40.0, 0.4), 2: (25.0, 2.0), 5: (30.0, 1.1)}
SIZE, NOISE = 400, 3.0


def log_of(seed: int) -> dict[str, np.ndarray]:
    """Six turns and a half of three heads on one disc, each with a zero of its own."""
    rng = np.random.default_rng(seed)
    theta = 13.0 * np.pi * np.arange(SIZE) / SIZE
    log = {}
    for i, place in enumerate(np.radians(PLACES)):
        at = theta + place
        reading = at + encoder(at, LINES) + NOISE * ARCSEC * rng.normal(size=SIZE)
        log[f"head{i + 1}_rad"] = np.mod(reading, 2.0 * np.pi)
    return log


def selfcal(log: dict[str, np.ndarray], **more) -> ta.SelfCalibration:
    return ta.selfcal(log, method="heads", orders=list(LINES), **more)


@pytest.fixture(scope="module")
def found() -> list[ta.SelfCalibration]:
    print("seeds", SEEDS)
    return [selfcal(log_of(seed)) for seed in SEEDS]


def test_patterns_are_those_of_least_squares_of_the_differences(
    found: list[ta.SelfCalibration],
) -> None:
    """Three readings less a place of their own at each moment, and two zeros, solved at once."""
    log, one = log_of(SEED), found[0]
    heads = np.array(list(log.values()))
    mean = np.eye(3) - 1.0 / 3.0
    waves = [f(k * heads) for k in LINES for f in (np.cos, np.sin)]
    zeros = [np.repeat(np.eye(3)[i][:, None], SIZE, axis=1) for i in (1, 2)]
    columns = np.column_stack([(mean @ w).ravel() for w in (*waves, *zeros)])
    turned = np.angle(np.exp(1j * (heads - heads[0])))
    first = np.angle(np.exp(1j * (heads - heads[0])).mean(axis=1))[:, None]
    target = (mean @ (first + np.angle(np.exp(1j * (turned - first))))).ravel()
    x, *_ = np.linalg.lstsq(columns, target, rcond=None)
    left = target - columns @ x
    # A moment's place takes one reading of three.
    variance = left @ left / (3 * SIZE - SIZE - columns.shape[1])
    spread = variance * np.linalg.inv(columns.T @ columns)
    # Patterns are at corrected places, here at the readings: 40 arcsec away.
    assert one.noise_arcsec == pytest.approx(math.sqrt(variance) / ARCSEC, rel=1e-3)
    limit = one.noise_arcsec * math.sqrt(2.0 / (3 * SIZE))
    for k, o in enumerate(one.orders):
        pair = slice(2 * k, 2 * k + 2)
        along = x[pair] / np.hypot(*x[pair])
        assert o.cosine * ARCSEC == pytest.approx(x[2 * k], abs=0.05 * o.std * ARCSEC)
        assert o.sine * ARCSEC == pytest.approx(x[2 * k + 1], abs=0.05 * o.std * ARCSEC)
        error = math.sqrt(along @ spread[pair, pair] @ along) / ARCSEC
        assert o.std == pytest.approx(error, rel=2e-3), o
        assert o.std_factor == pytest.approx(o.std / limit, rel=2e-3)


def test_what_is_hidden_comes_back_within_its_errors(found: list[ta.SelfCalibration]) -> None:
    for k, (size, phase) in LINES.items():
        pulls = []
        for one in found:
            (o,) = [o for o in one.orders if o.order == k]
            pulls.append((o.amplitude - size) / o.std)
            turned = math.radians(o.phase_deg) - phase
            assert abs(math.remainder(turned, 2.0 * math.pi)) < 6.0 * o.std / size
        print(k, np.mean(pulls), np.std(pulls))
        # 4.5 errors of the mean and of the deviation of 16 pulls.
        assert abs(np.mean(pulls)) < 4.5 / 4.0
        assert np.std(pulls) == pytest.approx(1.0, abs=4.5 / math.sqrt(32.0))


def test_odd_and_even_turns_differ_as_both_say(found: list[ta.SelfCalibration]) -> None:
    """P is uniform by Kolmogorov's distance, and by the mean of its logarithm, 1 and 1."""
    tests = [one.held_out["odd_even_turns"] for one in found]
    ps = np.sort([test.p for test in tests])
    print(ps)
    assert np.abs(ps - (np.arange(16) + 0.5) / 16).max() < 1.95 / 4.0
    assert -np.mean(np.log(ps)) == pytest.approx(1.0, abs=4.5 / 4.0)
    # A pattern of half of its squares, and the noise of one reading.
    lines = 0.5 * sum(size**2 for size, _ in LINES.values())
    before = np.mean([test.rms_before**2 for test in tests])
    assert before == pytest.approx(lines + NOISE**2, rel=0.02)
    after = np.mean([test.rms_after**2 for test in tests])
    assert NOISE**2 < after < 1.1 * NOISE**2


def test_angles_turns_and_readings_are_counted(found: list[ta.SelfCalibration]) -> None:
    one = found[0]
    # A head's angle to the patterns' mean, some arcsec.
    assert one.beside["head_angles_deg"] == pytest.approx(PLACES, abs=0.02)
    assert one.readings == 3 * SIZE
    travel = float(np.ptp(np.unwrap(log_of(SEED)["head1_rad"])))
    assert one.turns == pytest.approx(travel / (2.0 * math.pi), rel=1e-9)
    assert one.blind[0].orders == (0.0,)


def test_what_the_mean_of_heads_keeps_is_told_of_the_order_that_keeps_most(
    found: list[ta.SelfCalibration],
) -> None:
    """By the sum of waves at the three places: of order 5 more than of the larger order 1."""
    places = np.radians(PLACES)
    kept = {k: abs(np.mean(np.exp(1j * k * places))) * size for k, (size, _) in LINES.items()}
    most = max(kept, key=lambda k: kept[k])
    assert LINES[most][0] < max(size for size, _ in LINES.values())
    (note,) = [n for n in found[0].notes if n.startswith("the mean of the heads keeps")]
    said = note.removeprefix("the mean of the heads keeps ").split(" arcsec of order ")
    assert int(said[1].split(",")[0]) == most
    assert float(said[0]) == pytest.approx(kept[most], abs=1.0)


def numbers(one: ta.SelfCalibration) -> list[list[float]]:
    test = one.held_out["odd_even_turns"]
    return [
        *([o.cosine, o.sine, o.std, o.retained, o.std_factor] for o in one.orders),
        [one.noise_arcsec, one.readings, one.turns, test.rms_before, test.rms_after, test.p],
        one.beside["head_angles_deg"],
    ]


@pytest.mark.parametrize(("unit", "turn"), [("deg", 360.0), ("turn", 1.0)])
def test_every_unit_gives_the_same_numbers(
    found: list[ta.SelfCalibration], unit: str, turn: float
) -> None:
    scale = turn / (2.0 * math.pi)
    log = {name.replace("_rad", f"_{unit}"): scale * v for name, v in log_of(SEED).items()}
    for mine, its in zip(numbers(selfcal(log)), numbers(found[0]), strict=True):
        np.testing.assert_allclose(mine, its, rtol=1e-6, atol=1e-9)


def test_a_mirrored_disc_has_mirrored_numbers(found: list[ta.SelfCalibration]) -> None:
    """All readings turned round: an error e(x) becomes -e(-x), heads stand the other way."""
    log = {name: np.mod(-v, 2.0 * math.pi) for name, v in log_of(SEED).items()}
    two = selfcal(log)
    for o, p in zip(found[0].orders, two.orders, strict=True):
        assert (-o.cosine, o.sine, o.std) == pytest.approx((p.cosine, p.sine, p.std), rel=1e-6)
    assert [-a % 360.0 for a in two.beside["head_angles_deg"]] == pytest.approx(
        found[0].beside["head_angles_deg"], abs=1e-9
    )
    assert two.noise_arcsec == pytest.approx(found[0].noise_arcsec, rel=1e-9)


def test_a_log_in_two_runs_is_the_log(found: list[ta.SelfCalibration]) -> None:
    """Cut in the middle of a turn: readings and travel add up, patterns stay but for a zero."""
    log, one = log_of(SEED), found[0]
    two = selfcal({**log, "run": np.repeat([1, 2], [150, SIZE - 150])})
    step = 6.5 / SIZE
    assert two.turns == pytest.approx(one.turns - step, abs=1e-3)
    assert two.readings == one.readings
    assert two.beside["head_angles_deg"] == pytest.approx(one.beside["head_angles_deg"], abs=0.01)
    for o, p in zip(one.orders, two.orders, strict=True):
        assert (p.cosine, p.sine) == pytest.approx((o.cosine, o.sine), abs=0.5 * o.std)
        assert p.std == pytest.approx(o.std, rel=0.05)
    assert two.noise_arcsec == pytest.approx(one.noise_arcsec, rel=0.01)
