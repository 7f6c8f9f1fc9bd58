"""Held-out errors are those of models that never saw the run, each run about its own zero."""

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import heldout as extended
from trueangle.fitting import fitdata
from trueangle.fitting.heldout import folds, hold_out
from trueangle.fitting.phases import run_phases

#: Arcsec in a degree, and rounding of errors of some degrees.
ARCSEC, ROUNDING = 3600.0, 1e-6


def some_runs(count=4, seed=1, zeros=0.0, wild=0.0, n=240):
    """Order 1 of 0.2 deg and noise, zeros of the encoder, outliers."""
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(count):
        x = np.sort(rng.uniform(0.0, 360.0, n))
        error = 0.2 * np.sin(np.radians(x + 30.0)) + 0.01 * rng.normal(size=n)
        if wild:
            hit = rng.random(n) < wild
            error[hit] += rng.uniform(0.05, 0.2, int(hit.sum()))
        indicated = x + error + zeros * (i - 1.5)
        runs.append(ta.CalibrationRun(x, indicated, 360.0, label=f"r{i}"))
    return runs


def others(runs, i):
    return [run for j, run in enumerate(runs) if j != i]


def about_its_mean(error):
    """Arcsec about the direction of the mean, by complex numbers."""
    turned = np.exp(1j * np.radians(error))
    return np.degrees(np.angle(turned / turned.mean())) * ARCSEC


@pytest.mark.parametrize("options", [{}, {"loss": "huber"}, {"argument": "indicated"}])
def test_each_run_is_corrected_by_a_fit_of_the_others(options):
    runs = some_runs(zeros=0.5, wild=0.15 if "loss" in options else 0.0)
    held = hold_out(ta.fit(runs, orders=[1, 2], **options))
    assert [run.label for run in held.runs] == ["r0", "r1", "r2", "r3"]
    for i, found in enumerate(held.runs):
        own = ta.fit(others(runs, i), orders=[1, 2], **options).model
        assert found.model.shafts == own.shafts
        assert found.model.argument == own.argument
        run = runs[i]
        np.testing.assert_allclose(
            found.before, about_its_mean(run.indicated - run.reference), atol=ROUNDING
        )
        corrected = own.correct(run.indicated)
        np.testing.assert_allclose(
            found.after, about_its_mean(corrected - run.reference), atol=ROUNDING
        )
    # Another loss or angle is another model, by more than any rounding.
    plain = ta.fit(runs[1:], orders=[1, 2]).model
    same = plain.argument == held.runs[0].model.argument and np.allclose(
        plain.shafts[0].cosine, held.runs[0].model.shafts[0].cosine, rtol=1e-6
    )
    assert same == (not options)


def test_zeros_of_the_runs_are_no_error():
    near, far = (hold_out(ta.fit(some_runs(zeros=z), orders=[1])) for z in (0.0, 0.3))
    assert far.rms_before == pytest.approx(near.rms_before, rel=1e-6)
    # A pattern read half a degree off is another by a hundredth.
    assert far.rms_after == pytest.approx(near.rms_after, rel=0.05)
    # 0.2 deg of order 1 and the noise.
    assert near.rms_before == pytest.approx(ARCSEC * np.hypot(0.2 / np.sqrt(2), 0.01), rel=0.05)
    assert near.rms_after == pytest.approx(ARCSEC * 0.01, rel=0.1)


@pytest.mark.parametrize("orders", [None, [1]])
def test_fits_that_only_correct_estimate_no_uncertainty(orders, monkeypatch):
    fit = ta.fit(some_runs(), orders)
    wanted, phases = fit.model.amplitudes, fit.model.phases
    monkeypatch.setattr(fitdata, "coefficient_uncertainty", None)
    assert hold_out(fit).reduction > 0.5
    found = run_phases(fit)
    for line, amplitude, phase in zip(found, wanted, phases, strict=True):
        assert line.amplitude.mean() == pytest.approx(3600.0 * amplitude, rel=0.1)
        assert line.phase.mean() == pytest.approx(phase, abs=0.1)


@pytest.mark.parametrize(("seed", "amplitude"), [(0, 0.0035), (2, 0.005), (3, 0.004)])
def test_orders_are_chosen_anew_without_the_run(seed, amplitude):
    """Order 7 is so small that it takes all runs to see it."""
    rng = np.random.default_rng(seed)
    runs = []
    for i in range(3):
        x = np.sort(rng.uniform(0.0, 360.0, 120))
        error = 0.2 * np.sin(np.radians(x + 30.0)) + amplitude * np.sin(np.radians(7.0 * x))
        indicated = x + error + 0.01 * rng.normal(size=x.size)
        runs.append(ta.CalibrationRun(x, indicated, 360.0, label=f"r{i}"))
    fit = ta.fit(runs, argument="reference")
    assert 7 in fit.orders
    held = hold_out(fit)
    for i, found in enumerate(held.runs):
        # The noise is that of all runs, which makes order 7 a little more or less probable.
        own = ta.fit(others(runs, i), argument="reference")
        assert {*found.model.orders} ^ {*own.orders} <= {7}
        half = 0.5 * own.amplitude_std[0]
        assert found.model.amplitudes[0] == pytest.approx(own.model.amplitudes[0], abs=half)
    assert any(7 not in found.model.orders for found in held.runs)


def test_the_reduction_and_its_interval_are_those_of_the_rms():
    rng = np.random.default_rng(8)
    runs = []
    for i, sigma in enumerate((0.01, 0.02, 0.03, 0.06, 0.08, 0.1)):
        x = np.sort(rng.uniform(0.0, 360.0, 200 + 80 * i))
        error = 0.2 * np.sin(np.radians(x)) + sigma * rng.normal(size=x.size)
        runs.append(ta.CalibrationRun(x, x + error, 360.0, label=f"{i}"))
    held = hold_out(ta.fit(runs, orders=[1], loss="linear"))
    before = np.array([np.sum(run.before**2) for run in held.runs])
    after = np.array([np.sum(run.after**2) for run in held.runs])
    assert held.reduction == pytest.approx(1.0 - np.sqrt(after.sum() / before.sum()), rel=1e-12)
    # Each reading counts alike, however long its run.
    readings = sum(map(len, runs))
    assert held.rms_before == pytest.approx(np.sqrt(before.sum() / readings), rel=1e-12)
    assert held.rms_after == pytest.approx(np.sqrt(after.sum() / readings), rel=1e-12)
    pick = rng.integers(6, size=(40_000, 6))
    draws = 1.0 - np.sqrt(after[pick].sum(axis=1) / before[pick].sum(axis=1))
    low, high = np.quantile(draws, [0.025, 0.975])
    found = held.reduction_interval
    # 2000 resamples know their own 2.5 % to a twentieth of the width.
    assert found == pytest.approx((low, high), abs=0.05 * (high - low))
    assert low < held.reduction < high


@pytest.mark.parametrize(("count", "most"), [(2, 5), (7, 5), (30, 12)])
def test_every_run_is_left_out_once(count, most):
    parts = folds(count, most)
    assert len(parts) == min(count, most)
    assert sorted(i for part in parts for i in part) == list(range(count))


@pytest.mark.parametrize("count", [3, 5])
def test_causes_and_model_come_from_the_other_runs(count, monkeypatch):
    """Neither the diagnosis nor the fit behind the correction is given the run held out."""
    runs = some_runs(count)
    fit = ta.fit(runs, orders=[1])
    seen = []

    def diagnose(train, sim, **options):
        def correction(model, given):
            seen.append((list(train), list(given)))
            return ta.fit(given, orders=[1]).model

        return SimpleNamespace(correction=correction)

    monkeypatch.setattr(extended, "diagnose", diagnose)
    held = extended.hold_out_extended(fit, None)
    assert len(held.runs) == count
    for part, (train, given) in zip(folds(count, extended.MOST_DIAGNOSES), seen, strict=True):
        left = [runs[i] for i in range(count) if i not in part]
        for used in (train, given):
            assert [id(run) for run in used] == [id(run) for run in left]
    for found, run in zip(held.runs, runs, strict=True):
        assert found.run is run
        np.testing.assert_allclose(
            found.before, about_its_mean(run.indicated - run.reference), atol=ROUNDING
        )
        assert 0.0 < found.after.std() < 0.2 * found.before.std()
