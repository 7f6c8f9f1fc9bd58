"""The table of targets, measured: ``python -m tests.python.selfcal.exam [--seeds 40]``.

Every row prints what was measured on seeds that nothing was tuned on; rows on measured data
need them beside the repository (or in TRUEANGLE_DATA).
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve()
sys.path.insert(0, str(HERE.parents[1]))

import trueangle as ta  # noqa: E402
from selfcal.rotor import ARCSEC, coast, coefficients, encoder, held_by_loop  # noqa: E402

LINES = {1: (300.0, 0.3), 2: (150.0, 1.0), 4: (50.0, 2.0)}
FIRST = 910_000  # seeds begin here
DATA = Path(os.environ.get("TRUEANGLE_DATA", HERE.parents[4] / "shared" / "data"))


def log(t, theta, rng, sigma=20.0, lines=LINES):
    reading = theta + encoder(theta, lines) + sigma * ARCSEC * rng.normal(size=t.size)
    return {"time_s": t, "indicated_rad": np.mod(reading, 2.0 * np.pi)}


def many(seeds, make, lines=LINES, **options):
    errors, stds = [], []
    for seed in range(FIRST, FIRST + seeds):
        rng = np.random.default_rng(seed)
        found = ta.selfcal(make(rng), orders=list(lines), loop="open", **options)
        errors.append([v for o in found.orders for v in (o.cosine, o.sine)] - coefficients(lines))
        stds.append([o.std for o in found.orders for _ in (0, 1)])
    errors, stds = np.array(errors), np.array(stds)
    rms = np.sqrt((errors**2).mean(axis=0).reshape(-1, 2).mean(axis=1))
    inside = (np.abs(errors) < 2.0 * stds).mean(axis=0).reshape(-1, 2).mean(axis=1)
    return rms, stds.mean(axis=0)[::2], inside


def show(name, rms, std, inside):
    print(f"{name}: rms {rms.round(3)}, stated {std.round(3)}, inside two {inside.round(3)}")


def limit(seeds):
    t, theta = coast(10.0, 2.0, 20.0)
    found = many(seeds, lambda rng: log(t, theta, rng), ripple="none")
    show("spin-down, limit 0.200", *found)
    print(f"  rms of all over the limit: {np.sqrt((found[0] ** 2).mean()) / 0.2:.3f}")
    show("  with ripple weighed", *many(seeds, lambda rng: log(t, theta, rng)))


def ripple(seeds):
    size = 200.0 * ARCSEC * (2.0 * np.pi * 4.47) ** 2
    t, theta = coast(10.0, 2.0, 20.0, ripple={1: size}, steps=2)
    show("ripple of 200 arcsec at order 1", *many(seeds, lambda rng: log(t, theta, rng)))


def wander(seeds):
    def make(rng):
        return log(*coast(10.0, 2.0, 20.0, wander=0.5, rng=rng, steps=1), rng)

    show("wandering friction", *many(seeds, make, ripple="none"))


def one_speed(seeds):
    size = 200.0 * ARCSEC * (2.0 * np.pi * 5.0) ** 2
    t, theta = coast(5.0, 5.0, 8.0, ripple={1: size}, steps=2)
    said = 0
    for seed in range(FIRST, FIRST + seeds):
        found = ta.selfcal(
            log(t, theta, np.random.default_rng(seed)), orders=[1, 2, 4], loop="open"
        )
        named = [b for b in found.blind if 1.0 in b.orders and "encoder or ripple" in b.because]
        said += bool(named) and 1.0 not in [o.order for o in found.orders]
    print(f"one speed with ripple, 'encoder or ripple': {said} of {seeds}")


def loop(seeds):
    said = 0
    for seed in range(FIRST, FIRST + seeds):
        rng = np.random.default_rng(seed)
        bandwidth = rng.uniform(2.0, 8.0)
        t, theta, _ = held_by_loop(rng.uniform(2.0, 5.0), bandwidth, 5.0, LINES)
        speed = theta[-1] / t[-1] / 2.0 / np.pi
        found = ta.selfcal(
            log(t, theta, rng), orders=[1, 2, 4], loop="closed", loop_bandwidth=bandwidth
        )
        below = {k for k in LINES if k * speed < 1.95 * bandwidth}
        said += not below & {o.order for o in found.orders}
    print(f"closed loop, orders below twice the bandwidth refused: {said} of {seeds}")


def closure(seeds):
    lines = {k: (300.0 / k, 0.7 * k) for k in range(1, 9)}
    other = {k: (200.0 / k, 1.3 * k) for k in range(1, 9)}
    shifts = np.radians([0.0, 84.4, 240.7])
    share = np.abs(np.exp(1j * shifts[:, None] * np.arange(1, 9)).mean(axis=0)) ** 2
    errors = []
    for seed in range(FIRST, FIRST + seeds):
        rng = np.random.default_rng(seed)
        parts = []
        for shift in shifts:
            theta = 2.0 * np.pi * (np.arange(512) + rng.uniform()) / 512
            a = theta + encoder(theta, lines) + 2.0 * ARCSEC * rng.normal(size=512)
            b = theta + shift + encoder(theta + shift, other)
            parts.append((a, b))
        table = {
            "run": np.repeat(np.arange(3), 512),
            "indicated_rad": np.mod(np.concatenate([a for a, _ in parts]), 2.0 * np.pi),
            "reference_rad": np.mod(np.concatenate([b for _, b in parts]), 2.0 * np.pi),
            "shift_deg": np.repeat(np.degrees(shifts), 512),
        }
        found = ta.selfcal(table, orders=range(1, 9))
        errors.append([v for o in found.orders for v in (o.cosine, o.sine)] - coefficients(lines))
    rms = np.sqrt((np.array(errors) ** 2).mean(axis=0).reshape(-1, 2).mean(axis=1))
    bound = 2.0 * np.sqrt(2.0 / 1536.0 / (1.0 - share))
    print(f"closure, rms over the limit, orders 1 to 8: {(rms / bound).round(2)}")


def measured():
    if not DATA.is_dir():
        print(f"no measured data at {DATA}")
        return
    path = DATA / "resolver_stepper.csv"
    run = ta.read_runs(path)[0]
    for orders in (range(1, 20), "auto"):
        found = ta.selfcal(path, orders=orders, loop="open")
        corrected = found.model.correct(np.unwrap(run.indicated, period=360.0))
        left = ta.wrap(corrected - run.reference, 360.0)
        left = ta.wrap(left - np.median(left), 360.0)
        fit = ta.fit([run], orders=range(1, 31))
        gaps = [
            abs(o.amplitude - 3600.0 * fit.amplitudes[int(o.order) - 1])
            for o in found.orders
            if o.order in (4, 8, 12, 16, 20, 24)
        ]
        print(
            f"resolver on a stepper, orders {orders}: {3600.0 * np.std(left):.0f} arcsec rms left, "
            f"orders 4 to 24 within {max(gaps):.1f} arcsec"
        )
    path = DATA / "rm44_repeat.csv"
    found = ta.selfcal(path, loop="closed", loop_bandwidth=1.2)
    fit = ta.fit(ta.read_runs(path), orders=range(1, 13))
    gaps = {}
    for o in found.orders:
        if o.order in (3, 4, 5):
            k = int(o.order)
            pair = complex(fit.model.shafts[0].cosine[k - 1], fit.model.shafts[0].sine[k - 1])
            turned = pair * np.exp(1j * np.radians(k * fit.model.constant))
            gaps[k] = round(abs(complex(o.cosine, o.sine) / 3600.0 - turned), 4)
    refused = sorted({k for b in found.blind for k in b.orders if k} & {1.0, 2.0})
    print(f"magnetic encoder in a loop: refused {refused}, vector errors in deg {gaps}")


def size():
    from trueangle.selfcalibration.recording import as_recordings
    from trueangle.selfcalibration.steady import Readings, fit_steady
    from trueangle.selfcalibration.stretches import cut_stretches

    lines = {k: (300.0 / k, float(k)) for k in range(1, 31)}
    t = np.arange(1_000_000) / 1000.0
    theta = 2.0 * np.pi * 6.0 * 900.0 * (1.0 - np.exp(-t / 900.0))
    table = log(t, theta, np.random.default_rng(FIRST), lines=lines)
    start, cpu = time.perf_counter(), time.process_time()
    fit = fit_steady(Readings(cut_stretches(as_recordings(table))), tuple(map(float, lines)))
    print(
        f"1e6 readings, 30 orders, {sum(fit.motion.knots.intervals)} knots: "
        f"{time.process_time() - cpu:.2f} s of processor, {time.perf_counter() - start:.2f} s, "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB at most"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument(
        "--rows", default="size,limit,ripple,one_speed,loop,closure,wander,measured"
    )
    args = parser.parse_args()
    for row in args.rows.split(","):
        work = globals()[row]
        work() if row in ("size", "measured") else work(args.seeds)
