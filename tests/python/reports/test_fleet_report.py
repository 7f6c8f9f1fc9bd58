"""The page of a fleet holds what the fleet says, and needs neither script nor network."""

import json
import re
from html import unescape

import numpy as np
import pytest
from scipy.stats import chi2

import trueangle as ta
from fleets.made import units
from model.test_windows import PER, model, readings
from plots.strokes import strokes
from trueangle.cli import main
from trueangle.reports.fleet import FleetReport
from trueangle.reports.watched import WatchReport

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


@pytest.fixture(scope="module")
def dated():
    """Nine units on three dates, one of which grows."""
    print(f"seed {SEED}")

    def grows(u, t, b):
        return b + np.array([[20.0 * t, 0.0]] + 3 * [[0.0, 0.0]]) * (u == 3), 0.0

    rng = np.random.default_rng(SEED + 2)
    dates = ("2026-01-10", "2026-03-10", "2026-05-10")
    return ta.fleet(
        units(rng, 9, dates=dates, change=grows, runs=2, noise=1.0),
        orders=[1, 2],
        permitted_arcsec=60.0,
    )


def curve(chart, colour):
    """Points of the lines of one colour."""
    parts = [one.points for one in strokes(chart) if one.style.get("stroke") == f"var(--{colour})"
             and one.kind == "line"]  # fmt: skip
    return np.vstack(parts).T


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 3600.0), ("mrad", np.pi / 0.18)])
def test_pictures_draw_the_units_and_their_spread(dated, errors_in, per):
    page = FleetReport(dated, "Nine", errors_in)
    for unit in dated.units:
        chart = page._pattern(unit)
        angle, error = curve(chart, "after" if unit.verdict == "fine" else "warning")
        x = np.radians(angle)
        wave = sum(r.amplitude * np.sin(r.order * x + np.radians(r.phase_deg)) for r in unit.orders)
        np.testing.assert_allclose(error, per * wave, atol=3e-3 * np.ptp(chart["y"]["limits"]))
        size = float(re.search(r", (\S+) \w+ peak-to-peak", chart["alt"])[1])
        assert size == pytest.approx(per * unit.peak_to_peak, rel=1e-3)
    chart = page._phasor(1)
    near = 2e-4 * np.ptp(chart["x"]["limits"])
    circle = curve(chart, "muted")
    common, between = dated.common[1], dated.between[1]
    away = np.hypot(circle[0] - per * common.cosine, circle[1] - per * common.sine)
    np.testing.assert_allclose(away, per * between.std * np.sqrt(chi2.ppf(0.95, 2)), atol=near)
    dots = {one.title: one.points[0] for one in strokes(chart) if one.title}
    assert set(dots) == {unit.unit for unit in dated.units}
    for unit in dated.units:
        row = unit.orders[1]
        turn = per * row.amplitude * np.exp(1j * np.radians(row.phase_deg))
        np.testing.assert_allclose(dots[unit.unit], [turn.imag, turn.real], atol=near)


def test_every_table_of_the_page_holds_the_fleets_numbers(dated):
    """Cell by cell, in seconds of arc."""
    text, plain = FleetReport(dated, "Nine", "arcsec").html, dated.to_dict()
    rows = {}
    for name, cells in re.findall(r'<th scope="row">([^<]+)</th>(.*?)</tr>', text, re.S):
        rows.setdefault(name, []).append(re.findall(r"<td[^>]*>([^<]*)</td>", cells))
    last = {row["unit"]: row for row in plain["history"]}
    for unit in plain["units"]:
        first, dates = rows[unit["unit"]]
        wanted = [unit["peak_to_peak_arcsec"], unit["left_arcsec"], unit["p"], unit["limit"]]
        assert first[0] == unit["verdict"]
        assert [float(x) for x in first[1:]] == pytest.approx(wanted, rel=0.06)
        assert [float(x) for x in first[1:3]] == pytest.approx(wanted[:2], rel=6e-4)
        row = last[unit["unit"]]
        assert dates[0] == row["when"]
        sums = max(one["cusum"] for one in row["orders"])
        wanted = [row["order"], row["statistic"], row["limit"], sums, row["cusum_limit"]]
        assert [float(x) for x in dates[1:6]] == pytest.approx(wanted, rel=6e-3)
        assert dates[6] == row["verdict"]
        assert float(dates[7]) == pytest.approx(row["bound_arcsec"], rel=6e-4)
        assert dates[8].startswith(row["next_calibration"])
        assert ("(extrapolated)" in dates[8]) == row["extrapolated"]
    orders = zip(plain["common"]["orders"], plain["between"]["orders"], strict=True)
    for common, between in orders:
        (cells,) = rows[f"{common['order']:g}"]
        wanted = [
            common["amplitude_arcsec"],
            between["std_arcsec"],
            between["repeatability_arcsec"],
        ]
        assert [float(x) for x in cells[1:]] == pytest.approx(wanted, rel=6e-4)


def test_the_page_of_a_watched_joint_draws_its_sums_and_sizes():
    angle, error = readings(60)
    error[PER * 50 :] += 0.004 * np.sin(4.0 * np.radians(angle[PER * 50 :]))
    windows = ta.Monitor(model()).windows_of(angle, error)
    page = WatchReport(windows, 360.0, errors_in="arcsec")
    told = [(one.window, one.statistic) for one in windows if one.alarm]
    (alarms,) = [one for one in strokes(page._chart()) if one.style.get("stroke-linecap")]
    assert len(alarms.points) == len(told)
    for k in range(3):
        sums, sizes = page._order(k)
        wanted = np.array([one.orders[k].amplitude for one in windows]) * 3600.0
        number, size = curve(sizes, "after")
        assert (number[0], number[-1]) == pytest.approx((windows[0].window, windows[-1].window),
                                                        abs=0.02)  # fmt: skip
        assert size.max() == pytest.approx(wanted.max(), rel=1e-3)
        assert float(re.search(r", (\S+) arcsec at most", sizes["alt"])[1]) == pytest.approx(
            wanted.max(), rel=6e-4
        )
        assert float(re.search(r", (\S+) at most", sums["alt"])[1]) == pytest.approx(
            max(one.orders[k].statistic for one in windows), rel=6e-3
        )
    first = next(one for one in windows if one.alarm)
    alarms = f"{len(told)} alarm{'s' * (len(told) > 1)}"
    assert page.summary() == f"59 windows, {alarms}\nwindow {first.window}: {first.because}"


def test_a_watched_joint_is_told_by_its_first_alarm():
    """Order 2 grows from window 30 on, and again from 45 on."""
    angle, error = readings(60)
    error[PER * 30 :] += 0.004 * np.sin(2.0 * np.radians(angle[PER * 30 :]))
    error[PER * 45 :] += 0.02 * np.sin(4.0 * np.radians(angle[PER * 45 :]))
    windows = ta.Monitor(model()).windows_of(angle, error)
    first, *more = (one for one in windows if one.alarm)
    assert more
    assert more[-1].because != first.because
    said = WatchReport(windows, 360.0, errors_in="arcsec").summary()
    assert said.endswith(f"\nwindow {first.window}: {first.because}")


FLEET_CHARTS_SEED = 71_209
MONTHS = tuple(f"2026-{month:02d}-10" for month in (1, 3, 5, 7, 9))


def changed(u: int, t: int, b: np.ndarray) -> tuple[np.ndarray, float]:
    b[0] += np.array([12.0 * t, 0.0]) * (u == 1)  # drifts
    b[1] += np.array([0.0, 60.0 * (t == 2)]) * (u == 2)  # and is as before
    return b, 0.0


@pytest.mark.parametrize("dates", [2, 3, 5])
def test_a_chart_has_every_date_every_order_and_the_limit(dates: int):
    print(f"seed {FLEET_CHARTS_SEED}")
    made = units(np.random.default_rng(FLEET_CHARTS_SEED), 8, dates=MONTHS[:dates], change=changed)
    fleet = ta.fleet(made, orders=[1, 2])
    for unit in ("u1", "u2", "u3"):
        chart = FleetReport(fleet)._chart(unit)
        rows = [row for row in fleet.history if row.unit == unit]
        assert len(rows) == dates - 1
        assert chart["x"]["limits"] == (1.5, dates + 0.5)  # half a date on either side
        drawn = strokes(chart)
        limit = [one for one in drawn if "stroke-dasharray" in one.style]
        assert len(limit) == 1
        highest = max(rows[-1].cusum_limit, *(one.cusum for row in rows for one in row.orders))
        assert chart["y"]["limits"] == (0.0, pytest.approx(1.1 * highest))
        if chart["y"]["scale"] == "linear":
            dots = np.vstack([one.points for one in drawn if one.kind == "dots"])
            wanted = [
                (date, row.orders[k].cusum) for k in range(2) for date, row in enumerate(rows, 2)
            ]
            for point in wanted:
                apart = np.abs(dots - point) / np.ptp([chart["x"]["limits"], chart["y"]["limits"]])
                assert apart.max(axis=1).min() < 1e-3
            assert limit[0].points[:, 1] == pytest.approx(rows[-1].cusum_limit, rel=1e-2)
        colours = {one.style["stroke"] for one in drawn if one.kind == "dots"}
        passed = [row.cusum > rows[-1].cusum_limit for row in rows[-1].orders]
        assert ("var(--warning)" in colours) == any(passed)
        assert f"{unit}: " in chart["title"]
        assert f"on {dates - 1} further dates, limit {rows[-1].cusum_limit:.3g}" in chart["alt"]
        if unit == "u1" and dates == 5:
            assert passed == [True, False]
