"""Two models compared: the line by which they differ comes back, whichever is first."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.model.records import FitRecord, TableRecord
from trueangle.model.terms import Backlash, LocalDefect

SEED = 55_301

#: Arcsec: rounding of sums over the turn.
EXACT = 1e-6


def model(lines, argument="reference", period=360.0, constant=0.0):
    """Of ``{order: (arcsec, phase in degrees)}``."""
    unit = period / 1_296_000.0
    sine = [c * unit * np.cos(np.radians(p)) for c, p in lines.values()]
    cosine = [c * unit * np.sin(np.radians(p)) for c, p in lines.values()]
    shaft = ta.Shaft("output", 1, list(lines), cosine, sine)
    return ta.HarmonicModel([shaft], constant=constant, period=period, argument=argument)


def drawn():
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    return {k: (float(rng.uniform(20.0, 90.0)), float(rng.uniform(0.0, 360.0))) for k in (1, 2, 5)}


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("periods", [(360.0, 360.0), (2 * np.pi, 360.0), (1.0, 4096.0)])
def test_an_added_line_comes_back(argument, periods):
    lines = drawn()
    first = model(lines, argument, periods[0])
    second = model({**lines, 7: (12.5, 200.0)}, argument, periods[1], periods[1] / 90.0)
    found, back = ta.compare(first, second), ta.compare(second, first)
    rows = {row["order"]: row for row in found.orders}
    assert rows[7.0]["amplitude_arcsec"] == pytest.approx(12.5, abs=EXACT)
    assert rows[7.0]["phase_deg"] == pytest.approx(200.0, abs=1e-6)
    assert {row["order"]: row["phase_deg"] for row in back.orders}[7.0] == pytest.approx(20.0)
    assert all(rows[float(k)]["amplitude_arcsec"] < EXACT for k in lines)
    assert found.zero_deg == pytest.approx(4.0)
    assert back.zero_deg == pytest.approx(-4.0)
    # Parseval; and the largest value of one line is its amplitude.
    assert found.rms_arcsec == pytest.approx(12.5 / np.sqrt(2.0), rel=1e-6)
    assert found.max_abs_arcsec == pytest.approx(12.5, rel=1e-3)


@pytest.mark.parametrize("first", ["reference", "indicated"])
def test_models_of_other_arguments_differ_by_what_they_make_of_a_true_angle(first):
    """By brute force: each model's reading at a true angle, and the projection on each order."""
    lines = {1: (5000.0, 40.0), 2: (9000.0, 250.0)}
    other = "indicated" if first == "reference" else "reference"
    a, b = model(lines, first), model({**lines, 3: (700.0, 120.0)}, other)

    def read(one, theta):
        """Indicated angle of a true one: the angle that is corrected to it."""
        found = theta.copy()
        for _ in range(80):
            found += theta - np.asarray(one.correct(found))
        return found

    theta = np.arange(4096.0) * (360.0 / 4096.0)
    off = (read(b, theta) - read(a, theta)) * 3600.0
    off -= off.mean()
    found = ta.compare(a, b)
    assert found.argument == "reference"
    assert found.rms_arcsec == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-6)
    assert found.max_abs_arcsec == pytest.approx(np.abs(off).max(), rel=1e-4)
    for row in found.orders:
        z = 2.0 * np.mean(off * np.exp(-1j * np.radians(row["order"] * theta)))
        assert row["amplitude_arcsec"] == pytest.approx(abs(z), rel=1e-6)
        # Re is the cosine's amplitude, -Im the sine's.
        phase = np.degrees(np.arctan2(z.real, -z.imag)) % 360.0
        assert row["phase_deg"] == pytest.approx(phase, abs=1e-4)


def test_errors_of_a_difference_are_those_of_both():
    lines = drawn()
    base = model(lines)
    a = base.replace(covariance=np.diag(np.arange(1.0, 8.0)) * 1e-8)
    b = base.replace(covariance=np.eye(7) * 4e-8)
    found = ta.compare(a, b)
    for k, row in enumerate(found.orders):
        own = (2.0 + 2.0 * k + 3.0 + 2.0 * k) / 2.0 * 1e-8
        assert row["std_arcsec"] == pytest.approx(np.sqrt(own + 4e-8) * 3600.0)
    # Over the turn each order adds half of the variance of both its parts.
    whole = (np.arange(2.0, 8.0).sum() * 1e-8 + 6 * 4e-8) / 2.0
    assert found.std_arcsec == pytest.approx(np.sqrt(whole) * 3600.0)
    assert ta.compare(base, base).std_arcsec is None


@pytest.mark.parametrize("b", [(100.0, 300.0), (0.0, 360.0)])
def test_arcs_are_compared_where_both_models_were_fitted(b):
    """By brute force over the travel."""
    ends, rng = (b[0], 200.0), np.random.default_rng(SEED)

    def fitted(start, stop):
        theta = np.linspace(start, stop, 200)
        error = 0.05 * np.sin(np.radians(theta)) + 0.001 * rng.normal(size=200)
        return ta.fit(ta.CalibrationRun(theta, theta + error, 360.0), orders=[1, 2]).model

    arc, other = fitted(0.0, 200.0), fitted(*b)
    found = ta.compare(arc, other)
    assert found.share == pytest.approx(np.ptp(ends) / 360.0, abs=1e-3)
    places = np.linspace(*ends, 4001)
    between = np.diff([np.asarray(one.error(places)) for one in (arc, other)], axis=0)
    assert found.rms_arcsec == pytest.approx(3600.0 * np.std(between), rel=1e-2)
    bands = np.array([one.band(places) for one in (arc, other)])
    std = 3600.0 * np.sqrt(np.mean(np.sum(bands**2, axis=0)))
    assert found.std_arcsec == pytest.approx(std, rel=1e-2)
    assert found.rms_arcsec < 3.0 * std
    with pytest.raises(ta.errors.ArgumentError, match="none is common"):
        ta.compare(arc, fitted(230.0, 340.0))


@pytest.mark.parametrize(
    ("zeros", "told"), [((200.0, -170.0), -10.0), ((-170.0, 200.0), 10.0), ((10.0, 190.0), 180.0)]
)
@pytest.mark.parametrize("period", [360.0, 1.0])
def test_zeros_differ_by_the_shorter_way(zeros, told, period):
    first, second = (
        model({1: (30.0, 0.0)}, "reference", period, z * period / 360.0) for z in zeros
    )
    assert abs(ta.compare(first, second).zero_deg) == pytest.approx(abs(told))
    if abs(told) < 180.0:
        assert ta.compare(first, second).zero_deg == pytest.approx(told)


@pytest.mark.parametrize("first", ["reference", "indicated"])
def test_the_zero_between_arguments_is_the_mean_at_true_angles(first):
    """However steep the line is: over true angles its mean is none."""
    other = "indicated" if first == "reference" else "reference"
    lines = {1: (9000.0, 40.0)}
    a, b = model(lines, first, constant=0.25), model(lines, other, constant=1.0)
    theta = np.arange(4096.0) * (360.0 / 4096.0)
    means = []
    for one in (a, b):
        found = theta.copy()
        for _ in range(80):
            found += theta - np.asarray(one.correct(found))
        means.append(float(np.mean(found - theta)))
    assert ta.compare(a, b).zero_deg == pytest.approx(means[1] - means[0], abs=1e-6)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("period", [360.0, 1.0])
def test_a_bump_moves_the_zero_by_its_mean(argument, period):
    """Of a turn; what is left about it are its squares and its height."""
    height, width = 0.03, 4.0
    plain = model({1: (30.0, 10.0)}, argument, period)
    unit = period / 360.0
    bumped = plain.replace(terms=(LocalDefect(70.0 * unit, width * unit, height * unit),))
    found = ta.compare(plain, bumped)
    mean = height * width * np.sqrt(2.0 * np.pi) / 360.0
    # At true angles a bump of readings is wider by the slope of the line there, 1e-4.
    near = 1e-9 if argument == "reference" else 1e-4
    assert found.zero_deg == pytest.approx(mean, rel=near)
    assert ta.compare(bumped, plain).zero_deg == pytest.approx(-mean, rel=near)
    squares = height**2 * width * np.sqrt(np.pi) / 360.0 - mean**2
    assert found.rms_arcsec == pytest.approx(3600.0 * np.sqrt(squares), rel=near)
    assert found.max_abs_arcsec == pytest.approx(3600.0 * (height - mean), rel=1e-4)


def test_what_both_tables_do_beside_their_models_adds_up():
    """At most the sum, in squares; in the unit of each; a play of as many turns is another one."""

    def read(period, rms, largest):
        table = TableRecord("csv", "reference", rms * period / 1_296_000.0,
                            largest * period / 1_296_000.0)  # fmt: skip
        record = FitRecord(36, 1, (0.0, period), 0.0, "table", table=table)
        one = model({1: (30.0, 10.0)}, "reference", period)
        return one.replace(fit=record, terms=(Backlash(0.01),))

    found = ta.compare(read(360.0, 0.3, 1.5), read(1.0, 0.4, 2.0))
    assert found.table_rms_arcsec == pytest.approx(0.5)
    assert found.table_max_abs_arcsec == pytest.approx(3.5)
    assert found.differ_in == ["backlash"]
    assert ta.compare(read(1.0, 0.3, 1.5), read(1.0, 0.4, 2.0)).differ_in == []
