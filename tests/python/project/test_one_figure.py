"""One order has one amplitude, phase and uncertainty, with one count of digits, wherever shown."""

from __future__ import annotations

import html
import re
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.certificate import Identity, certify
from trueangle.simulation import Harmonic, RunDesign, Simulation
from trueangle.support.display_units import error_unit, rounded_phase

ARCSEC = 3600.0

JOINT = Simulation(
    harmonics=(Harmonic("output", 1, 60.0, 151.3), Harmonic("output", 3, 40.0, 264.3)),
    sigma_arcsec=5.0,
    runs=tuple(RunDesign(label=f"{n}", samples=200) for n in range(8)),
)

#: A diagnosis estimates noise and causes jointly, on some of the readings: by so many standard
#: errors its amplitudes may differ.
APART = 4.0


@pytest.fixture(scope="module", params=["simulated", "rm44"])
def runs(request):
    if request.param == "simulated":
        return ta.simulate(JOINT, seed=33)
    return ta.read_runs(request.getfixturevalue("data_dir") / "rm44_repeat.csv")


@pytest.fixture(scope="module")
def fit(runs):
    return ta.fit(runs)


def shown(fit) -> dict[float, tuple[str, str, str, str]]:
    """Amplitude, +-, phase, +- of each order as they have to stand everywhere."""
    unit = error_unit("arcsec")
    return {
        float(order): (
            *unit.pair(ARCSEC * fit.amplitudes[n], ARCSEC * fit.amplitude_std[n]),
            *rounded_phase(np.degrees(fit.phases[n]), np.degrees(fit.phase_std[n])),
        )
        for n, order in enumerate(fit.orders)
    }


def rows_of(text: str, before: str) -> dict[float, tuple[str, ...]]:
    """The four figures behind the order in the lines of a table."""
    number = r"(-?[\d.]+)"
    line = rf"^ +{before}{number} +{number} +{number} +{number} +{number}\b"
    return {float(row[0]): row[1:] for row in re.findall(line, text, flags=re.M)}


def test_fit_and_orders_print_the_same(runs, fit) -> None:
    expected = shown(fit)
    assert rows_of(fit.summary("arcsec"), "output +") == expected
    for selection in (ta.select_orders(runs), fit.selection):
        found = rows_of(selection.summary("arcsec"), "")
        assert {k: found[k] for k in expected} == expected
        assert set(expected) == set(map(float, selection.orders))


def test_the_report_prints_the_same_in_both_tables(runs, fit) -> None:
    page = html.unescape(ta.report(runs, errors_in="arcsec").html)
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row) for row in page.split("<tr")]
    plain = [[re.sub(r"<[^>]+>", "", cell) for cell in row] for row in cells]
    for order, figures in shown(fit).items():
        wanted = list(figures)
        told = [row for row in plain if f"{order:g}" in row[:2] and wanted[0] in row]
        assert len(told) == 2, (order, told)
        for row in told:
            at = row.index(wanted[0])
            assert row[at : at + 4] == wanted


def test_the_certificate_expands_the_same(runs, fit) -> None:
    made = certify(runs, Identity("1", "joint")).content["harmonics"]
    assert len(made) == len(fit.orders)
    for n, row in enumerate(made):
        assert row["amplitude_arcsec"] == pytest.approx(ARCSEC * fit.amplitudes[n], rel=1e-12)
        assert row["phase_deg"] == pytest.approx(np.degrees(fit.phases[n]) % 360.0, rel=1e-12)
        # One coverage factor for amplitude and phase of all orders.
        k = row["amplitude_expanded_arcsec"] / (ARCSEC * fit.amplitude_std[n])
        assert 1.9 < k < 2.7
        assert row["phase_expanded_deg"] == pytest.approx(k * np.degrees(fit.phase_std[n]))


def test_a_diagnosis_has_the_same_unit_convention_and_digits(runs, fit) -> None:
    sim = replace(JOINT, harmonics=())
    found = ta.diagnose(runs, sim, gain=False)
    # Without readings no further runs are planned, which takes ten times as long as the rest.
    text = replace(found, runs=[]).summary("arcsec", verbose=True)
    at = {float(order): n for n, order in enumerate(fit.orders)}
    told = 0
    for finding in found.findings:
        if finding.cause != "missing_order":
            continue
        values = finding.parameters
        n = at[values["output_order"].value]
        size, phase = values["amplitude_arcsec"], values["phase_deg"]
        assert size.value == pytest.approx(
            ARCSEC * fit.amplitudes[n],
            abs=APART * np.hypot(size.std, ARCSEC * fit.amplitude_std[n]),
        )
        assert 0.0 <= phase.value < 360.0
        for name, (value, std) in {
            "amplitude_arcsec": error_unit("arcsec").pair(size.value, size.std),
            "phase_deg": rounded_phase(phase.value, phase.std),
        }.items():
            assert f"{name}: {value} +- {std}" in text
        told += 1
    assert told >= 2


def test_eight_runs_that_repeat_tell_the_noise() -> None:
    """A fast line of a new phase in every run moves no low order: it is not noise of them."""
    rng = np.random.default_rng(33)
    theta = np.arange(0.0, 360.0, 0.72)
    runs = []
    for _ in range(12):
        fast = 0.015 * np.sin(np.radians(151.0 * theta) + rng.uniform(0.0, 6.28))
        error = 0.1 * np.sin(np.radians(theta)) + fast + rng.normal(0.0, 0.005, theta.size)
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
    estimates = [ta.fit([run], orders=[1]).amplitudes[0] for run in runs]
    scatter = np.std(estimates, ddof=1) / np.sqrt(12)
    told = ta.fit(runs, orders=[1]).amplitude_std[0]
    white = ta.fit(runs, orders=[1], covariance="white").amplitude_std[0]
    # Twelve estimates tell their scatter to about a fifth.
    assert told == pytest.approx(scatter, rel=0.6)
    assert white > 1.8 * told
    # Of few runs it is known less well; of copies the residual stays the noise.
    few = [ta.fit(runs[:4], orders=[1], covariance=kind) for kind in ("auto", "white")]
    assert told < few[0].amplitude_std[0] < few[1].amplitude_std[0]
    assert ta.fit(runs[:1] * 8, orders=[1]).uncertainty.kind == "white"
