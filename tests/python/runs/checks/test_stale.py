"""How many rows that repeat are a fault: from both sides of each bound."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.runs.checks.record import Record
from trueangle.runs.checks.still import stuck_readings

N = 400


def sweep(seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    reference = np.linspace(0.0, 300.0, N)
    return reference + 0.01 * rng.normal(size=N), reference + 0.01 * rng.normal(size=N)


def told(reference: np.ndarray, indicated: np.ndarray, **more) -> list[tuple[str, tuple[int, ...]]]:
    return [(f.fault, f.rows) for f in stuck_readings([Record("1", reference, indicated, **more)])]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("channel", ["indicated", "reference"])
@pytest.mark.parametrize(("times", "fault"), [(2, False), (3, True), (4, True)])
def test_three_rows_at_several_places(sign: float, channel: str, times: int, fault: bool) -> None:
    reference, indicated = sweep()
    own = indicated if channel == "indicated" else reference
    places = 50 + 70 * np.arange(times)
    own[places] = own[places - 1]
    expected = [("stale_samples", tuple((places + 1).tolist()))] if fault else []
    assert told(sign * reference, sign * indicated) == expected
    time = np.arange(N) * 0.1
    assert told(sign * reference, sign * indicated, time=time) == expected


@pytest.mark.parametrize(("rows", "fault"), [(9, False), (10, True), (14, True)])
def test_ten_rows_at_one_place(rows: int, fault: bool) -> None:
    reference, indicated = sweep()
    indicated[100 : 100 + rows] = indicated[99]
    expected = [("stale_samples", tuple(range(101, 101 + rows)))] if fault else []
    assert told(reference, indicated) == expected


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_column_at_its_limit_while_the_joint_goes_on(sign: float) -> None:
    reference = 100.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, N))
    rng = np.random.default_rng(2)
    reference = reference + 0.01 * rng.normal(size=N)
    indicated = np.minimum(reference + 0.01 * rng.normal(size=N), 80.0)
    (found,) = told(sign * reference, sign * indicated)
    assert found[0] == "saturated_travel"
    held = np.flatnonzero(indicated == 80.0)
    assert found[1] == tuple((held[1:] + 1).tolist())
    # A joint that rests there is no fault.
    rests = np.minimum(reference, 80.0)
    assert told(sign * rests, sign * (rests + 0.0)) == []
