"""The page of a fleet holds what the fleet says, and needs neither script nor network."""

import json
import re
from html import unescape

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.reports.fleet import FleetReport

pytest.importorskip("jinja2")

SEED = 71_203

#: Units of the fleet, readings of each, and standard deviation of one, arcsec.
UNITS, READINGS, SIGMA = 12, 60, 5.0


@pytest.fixture(scope="module")
def rows():
    """Twelve units; the last has four times the order 2 of the others."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    theta = np.linspace(0.0, 360.0, READINGS, endpoint=False)
    lines = ["unit,reference_deg,indicated_deg"]
    for unit in range(UNITS):
        a, b = rng.normal(0.0, 60.0, 2)
        size = 400.0 if unit == UNITS - 1 else 100.0 + rng.normal(0.0, 15.0)
        error = a * np.cos(np.radians(theta)) + b * np.sin(np.radians(theta))
        error += size * np.sin(np.radians(2.0 * theta + 40.0)) + rng.normal(0.0, SIGMA, theta.size)
        lines += [
            f"SN{unit:02d},{x!r},{x + e / 3600.0!r}"
            for x, e in zip(theta.tolist(), error.tolist(), strict=True)
        ]
    return "\n".join(lines) + "\n"


def text_of(page: str) -> str:
    body = re.sub(r"<style>.*?</style>", "", page, flags=re.S)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", body)).split())


def test_the_command_writes_what_the_fleet_says(rows, tmp_path, capsys):
    (tmp_path / "units.csv").write_text(rows)
    command = ["report", str(tmp_path / "units.csv"), "--fleet", "-o", str(tmp_path / "f.html")]
    assert main([*command, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found == ta.fleet(tmp_path / "units.csv").to_dict()
    page = (tmp_path / "f.html").read_text("utf-8")
    text = text_of(page)
    worst = found["units"][0]
    assert worst["unit"] == f"SN{UNITS - 1:02d}"
    assert f"SN{UNITS - 1:02d} , outlier: order 2" in text
    assert f"{UNITS} units, 1 that needs something." in text
    assert page.count('<figure role="img"') == UNITS + min(3, len(found["between"]["orders"]))
    assert "<script" not in page
    assert "http://" not in page.replace("http://www.w3.org/2000/svg", "")


def test_every_unit_has_its_row_in_the_units_of_the_page(rows, tmp_path):
    path = tmp_path / "units.csv"
    path.write_text(rows)
    fleet = ta.fleet(path)
    made = FleetReport(fleet, "Twelve", "mrad")
    text = text_of(made.html)
    for unit in fleet.units:
        size = np.radians(unit.peak_to_peak) * 1e3
        row = re.search(rf"{unit.unit} {unit.verdict} ([\d.]+)", text)
        assert float(row[1]) == pytest.approx(size, rel=1e-3)
    assert "Twelve" in text
    assert made.to_dict() == fleet.to_dict()
    made.save(tmp_path / "page.html")
    with pytest.raises(ta.errors.FileError):
        made.save(tmp_path / "page.csv")


@pytest.mark.parametrize("other", ["--simulation", "--certificate", "--model", "--robot"])
def test_what_is_of_one_unit_is_refused(other, rows, tmp_path, capsys):
    (tmp_path / "units.csv").write_text(rows)
    (tmp_path / "x.toml").write_text("")
    command = ["report", str(tmp_path / "units.csv"), "--fleet", "-o", str(tmp_path / "f.html")]
    assert main([*command, other, str(tmp_path / "x.toml")]) != 0
    assert "--fleet is a report on many units" in capsys.readouterr().err
    assert not (tmp_path / "f.html").exists()
