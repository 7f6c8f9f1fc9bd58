"""Causes of the scatter as findings, and what is told of them where they are in doubt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trueangle.diagnosis.confirmation import CONFIRMED, NOT_CONFIRMED
from trueangle.diagnosis.findings import equal_scatter, scatter_doubt, scatter_finding
from trueangle.diagnosis.penalty import NEW_CAUSE
from trueangle.effects.effect import ScatterFinding
from trueangle.estimation.quantity import quantity
from trueangle.runs.checks.fault import DataFault

from .test_findings_made import CALM, MORE


def scatter(**changes: object) -> ScatterFinding:
    item = ScatterFinding(
        "heteroscedastic_noise", 33.0, {"cosine": quantity(0.5, 0.1)}, [], np.ones(3)
    )
    return replace(item, **changes)


def test_scatter_is_told_with_its_evidence_and_its_doubt() -> None:
    rivals = (("timestamp_jitter", 9.0), ("outliers", 20.0))
    told = scatter_finding(scatter(rivals=rivals), CALM)
    assert (told.status, told.reason, told.gain) == (CONFIRMED, "", None)
    assert told.evidence == {"bic_gain": 33.0}
    assert told.rivals == [*rivals]
    assert told.parameters["cosine"].value == 0.5
    doubted = scatter_finding(scatter(doubt="of two runs"), CALM)
    assert (doubted.status, doubted.reason) == (NOT_CONFIRMED, "of two runs")
    assert scatter_finding(scatter(), MORE).status == NOT_CONFIRMED


def test_scatter_that_others_explain_as_well_is_none_of_them() -> None:
    """From 20 to 1 on the best one is; those behind by less are all named, with their sizes."""
    jitter = {"sigma_s": quantity(1e-4, 1e-5)}
    near, far = NEW_CAUSE - 0.01, NEW_CAUSE
    assert equal_scatter(scatter()) is None
    assert equal_scatter(scatter(rivals=(("timestamp_jitter", far),))) is None
    item = scatter(
        rivals=(("timestamp_jitter", near), ("outliers", far)),
        alternatives={"timestamp_jitter": jitter},
    )
    spot = equal_scatter(item)
    assert spot is not None
    assert spot.causes == ("heteroscedastic_noise", "timestamp_jitter")
    assert spot.because == (
        "they explain the scatter of these readings equally well (BIC: timestamp_jitter 6.0 less "
        "than heteroscedastic_noise)"
    )
    assert (spot.evidence, spot.supported) == (33.0, True)
    assert spot.estimates == {
        "heteroscedastic_noise": item.parameters, "timestamp_jitter": jitter,
    }  # fmt: skip
    assert spot.measure == "three speeds, from rest to the fastest"


def test_scatter_of_readings_in_doubt_is_in_doubt_itself() -> None:
    spot = scatter_doubt(scatter())
    assert (spot.causes, spot.supported) == (("heteroscedastic_noise",), True)
    assert spot.evidence == 33.0
    assert "has no certain cause yet" in spot.because
    fault = DataFault("stale_samples", ("a",), (3,), "three alike", "leave them out")
    spot = scatter_doubt(scatter(), fault)
    assert spot.because.startswith("stale_samples: the faulty readings cause")
    assert spot.measure == "leave them out; then diagnose again"
    assert spot.evidence == 33.0
