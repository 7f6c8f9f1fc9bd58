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


def test_the_page_says_when_each_unit_is_due(tmp_path, capsys):
    """A unit whose order 1 grows over four dates is due first and has its chart drawn."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED + 1)
    theta = np.linspace(0.0, 360.0, READINGS, endpoint=False)
    lines = ["unit,when,reference_deg,indicated_deg"]
    for unit in range(8):
        size = rng.normal(100.0, 15.0)
        for month in (1, 3, 5, 7):
            size += 12.0 * (unit == 3)
            error = size * np.sin(np.radians(theta)) + rng.normal(0.0, 2.0, theta.size)
            lines += [
                f"SN{unit},2026-{month:02d}-10,{x!r},{x + e / 3600.0!r}"
                for x, e in zip(theta.tolist(), error.tolist(), strict=True)
            ]
    (tmp_path / "units.csv").write_text("\n".join(lines) + "\n")
    page = str(tmp_path / "f.html")
    command = ["report", str(tmp_path / "units.csv"), "-o", page]
    assert main([*command, "--fleet", "--permitted-arcsec", "60", "--orders", "1-2"]) == 0
    assert "SN3" in capsys.readouterr().out
    text = text_of((tmp_path / "f.html").read_text("utf-8"))
    history = text[text.index("next calibration") :]
    assert re.findall(r"(SN\d) 2026-07-10", history)[0] == "SN3"
    assert len(re.findall(r"SN\d 2026-07-10", history)) == 8
    assert "SN3: cumulative sums of its orders" in history
    assert "(extrapolated)" in history
    assert main([*command, "--permitted-arcsec", "60"]) == 1
    assert "add --fleet" in capsys.readouterr().err
