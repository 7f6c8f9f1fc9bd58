"""Readings in another unit than the model's are told; ordinary motion in its unit is not."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import NotCorrectedWarning, UnitWarning
from trueangle.logs.statistics import CorrectionStatistics, UnitEvidence

DEG, RAD, TURN = 360.0, 2.0 * np.pi, 1.0


#: Ways to cut readings in batches, at last one by one: what is seen does not depend on it.
BATCHES = (1, 3, 90, 900)


def seen(values, period, span=None, batches=3):
    evidence = UnitEvidence(period)
    for batch in np.array_split(np.asarray(values), batches):
        evidence.update(batch)
    return evidence.unit(span)


def wrapped(turn, turns=3.0, low=0.0, count=900):
    return np.mod(turns * turn * np.linspace(0.0, 1.0, count) - low, turn) + low


@pytest.mark.parametrize(
    ("values", "period", "span", "unit"),
    [
        (np.linspace(-3.1, 3.1, 400), DEG, None, "rad"),
        (np.linspace(0.2, 6.2, 400), DEG, None, "rad"),
        (wrapped(RAD, low=-np.pi), DEG, None, "rad"),
        (wrapped(TURN, turns=3.4), DEG, None, "turn"),
        (wrapped(TURN, turns=3.4), RAD, None, "turn"),
        (wrapped(DEG, low=-180.0), RAD, None, "deg"),
        (np.linspace(-150.0, 170.0, 400), RAD, None, "deg"),
        (wrapped(16384.0).astype(np.int64), DEG, None, "count"),
        (np.linspace(0.6, 1.9, 200), DEG, (30.0, 120.0), "rad"),
        # Ordinary readings.
        (np.full(500, 1.2), DEG, None, None),
        (1.2 + 0.3 * np.sin(np.linspace(0.0, 60.0, 500)), DEG, None, None),
        (np.linspace(-1.0, 1.2, 300), DEG, (-90.0, 90.0), None),
        (wrapped(DEG), DEG, None, None),
        (np.linspace(-170.0, 170.0, 300), DEG, None, None),
        (np.linspace(0.0, 3000.0, 300), DEG, None, None),
        (np.linspace(-3.1, 3.1, 300), RAD, None, None),
        (np.linspace(0.0, 40.0, 300), RAD, None, None),
        (np.linspace(0.0, 2500.0, 300), RAD, None, None),
        (np.linspace(-120.0, -60.0, 300), DEG, (0.0, 90.0), None),
        (np.linspace(400.0, 440.0, 300), DEG, (30.0, 120.0), None),
        (np.array([0.0, 6.28]), DEG, None, None),
        (np.full(300, np.nan), DEG, None, None),
    ],
)
def test_another_unit_is_seen_and_ordinary_readings_are_not_doubted(values, period, span, unit):
    assert [seen(values, period, span, batches) for batches in BATCHES] == [unit] * len(BATCHES)


def beside_and_inside(low, high, span, period, factor):
    """Readings that no turn more or less brings to a span, and all of whose multiples lie in it."""
    turns = [(low + k * period, high + k * period) for k in (-1, 0, 1)]
    beside = all(b < span[0] or a > span[1] for a, b in turns)
    a, b = low * factor, high * factor
    whole = range(int(-3.0 - abs(a) / period), int(4.0 + abs(a) / period))
    return beside and any(span[0] <= a + k * period and b + k * period <= span[1] for k in whole)


@pytest.mark.parametrize("period", [DEG, RAD, TURN])
def test_a_calibrated_part_of_the_turn_tells_the_unit_as_written_out(period):
    """Any readings, spans also beyond a turn; and the same of all that is seen in a mirror."""
    print("seed 8123")
    rng = np.random.default_rng(8123)
    counts = {True: 0, False: 0}
    for _ in range(1500):
        start = rng.uniform(-0.6, 1.0)
        span = (start * period, (start + rng.uniform(0.05, 0.9)) * period)
        if rng.random() < 0.5:  # of another unit
            turn = float(rng.choice([t for t in (DEG, RAD) if t != period]))
            low, high = np.sort(rng.uniform(*span, 2)) * turn / period
            at = rng.integers(-1, 2) * turn
        else:
            low, high = np.sort(rng.uniform(-1.6, 1.6, 2)) * period
            at = 0.0
        evidence, mirrored = UnitEvidence(period), UnitEvidence(period)
        evidence.update(np.array([low, high]) + at)
        mirrored.update(-np.array([low, high]) - at)
        for turn in (DEG, RAD):
            if turn == period:
                continue
            wanted = beside_and_inside(low + at, high + at, span, period, period / turn)
            counts[wanted] += 1
            assert evidence._fits(span, period / turn) == wanted
            assert mirrored._fits((-span[1], -span[0]), period / turn) == wanted
    assert min(counts.values()) > 80


def model_file(folder, period):
    theta = np.arange(0.0, 1.0, 1.0 / 36.0) * period
    error = 1e-3 * period * np.sin(theta * 2.0 * np.pi / period)
    path = folder / "model.json"
    ta.fit(ta.CalibrationRun(theta, theta + error, period=period), orders=[1]).model.save(path)
    return str(path)


def written(path, name, values):
    np.savetxt(path, values, header=name, comments="", fmt="%.9g")
    return str(path)


@pytest.mark.filterwarnings("always::trueangle.errors.UnitWarning")
@pytest.mark.parametrize(
    ("period", "values", "unit"),
    [(DEG, np.linspace(-3.0, 3.1, 200), "rad"), (RAD, np.linspace(-170.0, 160.0, 200), "deg")],
)
def test_the_command_tells_in_one_line(tmp_path, capsys, period, values, unit):
    model = model_file(tmp_path, period)
    logs = [written(tmp_path / f"{k}.csv", "q", values) for k in range(2)]
    resting = np.full(200, 0.1 * period)  # tells no unit, and does not count
    logs.insert(1, written(tmp_path / "rest.csv", "q", resting))
    for folder in ("out", "again"):
        (tmp_path / folder).mkdir()
    out = str(tmp_path / "out")
    assert main(["correct", *logs, "-m", model, "--column", "q", "-o", out, "--json"]) == 0
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    assert f"--unit {unit}" in lines[0]
    assert "2 logs" in lines[0]
    # A unit that was stated is not doubted, in the name or by the option.
    stated = ["--unit", unit, "-o", str(tmp_path / "again")]
    assert main(["correct", *logs, "-m", model, "--column", "q", *stated]) == 0
    named = written(tmp_path / "named.csv", "q_deg", values)
    into = str(tmp_path / "named_out.csv")
    assert main(["correct", named, "-m", model, "--column", "q_deg", "-o", into]) == 0
    assert not capsys.readouterr().err


def test_the_python_interface_warns(tmp_path):
    model = model_file(tmp_path, DEG)
    log = written(tmp_path / "q.csv", "q", wrapped(RAD))
    with pytest.warns(UnitWarning, match="look like rad"):
        ta.correct_logs(log, model, tmp_path / "o.csv", column="q")


def test_the_transformer_tells_degrees_and_what_it_leaves():
    sklearn = pytest.importorskip("trueangle.fitting.sklearn")
    theta = np.linspace(0.0, 360.0, 300, endpoint=False)
    rng = np.random.default_rng(11)
    rows = rng.permutation(300)
    noise = rng.normal(0.0, 1e-3, 300)
    read = theta + 0.5 * np.sin(np.radians(theta)) + noise
    with (
        pytest.warns(UnitWarning, match="period=360"),
        pytest.warns(NotCorrectedWarning, match="column 0 is left as it is"),
    ):
        sklearn.AngleCorrector().fit(read[rows, None], theta[rows])
    with pytest.warns(NotCorrectedWarning):
        sklearn.AngleCorrector(period=360.0).fit((theta + noise)[:, None], theta)


SEED = 66_000
UNITS = (360.0, 1.0, 2.0 * np.pi, 65536.0, -360.0)


def readings():
    rng = np.random.default_rng(SEED)
    angle = rng.uniform(-2.0, 3.0, 500)
    change = rng.normal(0.0, 1e-3, 500)
    change[7] = -0.01
    angle[[3, 99]] = np.nan
    return angle, angle + change, change


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("cuts", [[], [1, 8, 300]])
def test_they_are_those_of_all_readings_in_every_unit_however_they_come(period, cuts):
    """Against one pass of numpy; a period below 0 is a joint that counts the other way."""
    indicated, corrected, change = readings()
    known = np.isfinite(indicated)
    found = CorrectionStatistics()
    parts = zip(np.split(indicated, cuts), np.split(corrected, cuts), strict=True)
    span = (0.1 * period, 0.6 * period)
    for one, other in parts:
        found.update(period * one, period * other, period, span)
    assert (found.rows, found.missing) == (500, 2)
    seconds = 1_296_000.0
    rms = np.sqrt(np.mean(change[known] ** 2))
    assert found.rms_arcsec == pytest.approx(seconds * rms, rel=1e-6)
    assert found.max_abs_arcsec == pytest.approx(seconds * np.abs(change[known]).max(), rel=1e-6)
    place = np.mod(corrected[known], 1.0)
    outside = int(np.count_nonzero((place < 0.1) | (place > 0.6)))
    assert found.outside == outside
    assert 200 < outside < 300


def test_nothing_was_done_to_no_readings():
    found = CorrectionStatistics()
    assert (found.rms_arcsec, found.max_abs_arcsec) == (0.0, 0.0)
    found.update(np.full(3, np.nan), np.full(3, np.nan), 360.0, None)
    assert (found.rows, found.missing, found.rms_arcsec, found.outside) == (3, 3, 0.0, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_greatest_correction_is_that_of_either_sign(sign):
    found = CorrectionStatistics()
    found.update(np.zeros(3), sign * np.array([0.0, 0.5, 0.1]), 360.0, None)
    found.update(np.zeros(2), -sign * np.array([0.2, 0.3]), 360.0, None)
    assert found.max_abs_arcsec == pytest.approx(1800.0)
    assert found.rms_arcsec == pytest.approx(3600.0 * np.sqrt((0.26 + 0.13) / 5.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_ends_of_the_part_fitted_are_inside(sign):
    found = CorrectionStatistics()
    ends = sign * np.array([32.0, 160.0, 31.9, 160.1])
    found.update(ends, ends, sign * 256.0, (sign * 32.0, sign * 160.0))
    assert found.outside == 2
