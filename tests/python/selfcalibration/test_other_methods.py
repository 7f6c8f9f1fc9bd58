"""Heads, shifts and dual: their limits, their blind orders, their names."""

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC, coefficients, encoder
from trueangle.errors import NoModelError

LINES = {k: (300.0 / k, 0.7 * k) for k in range(1, 9)}
OTHER = {k: (200.0 / k, 1.3 * k) for k in range(1, 9)}

#: Standard deviations that no estimate of a test may be off: one in 15 000 beyond 4.
FAR = 4.0


def read(theta, lines, sigma, rng):
    return np.mod(theta + encoder(theta, lines) + sigma * ARCSEC * rng.normal(size=theta.size), 7e9)


def heads_log(angles, seed, sigma=5.0, n=3000, lines=LINES):
    print("seed", seed)
    rng = np.random.default_rng(seed)
    theta = np.sort(rng.uniform(0.0, 6.0 * np.pi, n))
    return {
        f"head{i + 1}_rad": np.mod(read(theta + np.radians(a), lines, sigma, rng), 2.0 * np.pi)
        for i, a in enumerate(angles)
    }


def shifts_log(shifts, seed, sigma=2.0, n=512, coupling=0.0, raw=True):
    print("seed", seed)
    rng = np.random.default_rng(seed)
    table = {"run": [], "indicated_rad": [], "reference_rad": [], "shift_deg": []}
    for j, shift in enumerate(np.radians(shifts)):
        theta = 2.0 * np.pi * (np.arange(n) + rng.uniform()) / n
        bent = coupling * ARCSEC * np.cos(theta - rng.uniform(0, 6.0))
        a = read(theta + bent, LINES, sigma, rng)
        b = read(theta + shift, OTHER, sigma, rng) - (0.0 if raw else shift)
        table["run"].append(np.full(n, j))
        table["indicated_rad"].append(np.mod(a, 2.0 * np.pi))
        table["reference_rad"].append(np.mod(b, 2.0 * np.pi))
        table["shift_deg"].append(np.full(n, np.degrees(shift)))
    return {name: np.concatenate(parts) for name, parts in table.items()}


def off(found, lines=LINES):
    want = dict(zip(lines, coefficients(lines).reshape(-1, 2), strict=True))
    return np.array(
        [
            (v - w) / o.std
            for o in found.orders
            for v, w in zip((o.cosine, o.sine), want[int(o.order)], strict=True)
        ]
    )


@pytest.mark.parametrize("n", [2, 3, 4])
def test_equispaced_heads_refuse_multiples_of_their_number(n):
    # Small: what is blind moves the places by its own size, to second order.
    lines = {k: (c / 10.0, phi) for k, (c, phi) in LINES.items()}
    log = heads_log(np.arange(n) * 360.0 / n, 8100 + n, lines=lines)
    found = ta.selfcal(log, orders=range(1, 9))
    refused = {k for b in found.blind for k in b.orders} - {0.0}
    assert refused == {float(k) for k in range(n, 9, n)}
    assert not refused & {o.order for o in found.orders}
    assert found.orders[0].std_factor == pytest.approx(1.0, abs=0.03)
    assert np.abs(off(found, lines)).max() < FAR


def test_two_heads_at_forty_degrees_follow_the_closed_form():
    found = ta.selfcal(heads_log([0.0, 40.0], 8110), orders=range(1, 9))
    for o in found.orders:
        # Information of order k from two heads: sin^2(20 deg k) of what both would give.
        factor = 1.0 / abs(np.sin(np.radians(20.0 * o.order)))
        assert o.std_factor == pytest.approx(factor, rel=0.04)
    assert np.abs(off(found)).max() < FAR


def test_heads_that_share_a_zero_need_their_angles():
    log = heads_log([0.0, 119.2, 203.7], 8120)
    shared = {
        name: np.mod(values - np.radians(a), 2.0 * np.pi)
        for (name, values), a in zip(log.items(), [0.0, 119.2, 203.7], strict=True)
    }
    with pytest.raises(NoModelError, match="`head_angles="):
        ta.selfcal(shared)
    found = ta.selfcal(shared, orders=range(1, 9), head_angles=[0.0, 119.2, 203.7])
    assert np.abs(off(found)).max() < FAR


def test_a_model_without_a_reference_keeps_the_sign_of_reversed_columns():
    log = heads_log([0.0, 119.2, 203.7], 41)
    reversed_ = {name.removesuffix("_rad"): -values for name, values in log.items()}
    columns = {name: (f"-{name}", "rad") for name in reversed_}
    found = ta.selfcal(reversed_, orders=range(1, 9), signals=columns)
    assert found.model.indicated_sign == -1
    assert ta.selfcal(log, orders=range(1, 9)).model.shafts == found.model.shafts
    assert np.abs(off(found)).max() < FAR
    log = shifts_log([0.0, 33.0, 101.0], 42)
    log["enc"] = -log.pop("indicated_rad")
    found = ta.selfcal(log, orders=range(1, 9), signals={"indicated": ("-enc", "rad")})
    assert found.model.indicated_sign == -1


@pytest.mark.parametrize("raw", [True, False])
def test_three_shifts_tell_both_patterns(raw):
    found = ta.selfcal(shifts_log([0.0, 84.4, 240.7], 8200, raw=raw), orders=range(1, 9))
    assert found.method == "shifts"
    assert np.abs(off(found)).max() < FAR
    s = np.exp(1j * np.radians([0.0, 84.4, 240.7])[:, None] * np.arange(1, 9)).mean(axis=0)
    for o, share in zip(found.orders, 1.0 - np.abs(s) ** 2, strict=True):
        assert o.std_factor >= 0.99 / np.sqrt(share)
        assert o.retained == pytest.approx(share, rel=0.15)
    other = {o["order"]: o["amplitude_arcsec"] for o in found.beside["other"]}
    assert other[3] == pytest.approx(200.0 / 3.0, abs=1.0)
    assert found.held_out["clampings"].p > 1e-4


def test_shifts_of_half_a_turn_are_blind_to_even_orders():
    found = ta.selfcal(shifts_log([0.0, 180.0], 8210), orders=range(1, 9))
    assert [o.order for o in found.orders] == [1.0, 3.0, 5.0, 7.0]
    assert {2.0, 4.0, 6.0, 8.0} <= {k for b in found.blind for k in b.orders}
    one = ta.selfcal
    with pytest.raises(NoModelError, match="shift"):
        one(shifts_log([0.0], 8211))


def test_a_coupling_that_changes_is_reported():
    found = ta.selfcal(
        shifts_log([0.0, 40.0, 95.0, 170.0, 300.0], 8220, coupling=8.0), orders=range(1, 9)
    )
    assert 2.0 < found.beside["coupling_arcsec"] < 16.0
    assert found.orders[0].std > 5.0 * found.orders[4].std
    assert np.abs(off(found)[4:]).max() < FAR


def test_a_polygon_and_a_joint_come_out_as_by_numpy():
    seed = 8230
    print("seed", seed)
    rng = np.random.default_rng(seed)
    n, shifts = 36, [0, 7, 17]
    facets, places = rng.normal(size=n) * 3.0, rng.normal(size=n) * 20.0
    at = np.arange(n)
    a = np.stack(
        [
            10.0 * at + (places - facets[(at + s) % n] + 0.3 * rng.normal(size=n)) / 3600.0
            for s in shifts
        ]
    )
    b = np.stack([10.0 * ((at + s) % n) for s in shifts])
    found = ta.selfcal(
        {
            "run": np.repeat(np.arange(3), n),
            "indicated_deg": np.mod(a, 360.0).ravel(),
            "reference_deg": b.ravel(),
            "shift_deg": np.repeat(shifts, n) * 10.0,
        }
    )
    design = np.zeros((3 * n, 2 * n + 3))
    for j, s in enumerate(shifts):
        for i in range(n):
            design[j * n + i, [i, n + (i + s) % n, 2 * n + j]] = 1.0, -1.0, 1.0
    z = np.linalg.lstsq(design, ((a - 10.0 * at) * 3600.0).ravel(), rcond=1e-10)[0]
    by_numpy = np.std(z[:n] - places), np.std(z[n : 2 * n] - facets)
    mine = np.array(found.beside["positions_arcsec"]), np.array(found.beside["facets_arcsec"])
    assert np.std(mine[0] - places) < 1.01 * by_numpy[0]
    assert np.std(mine[1] - facets) < 1.01 * by_numpy[1]
    assert by_numpy[0] < 0.5  # the test's own: nothing is blind there


def dual_log(ratio, seed, sigma=5.0):
    print("seed", seed)
    rng = np.random.default_rng(seed)
    theta = np.linspace(0.3, 6.0 * np.pi + 0.3, 6000)
    motor = ratio * theta
    motor = motor + encoder(motor, {1: (60.0 * ratio, 0.5), 2: (30.0 * ratio, 1.5)})
    output = read(theta, {1: (100.0, 0.3), 2: (50.0, 1.0), 7: (40.0, 2.0)}, sigma, rng)
    return {
        "time_s": np.arange(6000) / 1000.0,
        "indicated_rad": np.mod(output, 2.0 * np.pi),
        "motor_rad": motor,
    }


@pytest.mark.parametrize("told", [True, False])
def test_a_broken_ratio_tells_all_orders(told):
    found = ta.selfcal(dual_log(7.3, 8300), gear_ratio=7.3 if told else None)
    amplitudes = {round(o.order, 3): o.amplitude for o in found.orders}
    want = {1.0: 100.0, 2.0: 50.0, 7.0: 40.0, 7.3: 60.0, 14.6: 30.0}
    assert set(amplitudes) == set(want)
    for order, size in want.items():
        assert amplitudes[order] == pytest.approx(size, abs=0.5)
    limit = 5.0 * np.sqrt(2.0 / 6000.0)
    assert all(o.std < 1.1 * limit for o in found.orders)
    assert {s.name for s in found.model.shafts} == {"output", "motor"}


def test_a_whole_ratio_gives_sums_with_both_names():
    found = ta.selfcal(dual_log(7.0, 8310), gear_ratio=7.0)
    seventh = next(o for o in found.orders if o.order == 7.0)
    assert "output 7" in seventh.of
    assert "motor 1" in seventh.of
    both = 40.0 * np.exp(1j * 2.0) - 60.0 * np.exp(1j * 0.5)
    assert seventh.amplitude == pytest.approx(abs(both), abs=0.5)
    assert any("one number" in b.because and 7.0 in b.orders for b in found.blind)


def test_a_joint_with_play_says_its_reversal_error(data_dir):
    found = ta.selfcal(data_dir / "haptic_joint_dual_encoder.csv")
    assert found.method == "dual"
    assert found.beside["gear_ratio"] == pytest.approx(7.295, abs=0.01)
    # Over 125 deg higher orders move it on and on: its error says so.
    measured, std = found.beside["gear_ratio_measured"], found.beside["gear_ratio_std"]
    assert abs(measured - 7.295) < 4.0 * std
    assert abs(found.beside["reversal_error_arcsec"]) > 300.0
    test = found.held_out["halves"]
    assert test.rms_after < test.rms_before
    assert not {1.0, 2.0} & {o.order for o in found.orders}  # 125 degrees of travel
