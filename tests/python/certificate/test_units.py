"""The unit of a certificate: what is printed is the content in that unit, value and U alike."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.certificate import Identity, certify, typesetting
from trueangle.errors import ArgumentError
from trueangle.support.display_units import error_unit

typst = pytest.importorskip("typst")

#: Sign of a unit in the heads of tables, and how it is asked for.
UNITS = {"auto": "°", "arcsec": "″", "deg": "°", "mrad": "mrad", 65536: "count"}


@pytest.fixture(scope="module")
def runs() -> list[ta.CalibrationRun]:
    """Two degrees of order 1, over a travel that crosses zero."""
    rng = np.random.default_rng(20261122)
    theta = np.arange(-100.0, 101.0, 5.0)
    error = 2.0 * np.sin(np.radians(theta))
    return [
        ta.CalibrationRun(theta % 360.0, theta % 360.0 + error + rng.normal(0.0, 1e-3, 41), 360.0)
        for _ in range(3)
    ]


def texts(element: object) -> str:
    """All text below an element of a typeset document."""
    if isinstance(element, list):
        return "".join(map(texts, element))
    if not isinstance(element, dict):
        return ""
    if element.get("func") == "space":
        return " "
    return str(element.get("text", "")) + "".join(
        texts(element.get(part)) for part in ("body", "children", "child")
    )


def tables(content: dict, folder: Path) -> list[list[str]]:
    """Cells of every table as they are printed."""
    file = typesetting.lay_out(content, folder)
    found = json.loads(typst.query(str(file), "table", root=str(folder)))
    cells = []
    for table in found:
        parts = [
            cell
            for child in table["children"]
            for cell in (child["children"] if child["func"] == "header" else [child])
        ]
        cells.append([texts(cell) for cell in parts if cell["func"] == "cell"])
    return cells


@pytest.mark.parametrize("asked", UNITS)
def test_value_and_u_are_printed_in_one_unit(asked, runs, tmp_path: Path) -> None:
    content = certify(runs, Identity("1", "joint"), orders=[1], errors_in=asked).content
    shown = error_unit("deg" if asked == "auto" else asked, period=360.0)
    _, values, budget, harmonics, *_ = tables(content, tmp_path)
    sign = UNITS[asked]
    for cells in (values, budget, harmonics):
        assert any(f"/ {sign}" in cell for cell in cells)
    rows = content["positions"]
    largest = shown.per_arcsec * max(row["expanded_arcsec"] for row in rows)
    for row in rows:
        place = values.index(f"{row['angle_deg']:.0f}".replace("-", "\N{MINUS SIGN}"))
        error, expanded, k = (
            float(cell.replace("\N{MINUS SIGN}", "-")) for cell in values[place + 1 : place + 4]
        )
        # Rounded to two digits of the greatest U.
        assert error == pytest.approx(shown.per_arcsec * row["error_arcsec"], abs=0.05 * largest)
        assert expanded == pytest.approx(
            shown.per_arcsec * row["expanded_arcsec"], abs=0.05 * largest
        )
        assert k == pytest.approx(row["coverage_factor"], abs=0.0051)
    at = next(n for n, cell in enumerate(budget) if cell.startswith("expanded"))
    printed = shown.per_arcsec * content["budget"]["expanded_arcsec"]
    assert float(budget[at + 3]) == pytest.approx(printed, rel=0.051)
    order = harmonics.index("1")
    amplitude = shown.per_arcsec * content["harmonics"][0]["amplitude_arcsec"]
    assert float(harmonics[order + 1]) == pytest.approx(amplitude, rel=0.01)


def test_the_content_is_the_same_in_every_unit(runs) -> None:
    made = [
        certify(runs, Identity("1", "joint"), orders=[1], errors_in=asked).content
        for asked in ("arcsec", "mrad")
    ]
    assert made[0]["errors_in"] == {"unit": "arcsec", "per_arcsec": 1.0}
    for name in ("positions", "budget", "harmonics", "readings"):
        assert made[0][name] == made[1][name]
    with pytest.raises(ArgumentError, match="`counts_per_turn="):
        certify(runs, Identity("1", "joint"), orders=[1], errors_in="count")


def test_a_travel_across_zero_stands_about_zero(runs) -> None:
    """As in the notes and pictures: not as 260 to 460 degrees."""
    rows = certify(runs, Identity("1", "joint"), orders=[1]).content["positions"]
    assert [row["angle_deg"] for row in rows] == pytest.approx(np.arange(-100.0, 101.0, 10.0))


def test_a_phase_that_nothing_tells_is_not_printed(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    theta = np.arange(0.0, 360.0, 10.0)
    runs = [ta.CalibrationRun(theta, theta + rng.normal(0.0, 1e-3, 36), 360.0) for _ in range(2)]
    content = certify(runs, Identity("1", "joint"), orders=range(1, 17)).content
    unknown = [row for row in content["harmonics"] if row["phase_expanded_deg"] >= 180.0]
    assert {row["phase_expanded_deg"] for row in unknown} == {180.0}  # half a turn: any phase
    harmonics = tables(content, tmp_path)[3]
    assert harmonics.count("\N{EN DASH}") == 2 * len(unknown)
    # Sixteen rows stand in two blocks of six columns.
    assert harmonics.count("shaft") == 2
