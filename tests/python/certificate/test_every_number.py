"""Every number of a certificate against its formula, written anew from its fit and the GUM."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import t as student

import trueangle as ta
from trueangle.certificate import Contribution, Identity, Specification, certify
from trueangle.certificate.identity import _contribution, load_identity
from trueangle.errors import ArgumentError, FileError

SEED = 41_800
ARCSEC = 1_296_000.0
#: Of the first run; those after it differ by little.
ZERO = 20_000.0
#: Two-sided probability of 95.45 %.
UPPER = 0.97725

#: Unit of the readings, travel in turns, runs, error in both directions, type B contributions.
CASES = {
    "a turn in radians": (2.0 * np.pi, 1.0, 4, 0.0, ()),
    "an arc in turns": (1.0, 0.55, 3, 0.0, (Contribution("reference", 2.0),)),
    "both ways": (
        360.0, 1.0, 5, 12.0,
        (Contribution("reference", 1.5, "B", "rectangular", 7.0), Contribution("axis", 0.7)),
    ),
}  # fmt: skip


@pytest.fixture(params=CASES)
def made(request):
    """A certificate, the fit of its readings, and what it was asked for."""
    period, travel, count, play, contributions = CASES[request.param]
    rng = np.random.default_rng([SEED, count])
    runs = []
    for number in range(count):
        mount = (number % 2) * 0.125
        turn = travel * np.arange(40) / 40.0
        turn = np.concatenate([turn, turn[::-1]]) if play else turn
        way = np.where(np.arange(turn.size) < 40, 1.0, -1.0)
        error = 300.0 * np.sin(2.0 * np.pi * turn + 0.3) + 90.0 * np.cos(6.0 * np.pi * turn)
        error += play * way + ZERO + 25.0 * number + rng.normal(0.0, 4.0, turn.size)
        runs.append(
            ta.CalibrationRun(
                period * turn, period * (turn + error / ARCSEC), period, mount=period * mount,
                temperature=np.full(turn.size, 20.0 + number),
            )
        )  # fmt: skip
    asked = Specification(320.0, "guard_band")
    who = Identity("1", "joint", contributions=contributions, specification=asked)
    # Play has a line of its own, and is none of the noise.
    fit = ta.fit(runs, orders=[1, 3], nuisance="direction" if play else "none")
    content = certify(runs, who, orders=[1, 3], positions=30).content
    return SimpleNamespace(fit=fit, runs=runs, content=content, period=period, asked=asked,
                           more=contributions, play=play, travel=travel)  # fmt: skip


def factor(freedom):
    return student.ppf(UPPER, np.floor(freedom) if np.isfinite(freedom) else 1e12)


def test_values_and_their_uncertainty(made):
    """The series less its mean; the covariance through the same; Welch and Satterthwaite."""
    content, fit = made.content, made.fit
    rows, lines = content["positions"], content["budget"]["lines"]
    turn = np.array([row["angle_deg"] for row in rows]) / 360.0
    wanted = np.arange(30) / 30.0
    np.testing.assert_allclose(turn, wanted[wanted < made.travel], atol=1e-12)
    angle = 2.0 * np.pi * turn
    columns = [np.ones(turn.size)]
    for order in (1, 3):
        columns += [np.cos(order * angle), np.sin(order * angle)]
    design = np.column_stack(columns)
    design -= design.mean(axis=0)
    (shaft,) = fit.model.shafts
    series = np.array([0.0, *np.ravel(np.column_stack([shaft.cosine, shaft.sine]))])
    unit = ARCSEC / made.period
    error = unit * design @ series
    standard = unit * np.sqrt(np.einsum("ij,jk,ik->i", design, fit.covariance, design))
    np.testing.assert_allclose([row["error_arcsec"] for row in rows], error, atol=1e-9)
    shared = lines[1:]
    freedom = np.array([line["degrees_of_freedom"] or np.inf for line in lines])
    for row, own in zip(rows, standard, strict=True):
        parts = np.array([own, *(line["standard_arcsec"] for line in shared)])
        u = np.sqrt(np.sum(parts**2))
        effective = u**4 / np.sum(parts**4 / freedom)
        assert row["standard_arcsec"] == pytest.approx(u, rel=1e-9)
        assert row["degrees_of_freedom"] == pytest.approx(effective, rel=1e-9)
        assert row["coverage_factor"] == pytest.approx(factor(effective), rel=1e-6)
        assert row["expanded_arcsec"] == pytest.approx(row["coverage_factor"] * u, rel=1e-9)
    assert content["level_percent"] == 95.45


def test_lines_of_the_budget(made):
    content = made.content
    lines, rows = content["budget"]["lines"], content["positions"]
    names = ["fit of the readings", "error that the series does not hold"]
    names += ["half the reversal error"] * bool(made.play)
    assert [line["name"] for line in lines] == [*names, *(item.name for item in made.more)]
    assert [line["type"] for line in lines] == ["A"] * len(names) + ["B"] * len(made.more)
    kinds = ["t", "t", "two-point"][: len(names)] + [item.distribution for item in made.more]
    assert [line["distribution"] for line in lines] == kinds
    assert all(line["sensitivity"] == 1.0 for line in lines)
    for line, item in zip(lines[len(names) :], made.more, strict=True):
        assert line["standard_arcsec"] == item.standard
        assert (line["degrees_of_freedom"] or np.inf) == item.degrees_of_freedom
    if made.play:
        assert lines[2]["standard_arcsec"] == pytest.approx(made.play, abs=1.5)
        # Way and return over the same places: half of their difference, run by run.
        errors = [(run.indicated - run.reference) * ARCSEC / made.period for run in made.runs]
        halves = [(e[:40].mean() - e[40:].mean()) / 2.0 for e in errors]
        # At the turning point the reading that goes back stands where the last one stood.
        assert lines[2]["standard_arcsec"] == pytest.approx(np.mean(halves), rel=1.5 / 40.0)
        known = np.mean(halves) / (np.std(halves, ddof=1) / np.sqrt(len(halves)))
        assert lines[2]["degrees_of_freedom"] == pytest.approx(0.5 * known**2, rel=0.15)
    assert lines[0]["degrees_of_freedom"] == made.fit.uncertainty.fewest
    variance = np.array([line["standard_arcsec"] ** 2 for line in lines])
    shares = [line["share_percent"] for line in lines]
    np.testing.assert_allclose(shares, 100.0 * variance / variance.sum(), atol=0.1)
    assert sum(round(10 * share) for share in shares) == 1000
    widest = max(rows, key=lambda row: row["expanded_arcsec"])
    assert {k: v for k, v in content["budget"].items() if k != "lines"} == {
        k: v for k, v in widest.items() if k != "error_arcsec"
    }


def test_harmonics_and_readings(made):
    content, fit, unit = made.content, made.fit, ARCSEC / made.period
    k = factor(fit.uncertainty.fewest)
    for n, row in enumerate(content["harmonics"]):
        assert (row["shaft"], row["order"]) == ("output", (1, 3)[n])
        assert row["amplitude_arcsec"] == pytest.approx(unit * fit.amplitudes[n])
        assert row["amplitude_expanded_arcsec"] == pytest.approx(k * unit * fit.amplitude_std[n])
        assert row["phase_deg"] == pytest.approx(np.degrees(fit.phases[n]) % 360.0)
        assert row["phase_expanded_deg"] == pytest.approx(k * np.degrees(fit.phase_std[n]))
    assert content["harmonics"][0]["amplitude_arcsec"] == pytest.approx(300.0, abs=10.0)
    assert content["harmonics"][0]["phase_deg"] == pytest.approx(np.degrees(0.3), abs=2.0)
    read = content["readings"]
    assert read["readings"] == sum(len(run) for run in made.runs)
    assert (read["runs"], read["mounts"], read["outliers"]) == (len(made.runs), 2, len(fit.wild))
    zeros = 25.0 * np.arange(len(made.runs))
    assert read["zero_deg"] * 3600.0 == pytest.approx(ZERO + np.mean(zeros), abs=4.0)
    assert read["zero_spread_arcsec"] == pytest.approx(np.std(zeros, ddof=1), abs=3.0)
    assert read["standard_deviation_arcsec"] == pytest.approx(unit * fit.residual_std)
    means = 20.0 + np.arange(len(made.runs))
    assert content["temperature_recorded_C"] == pytest.approx(
        {"mean": means.mean(), "low": means.min(), "high": means.max()}
    )


def test_what_is_stated_of_conformity(made):
    """ILAC-G8, a guard band of U; JCGM 106 with Student's distribution."""
    found, rows = made.content["conformity"], made.content["positions"]
    limit = made.asked.limit_arcsec
    assert (found["limit_arcsec"], found["decision_rule"]) == (limit, "guard_band")
    counts = dict.fromkeys(("pass", "conditional_pass", "conditional_fail", "fail"), 0)
    chances = []
    for row in rows:
        e, u, wide = abs(row["error_arcsec"]), row["standard_arcsec"], row["expanded_arcsec"]
        name = ("pass" if e <= limit - wide else "conditional_pass" if e <= limit
                else "conditional_fail" if e <= limit + wide else "fail")  # fmt: skip
        counts[name] += 1
        freedom = row["degrees_of_freedom"]
        chances.append(
            student.cdf((limit - e) / u, freedom) - student.cdf(-(limit + e) / u, freedom)
        )
    assert found["counts"] == counts
    assert found["conformance_probability"] == pytest.approx(min(chances), abs=1e-9)
    stated = [name for name, count in counts.items() if count]
    assert found["statement"] == stated[-1]
    assert found["conforms"] is (stated == ["pass"])
    worst = found["worst"]
    (row,) = [row for row in rows if row["angle_deg"] == worst["angle_deg"]]
    assert worst["error_arcsec"] == row["error_arcsec"]
    assert worst["acceptance_limit_arcsec"] == pytest.approx(limit - row["expanded_arcsec"])


def written(tmp_path, more):
    path = tmp_path / "identity.toml"
    path.write_text(f'[certificate]\nnumber = "1"\nitem = "joint"\n\n{more}\n')
    return load_identity(path)


@pytest.mark.parametrize("told", [None, 9, 0.5, float("inf")])
def test_a_line_of_a_file_has_the_freedom_that_it_says(told):
    entry = {"name": "table", "standard_arcsec": 2.0}
    if told is not None:
        entry["degrees_of_freedom"] = told
    freedom = _contribution(1, entry).degrees_of_freedom
    assert freedom == (math.inf if told is None else told)


@pytest.mark.parametrize("told", ["nine", 0, -1, float("nan"), True])
def test_a_freedom_that_is_none_is_refused(told):
    entry = {"name": "table", "standard_arcsec": 2.0, "degrees_of_freedom": told}
    with pytest.raises(ArgumentError, match=r"table.* degrees_of_freedom must"):
        _contribution(1, entry)


@pytest.mark.parametrize(("key", "told"), [("limit_arcsec", 36.0), ("limit_deg", 0.01)])
def test_a_limit_is_the_same_in_either_unit(key, told, tmp_path):
    found = written(tmp_path, f'[specification]\n{key} = {told}\ndecision_rule = "simple"\n')
    assert found.specification.limit_arcsec == pytest.approx(36.0)
    for wrong in (0.0, -told):
        with pytest.raises(FileError, match=rf"{key} must be positive, got {wrong}"):
            written(tmp_path, f'[specification]\n{key} = {wrong}\ndecision_rule = "simple"\n')


@pytest.mark.parametrize(
    ("distribution", "density"),
    [
        ("rectangular", lambda x: np.ones(x.size)),
        ("triangular", lambda x: 1.0 - np.abs(x)),
        ("arcsine", lambda x: 1.0 / np.sqrt(1.0 - x**2)),
        ("two-point", lambda x: 1.0 * (np.abs(x) > 0.9999)),
    ],
)
def test_a_half_width_has_the_standard_deviation_of_its_distribution(
    distribution, density, tmp_path
):
    """By the density's own second moment."""
    x = np.sin((np.arange(200_000) + 0.5) / 200_000 * np.pi - np.pi / 2.0)
    share = density(x) * np.sqrt(1.0 - x**2) if distribution != "two-point" else density(x)
    wanted = 6.0 * np.sqrt(share @ x**2 / share.sum())
    line = f'name = "a"\nhalf_width_arcsec = 6\ndistribution = "{distribution}"\n'
    (one,) = written(tmp_path, f"[[contribution]]\n{line}").contributions
    assert one.standard == pytest.approx(wanted, rel=1e-4)
    assert (one.kind, one.distribution, one.sensitivity) == ("B", distribution, 1.0)


def test_contributions_are_counted_from_one_and_are_200_at_most(tmp_path):
    lines = ["[[contribution]]", 'name = "a"', "standard_arcsec = 2", ""]
    found = written(tmp_path, "\n".join(lines * 200))
    assert [one.standard for one in found.contributions] == [2.0] * 200
    with pytest.raises(FileError, match="at most 200"):
        written(tmp_path, "\n".join(lines * 201))
    with pytest.raises(FileError, match=r"\[\[contribution\]\] 2 needs a name"):
        written(tmp_path, "\n".join([*lines, "[[contribution]]"]))


def test_what_is_not_stated_is_named_but_for_what_a_certificate_is_whole_without(tmp_path):
    found = written(tmp_path, "")
    assert {"serial", "date", "temperature_C"} <= set(found.not_stated)
    assert not {"number", "item", "address", "specification", "logo"} & set(found.not_stated)
    warm = replace(found, temperature_C=0.0, serial="7")
    assert set(found.not_stated) - set(warm.not_stated) == {"serial", "temperature_C"}
