"""Certificates: coverage of U, what the budget holds, the PDF, and wrong input."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.certificate import Budget, Contribution, Identity, certify, load_identity
from trueangle.errors import ArgumentError, FileError

from .joints import RIGS, Rig, covered

#: Joints a rig. The share of joints times positions inside U then has a standard error of
#: below 0.5 % (positions of a joint are correlated, some ten of them count as independent).
JOINTS = 200
#: U is of 95.45 %: the limits within which its share must lie, both ways.
SHARE = (0.94, 0.97)

IDENTITY = """
[certificate]
number = "TA-7"
item = "joint <a> #b & *c*"
laboratory = "Winkellabor \\"Süd\\""
operator = "A. Meier"
date = 2026-11-21
temperature_C = 20

[[contribution]]
name = "polygon"
type = "B"
distribution = "rectangular"
half_width_arcsec = 0.6
"""


@pytest.mark.parametrize("rig", RIGS, ids=lambda rig: rig.name)
def test_u_covers_what_it_says(rig: Rig) -> None:
    inside = np.array([covered(rig, 5000 + k) for k in range(JOINTS)])
    print(f"{rig.name}: seeds 5000 to {5000 + JOINTS - 1}, {100.0 * inside.mean():.2f} %")
    assert SHARE[0] <= inside.mean() <= SHARE[1]


#: Draws of a value and its budget, and the share of them known to 0.03 %.
DRAWS = 500_000
#: What the rule itself covers where Student's distribution of eight degrees of freedom meets a
#: normal one: as wide as the normal one, half of it, next to nothing of it.
RULE = {0.862: 0.9459, 0.5: 0.9500, 0.01: 0.9545}


@pytest.mark.parametrize("fitted", RULE)
def test_what_the_rule_of_welch_and_satterthwaite_covers(fitted: float) -> None:
    """At the ends of a partial travel fit and reference weigh alike: less than 95.45 % by rule."""
    rng = np.random.default_rng(20261122)
    freedom = 312
    scatter = fitted * np.sqrt(rng.chisquare(freedom, DRAWS) / freedom)
    error = fitted * rng.standard_normal(DRAWS) + rng.standard_t(8.0, DRAWS)
    # U depends on the scatter smoothly: a table of it is enough.
    known = np.linspace(scatter.min(), scatter.max(), 400)
    expanded = [
        Budget((Contribution("fit", u, "A", "t", freedom),
                Contribution("reference", 1.0, degrees_of_freedom=8.0))).expanded
        for u in known.tolist()
    ]  # fmt: skip
    share = np.mean(np.abs(error) <= np.interp(scatter, known, expanded))
    assert share == pytest.approx(RULE[fitted], abs=0.0012)


def _runs(noise: float = 1.0, extra: float = 0.0, seed: int = 3) -> list:
    rng = np.random.default_rng(seed)
    runs = []
    for _ in range(4):
        theta = np.concatenate([np.arange(0.0, 360.0, 2.5), np.arange(360.0, 0.0, -2.5)])
        error = 40.0 * np.sin(np.radians(theta + 20.0))
        error += extra * np.sin(np.radians(23.0 * theta)) + rng.normal(0.0, noise, theta.size)
        runs.append(ta.CalibrationRun(theta, theta + error / 3600.0, period=360.0))
    return runs


def _lines(made: object) -> dict[str, dict]:
    return {line["name"]: line for line in made.content["budget"]["lines"]}  # type: ignore[attr-defined]


def test_what_the_series_does_not_hold_enters_the_budget() -> None:
    who = Identity("1", "joint")
    plain = _lines(certify(_runs(), who, orders=[1]))
    missing = _lines(certify(_runs(extra=6.0), who, orders=[1]))
    name = "error that the series does not hold"
    assert plain[name]["standard_arcsec"] == 0.0
    # The rms of a sine of 6 arcsec.
    assert missing[name]["standard_arcsec"] == pytest.approx(6.0 / np.sqrt(2.0), rel=0.05)


def test_type_a_is_the_scatter_over_new_calibrations() -> None:
    # The slow way: calibrate 200 times; the values' scatter is what one certificate states.
    made = [certify(_runs(seed=900 + k), Identity("1", "joint"), orders=[1, 2]) for k in range(200)]
    values = np.array([[row["error_arcsec"] for row in m.content["positions"]] for m in made])
    stated = np.array([row["standard_arcsec"] for row in made[0].content["positions"]])
    ratio = float(np.median(stated / values.std(axis=0, ddof=1)))
    assert 0.9 < ratio < 1.1


def test_values_lie_where_they_are_asked_for() -> None:
    runs = _runs()
    angles = [
        row["angle_deg"]
        for row in certify(runs, Identity("1", "j"), orders=[1]).content["positions"]
    ]
    assert angles == pytest.approx(np.arange(0.0, 360.0, 10.0))
    few = certify(runs, Identity("1", "j"), orders=[1], positions=8).content["positions"]
    assert [row["angle_deg"] for row in few] == pytest.approx(np.arange(0.0, 360.0, 45.0))
    assert abs(sum(row["error_arcsec"] for row in few)) < 1e-9
    with pytest.raises(ArgumentError, match="whole number from 2 to 720"):
        certify(runs, Identity("1", "j"), orders=[1], positions=1)


def test_the_command_writes_a_pdf(tmp_path: Path) -> None:
    runs, identity = _files(tmp_path)
    out = tmp_path / "c.pdf"
    done = _trueangle(
        "report", runs, "--certificate", identity, "-o", out, "--orders", "1", "--json"
    )
    assert done.returncode == 0, done.stderr
    content = json.loads(done.stdout)
    assert content["identity"]["item"] == "joint <a> #b & *c*"
    assert content["not_stated"] == [
        *("serial", "manufacturer", "customer", "procedure", "reference"),
        *("reference_certificate", "place"),
    ]
    data = out.read_bytes()
    assert data.startswith(b"%PDF-")
    assert len(data) < 1_000_000
    assert 1 <= len(re.findall(rb"/Type\s*/Page\b", data)) <= 4
    assert b"pdfaid" in data


def test_an_existing_report_stays_when_the_identity_is_wrong(tmp_path: Path) -> None:
    runs, identity = _files(tmp_path)
    out = tmp_path / "c.pdf"
    out.write_text("old")
    identity.write_text(IDENTITY.replace("half_width_arcsec", "halfwidth_arcsec"))
    done = _trueangle("report", runs, "--certificate", identity, "-o", out)
    assert done.returncode == 1
    assert len(done.stderr.strip().splitlines()) == 1
    assert "identity.toml" in done.stderr
    assert "did you mean half_width_arcsec?" in done.stderr
    assert out.read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["c.pdf", "identity.toml", "runs.csv"]


@pytest.mark.parametrize("name", ["c.html", "runs.csv", "identity.toml"])
def test_a_certificate_goes_into_a_pdf_only(tmp_path: Path, name: str) -> None:
    runs, identity = _files(tmp_path)
    before = (runs.read_bytes(), identity.read_bytes())
    done = _trueangle("report", runs, "--certificate", identity, "-o", tmp_path / name)
    assert done.returncode == 1
    assert name in done.stderr
    assert before == (runs.read_bytes(), identity.read_bytes())


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("number =", "nummer ="), "did you mean number?"),
        (('number = "TA-7"', ""), "needs number"),
        (('item = "joint', 'item = 5 # "'), "item must be text"),
        (("C = 20", 'C = "warm"'), "temperature_C must be a number"),
        (("C = 20", "C = nan"), "temperature_C must be a finite number"),
        (("rectangular", "square"), "distribution must be one of normal, rectangular"),
        (("= 0.6", "= -0.6"), "not negative"),
        (("= 0.6", "= 0.6\nstandard_arcsec = 1"), "give either"),
        (('"B"', '"A"'), "evaluated from"),
        (("[[contribution]]", "[contribution]"), r"must be tables \[\[contribution\]\]"),
        (("[certificate]", "[certificate"), "not valid TOML"),
        (("= 0.6", "= 0.6\ndegrees_of_freedom = 0"), "degrees_of_freedom must be positive"),
    ],
)
def test_a_wrong_identity_says_where(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    path = tmp_path / "identity.toml"
    path.write_text(IDENTITY.replace(*change, 1))
    with pytest.raises(FileError, match=says) as caught:
        load_identity(path)
    assert "identity.toml" in str(caught.value)


def test_shares_add_up_and_the_sum_is_the_root() -> None:
    who = Identity("1", "j", contributions=(Contribution("a", 2.0), Contribution("b", 1.5)))
    made = certify(_runs(), who, orders=[1]).content["budget"]
    assert sum(line["share_percent"] for line in made["lines"]) == pytest.approx(100.0)
    total = np.sqrt(sum(line["standard_arcsec"] ** 2 for line in made["lines"]))
    assert made["standard_arcsec"] == pytest.approx(total)
    doubled = replace(who, contributions=(Contribution("a", 4.0), Contribution("b", 3.0)))
    assert certify(_runs(), doubled, orders=[1]).content["budget"]["standard_arcsec"] > total


def test_rm44_takes_two_to_four_pages(data_dir: Path, tmp_path: Path) -> None:
    identity = tmp_path / "identity.toml"
    identity.write_text(IDENTITY)
    out = tmp_path / "rm44.pdf"
    made = ta.report(ta.read_runs(data_dir / "rm44_repeat.csv"), out, certificate=identity)
    assert len(made.content["positions"]) == 36
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", out.read_bytes())) <= 4


def _files(folder: Path) -> tuple[Path, Path]:
    rows = ["reference_deg,indicated_deg,run"]
    for number, run in enumerate(_runs()):
        rows += [f"{r},{i},{number}" for r, i in zip(run.reference, run.indicated, strict=True)]
    runs, identity = folder / "runs.csv", folder / "identity.toml"
    runs.write_text("\n".join(rows))
    identity.write_text(IDENTITY)
    return runs, identity


def _trueangle(*args: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "trueangle", *map(str, args)]
    return subprocess.run(command, capture_output=True, text=True, env=os.environ, check=False)


def test_whole_numbers_of_thousands_of_digits_are_told(tmp_path):
    path = tmp_path / "identity.toml"
    path.write_text(f"[certificate]\nnumber = {'9' * 5000}\n")
    with pytest.raises(FileError, match=r"identity\.toml: holds a number or date that cannot"):
        load_identity(path)
