"""The unit of a page's errors: chosen by their size, the same everywhere on the page."""

from __future__ import annotations

import html
import json
import re

import numpy as np
import pytest

import trueangle as ta
from plots.strokes import strokes
from trueangle.cli import main
from trueangle.errors import ArgumentError

from .test_report import page_numbers, written

#: Words that stay: the JSON of the page is in arcsec.
SAID = "errors in arcsec"


def text_of(page: str) -> str:
    """What a reader sees, without scripts and style."""
    bare = re.sub(r"<(script|style|pre).*?</\1>", "", page, flags=re.S)
    return html.unescape(re.sub(r"<[^>]+>", " ", bare))


def labels(made) -> list[str]:
    """Titles of all axes and of charts, and texts shown by hovering."""
    found = []
    for figure in made.figures.values():
        found.append(figure["alt"])
        for chart in figure["charts"]:
            found += [chart["title"], *(entry["label"] for entry in chart["legend"])]
            found += [chart["x"]["title"], chart["y"]["title"]]
            found += [name["text"] for name in chart["names"]]
            found += [drawn.title for drawn in strokes(chart)]
    return found


def test_large_errors_are_in_degrees_everywhere(large) -> None:
    assert large.content["errors_in"]["unit"] == "deg"
    # The simulation that is offered for saving has the names of its format.
    assert "arcsec" not in text_of(large.html).replace(SAID, "")
    assert not [label for label in labels(large) if "arcsec" in label]
    assert any("/ deg" in label for label in labels(large))


def test_small_errors_are_in_arcsec(made) -> None:
    assert made.content["errors_in"]["unit"] == "arcsec"
    assert "residual / arcsec" in labels(made)


@pytest.mark.parametrize(("asked", "unit", "turn"), [
    ("mrad", "mrad", 2000.0 * np.pi), ("deg", "deg", 360.0), (65536.0, "count", 65536.0),
])  # fmt: skip
def test_a_page_is_written_in_the_unit_asked_for(runs, asked, unit, turn) -> None:
    page = ta.report(runs[:3], orders=[1], errors_in=asked)
    assert page.content["errors_in"]["unit"] == unit
    plain = ta.report(runs[:3], orders=[1])
    # The content stays in arcsec; what is shown and drawn is in the unit.
    assert page.content["measured"] == plain.content["measured"]
    per = turn / 1_296_000.0
    for path, factor, digits, text in page_numbers(page.html):
        assert factor == pytest.approx(per if path.endswith("_arcsec") else 1.0)
        assert text == written(page.content, path, factor, digits)
    here, there = (p.figures["before-after"]["charts"][0]["y"]["limits"] for p in (page, plain))
    np.testing.assert_allclose(here, per * np.array(there))


def test_numbers_are_rounded_to_their_uncertainty(large) -> None:
    shown = {path: text for path, _, _, text in page_numbers(large.html)}
    for i, row in enumerate(large.content["model"]["coefficients"]):
        at = f"model.coefficients.{i}."
        value, std = shown[at + "amplitude_arcsec"], shown[at + "amplitude_std_arcsec"]
        assert len(value.partition(".")[2]) == len(std.partition(".")[2])
        assert len(std.replace(".", "").lstrip("0")) == 2, std
        assert float(std) == pytest.approx(row["amplitude_std_arcsec"] / 3600.0, rel=0.051)


def test_counts_without_their_number_are_refused(runs, tmp_path) -> None:
    with pytest.raises(ArgumentError, match="counts of a turn"):
        ta.report(runs[:1], orders=[1], errors_in="count")
    with pytest.raises(ArgumentError, match="errors_in must be one of"):
        ta.report(runs[:1], orders=[1], errors_in="furlong")


def test_the_command_takes_the_unit(runs, tmp_path, capsys) -> None:
    rows = ["reference_deg,indicated_deg"]
    rows += [f"{a!r},{b!r}" for a, b in zip(runs[0].reference.tolist(), runs[0].indicated.tolist(),
                                           strict=True)]  # fmt: skip
    file, page = tmp_path / "joint.csv", tmp_path / "report.html"
    file.write_text("\n".join(rows) + "\n")
    arguments = ["report", str(file), "-o", str(page), "--orders", "1", "--errors-in", "mrad"]
    assert main([*arguments, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["errors_in"]["unit"] == "mrad"
    assert "mrad rms" in text_of(page.read_text("utf-8"))


def test_findings_of_one_cause_have_names_of_their_own(large) -> None:
    findings = large.content["diagnosis"]["findings"]
    names = [finding["name"] for finding in findings]
    assert sum(finding["cause"] == "missing_order" for finding in findings) > 1
    assert len(set(names)) == len(names)
    assert "periodic error: stepper 1" in names
    (chart,) = large.figures["error-left"]["charts"]
    named = [text for _, text in chart["y"]["ticks"]]
    assert len(set(named)) == len(named) > 2
