"""Two logs with two clocks, joined: against a motion that is known at every time."""

import json
import math
import re

import numpy as np
import pytest
import scipy.signal

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError
from trueangle.runs.joining.clocks import estimated_clocks
from trueangle.runs.joining.stream import Stream

#: Seeds of noise and jitter; printed by a failing test through its parameters.
SEEDS = (1, 2)
OFFSET, RATE = 1234.5678, 80.0
NOISE = 0.01


def motion(t):
    return 200.0 * np.sin(0.4 * t) + 60.0 * np.sin(1.1 * t + 1.0)


def pattern(theta):
    return 0.4 * np.sin(np.radians(theta)) + 0.1 * np.cos(2.0 * np.radians(theta))


def log(path, role, time, angle, unit="deg"):
    rows = zip(time.tolist(), angle.tolist(), strict=True)
    path.write_text("\n".join([f"time_s,{role}_{unit}", *(f"{t!r},{x!r}" for t, x in rows)]))
    return path


def logs(folder, seed, gap=True):
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 60.0, 0.01) + rng.uniform(0.0, 0.002, 6000)
    said = motion(t) + pattern(motion(t)) + rng.normal(0.0, NOISE, t.size)
    s = np.arange(0.0, 62.0, 0.004)
    s = s[~((s > 20.0) & (s < 21.5))] if gap else s
    other = s + OFFSET + 1e-6 * RATE * (s - t[0])
    true = motion(s) + rng.normal(0.0, 0.001, s.size)
    return (
        log(folder / "joint.csv", "indicated", t, np.mod(said, 360.0)),
        log(folder / "laser.csv", "reference", other, true),
    )


def rest(run):
    error = run.indicated - run.reference
    return error - 360.0 * np.round(error / 360.0) - pattern(run.reference)


@pytest.mark.parametrize("seed", SEEDS)
def test_offset_and_rate_are_found_within_their_errors(seed, tmp_path):
    joint, laser = logs(tmp_path, seed)
    found = ta.join(joint, laser)
    #: Four standard errors: one test in 16 000 fails by chance.
    assert abs(found.offset_s - OFFSET) < 4.0 * found.offset_std_s < 1e-4
    assert abs(found.rate_ppm - RATE) < 4.0 * found.rate_std_ppm < 2.0
    (run,) = found.runs
    added = math.sqrt(max(float(np.var(rest(run))) - NOISE**2, 0.0)) * 3600.0
    # The noise's own standard deviation is known to a 1/sqrt(2 n) of it.
    assert added < 4.0 * found.std_arcsec + 3600.0 * NOISE * math.sqrt(4.0 / math.sqrt(12_000.0))
    assert found.std_arcsec < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_pulls_of_offset_and_rate(memory):
    """White noise and noise that remembers ten readings: errors are what seeds scatter.

    Without files: the test above has their way through them.
    """
    pulls = []
    seeds = range(8_200, 8_230)
    print(f"seeds {seeds}")
    for seed in seeds:
        rng = np.random.default_rng(seed)
        t = np.arange(0.0, 30.0, 0.01) + rng.uniform(0.0, 0.002, 3000)
        drawn = rng.normal(0.0, NOISE * math.sqrt(1.0 - memory**2), t.size)
        noise = scipy.signal.lfilter([1.0], [1.0, -memory], drawn)
        s = np.arange(-1.0, 31.0, 0.004)
        true = motion(s) + rng.normal(0.0, 0.001, s.size)
        found = estimated_clocks(
            Stream.of(t, motion(t) + pattern(motion(t)) + noise),
            Stream.of(s + OFFSET + 1e-6 * RATE * (s - t[0]), true),
            None,
            None,
        )
        pulls.append(
            ((found.offset - OFFSET) / found.offset_std, (found.rate - RATE) / found.rate_std)
        )
    spread, mean = np.std(pulls, axis=0), np.mean(pulls, axis=0)
    print(spread, mean)
    # Of thirty the deviation is known to 13 %, the mean to 0.18.
    assert ((spread > 0.7) & (spread < 1.35)).all()
    assert (np.abs(mean) < 0.7).all()


def test_what_joining_adds_is_what_clocks_not_known_better_make_of_the_motion(tmp_path):
    """Noise of half a degree, so that the offset alone tells; over seeds the square is one."""
    seeds = range(8_300, 8_316)
    print(f"seeds {seeds}")
    pulls = []
    for seed in seeds:
        t, s = np.arange(0.0, 20.0, 0.02), np.arange(-1.0, 21.0, 0.01)
        said = motion(t) + np.random.default_rng(seed).normal(0.0, 0.5, t.size)
        joint = log(tmp_path / "a.csv", "indicated", t, said)
        found = ta.join(joint, log(tmp_path / "b.csv", "reference", s + 5.0, motion(s)))
        (run,) = found.runs
        off = 3600.0 * (run.reference - motion(run.time))
        pulls.append(np.sqrt(np.mean(off**2)) / found.std_arcsec)
    print(pulls)
    # The mean of sixteen chi-squared numbers of one degree of freedom is known to 0.35.
    assert abs(np.mean(np.square(pulls)) - 1.0) < 3.0 * 0.35
    assert np.mean(np.square(pulls)) > 0.3


def test_a_time_on_the_other_clock_is_known_by_offset_and_rate_together():
    """Closed form: of a line through n even places the mean variance is 2/n, of its end 4/n.

    Offset and rate are correlated by -0.87; each for itself would make twice of it.
    """
    seed = 8_400
    print("seed", seed)
    t, s = np.arange(0.0, 60.0, 0.02), np.arange(-1.0, 61.0, 0.01)
    said = 30.0 * np.sin(3.0 * t) + np.random.default_rng(seed).normal(0.0, NOISE, t.size)
    true = Stream.of(s + 5.0 + 1e-6 * RATE * s, 30.0 * np.sin(3.0 * s))
    found = estimated_clocks(Stream.of(t, said), true, None, None)
    # The speed is even to a period in twenty-nine.
    assert found.timing_std == pytest.approx(found.offset_std / math.sqrt(2.0), rel=0.02)
    assert 1e-6 * 60.0 * found.rate_std == pytest.approx(
        found.offset_std * math.sqrt(3.0), rel=0.02
    )


@pytest.mark.parametrize("side", ["indicated", "reference"])
def test_a_signal_of_either_log_is_that_of_the_time_of_its_own_clock(side, tmp_path):
    paths = dict(zip(("indicated", "reference"), logs(tmp_path, 1, gap=False), strict=True))
    head, *rows = paths[side].read_text().split("\n")
    lines = [f"{head},temperature_C", *(f"{row},{row.partition(',')[0]}" for row in rows)]
    paths[side].write_text("\n".join(lines))
    found = ta.join(*paths.values(), offset_s=OFFSET, rate_ppm=RATE)
    (run,) = found.runs
    start = float(paths["indicated"].read_text().split("\n")[1].partition(",")[0])
    there = run.time + OFFSET + 1e-6 * RATE * (run.time - start)
    wanted = run.time if side == "indicated" else there
    np.testing.assert_allclose(run.temperature, wanted, atol=1e-6)


def test_nothing_is_made_up_over_a_gap(tmp_path):
    joint, laser = logs(tmp_path, 1)
    found = ta.join(joint, laser)
    (gap,) = found.gaps
    assert gap.end_s - gap.start_s == pytest.approx(1.5, abs=0.02)
    assert gap.left_out == found.left_out == pytest.approx(150, abs=3)
    there = found.runs[0].time + OFFSET
    assert not ((there > gap.start_s + 0.01) & (there < gap.end_s - 0.01)).any()
    assert not ta.join(joint, laser, max_gap_s=2.0).gaps


def test_what_was_discarded_leads_and_a_longer_gap_keeps_it(tmp_path, capsys):
    paths = [*map(str, logs(tmp_path, 1)), "-o", str(tmp_path / "runs.csv")]
    assert main(["join", *paths]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert re.match(r"58\d\d of 6000 readings joined in 1 run: at the time of the others", told)
    assert "give --max-gap or --offset where more is known offset" in told
    assert main(["join", *paths, "--max-gap", "2"]) == 0
    assert capsys.readouterr().out.startswith("6000 readings joined in 1 run\n")


@pytest.mark.parametrize(("burst", "pause"), [(4, 0.0125), (6, 0.03), (2, 0.008)])
def test_a_log_written_in_bursts_has_no_gaps_between_them(burst, pause, tmp_path):
    """Several rows within 2 ms and a pause: by hand over 140 deg, in steps of 0.6 deg."""
    rng = np.random.default_rng(burst)
    ends = np.cumsum(rng.uniform(2.0, 7.0, 30))
    places = rng.uniform(0.0, 140.0, 30)
    t = np.arange(0.3, 99.0, 0.13)
    s = np.sort((np.arange(0.0, 100.0, pause)[:, None] + np.linspace(0.0, 2e-3, burst)).ravel())
    # A pause of 9 s in which the shaft goes on: of that nothing is known.
    s = s[(s < 50.0) | (s > 59.0)]
    theta = np.interp(t, ends, places)
    heading = theta + 15.0 * np.sin(np.radians(theta + 200.0)) + rng.normal(0.0, 0.5, t.size)
    shaft = 0.6 * np.round(np.interp(s, ends, places) / 0.6)
    found = ta.join(
        log(tmp_path / "a.csv", "indicated", t, heading),
        log(tmp_path / "b.csv", "reference", s, shaft),
    )
    (gap,) = found.gaps
    assert (gap.start_s, gap.end_s) == pytest.approx((50.0, 59.0), abs=0.05)
    assert found.left_out == gap.left_out == pytest.approx(9.0 / 0.13, abs=2)
    assert found.offset_s == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize("seed", [0, 37, 49, 60, 61])
def test_rests_that_agree_at_any_offset_do_not_decide_it(seed):
    """Few motions between long rests: at 87 to 108 s of offset hardly anything moved in both."""
    rng = np.random.default_rng(seed)
    length, times, places = rng.uniform(100.0, 250.0), [0.0], []
    count = int(rng.integers(4, 25))
    starts = np.sort(rng.uniform(0.0, length, count))
    places.append(rng.uniform(0.0, 140.0))
    for start in starts:
        times += [start, start + rng.uniform(1.0, 4.0)]
        places += [places[-1], rng.uniform(0.0, 140.0)]
    order = np.argsort(times, kind="stable")
    knots, places = np.array(times)[order], np.array(places)[order]
    s = np.arange(0.0, length, 0.0125)
    shaft = 0.6 * np.round(np.interp(s, knots, places) / 0.6)
    t = np.arange(rng.uniform(0.0, 0.3 * length), length - 1.0, 0.13)
    t = t + rng.uniform(-0.02, 0.02, t.size)
    theta = np.interp(t, knots, places)
    heading = theta + 20.0 * np.sin(np.radians(theta + 200.0)) + 3.0 * np.sin(np.radians(2 * theta))
    said = Stream.of(t, heading + rng.normal(0.0, 0.5, t.size))
    found = estimated_clocks(said, Stream.of(s, shaft), None, 0.0)
    assert found.offset == pytest.approx(0.0, abs=0.5)


def test_declared_clocks_and_the_other_order(tmp_path):
    joint, laser = logs(tmp_path, 2)
    found = ta.join(laser, joint, offset_s=OFFSET, rate_ppm=RATE)
    assert (found.offset_s, found.rate_ppm, found.offset_std_s) == (OFFSET, RATE, None)
    assert np.std(rest(found.runs[0])) == pytest.approx(NOISE, rel=0.05)


def test_one_speed_tells_no_offset_and_says_so(tmp_path):
    t = np.arange(0.0, 60.0, 0.01)
    joint = log(tmp_path / "a.csv", "indicated", t, np.mod(30.0 * t, 360.0))
    laser = log(tmp_path / "b.csv", "reference", t[::2] + 0.003, np.mod(30.0 * t[::2], 360.0))
    found = ta.join(joint, laser)
    assert found.offset_s == 0.0
    assert any("one speed only" in note for note in found.notes)
    apart = log(tmp_path / "c.csv", "reference", t + 500.0, np.mod(30.0 * t, 360.0))
    with pytest.raises(ArgumentError, match=r"share no time.*`offset_s=`"):
        ta.join(joint, apart)


def test_a_log_on_change_is_held_in_its_pauses(tmp_path):
    step = 0.05
    t = np.arange(0.0, 60.0, 0.01)
    s = np.arange(0.0, 60.0, 0.02)

    def angle(time):
        return np.clip(100.0 * np.sin(0.3 * time), -60.0, 60.0)

    monitored = np.round(angle(s) / step) * step
    changed = np.flatnonzero(np.diff(monitored, prepend=np.inf) != 0.0)
    joint = log(tmp_path / "a.csv", "indicated", t, angle(t))
    epics = log(tmp_path / "b.csv", "reference", s[changed] + 7.0, monitored[changed])
    found = ta.join(joint, epics, offset_s=7.0, rate_ppm=0.0)
    assert found.on_change == ("reference",)
    assert not found.gaps
    error = found.runs[0].indicated - found.runs[0].reference
    # One step each way and the rounding; a line over a pause would be off by 40 deg.
    assert np.abs(error).max() < 2.5 * step
    # Uniform over a step, and nothing else: the clocks are declared and nothing is interpolated.
    assert found.std_arcsec == pytest.approx(3600.0 * step / np.sqrt(12.0), rel=1e-6)
    assert np.std(error) < step / np.sqrt(12.0)
    estimated = ta.join(joint, epics)
    assert estimated.offset_s == pytest.approx(7.0, abs=0.01)
    assert any("repeats itself" in note for note in estimated.notes)


def test_the_command_writes_runs_and_tells_what_it_did(tmp_path, capsys):
    joint, laser = logs(tmp_path, 1)
    text = joint.read_text().replace("time_s,indicated_deg", "t [s],enc (deg)")
    joint.write_text(text)
    output = tmp_path / "runs.csv"
    signals = ["--signal", "a.time=t", "--signal", "indicated=ENC"]
    assert main(["join", str(joint), str(laser), "-o", str(output), "--json", *signals]) == 0
    found = json.loads(capsys.readouterr().out)
    assert {"offset_s", "rate_ppm", "std_arcsec", "gaps"} <= found.keys()
    (run,) = ta.read_runs(output)
    assert len(run) == found["readings"]
    assert main(["join", str(joint), str(laser), "-o", str(joint), *signals]) == 1  # an input


def test_a_reversed_sensor_is_joined_and_written_as_such(tmp_path):
    joint, laser = logs(tmp_path, 1)
    time, angle = np.loadtxt(joint, delimiter=",", skiprows=1).T
    plain = ta.join(joint, laser).runs[0]
    signals = {"indicated": ("-indicated_deg", "deg")}
    found = ta.join(log(joint, "indicated", time, -angle), laser, signals=signals).runs[0]
    np.testing.assert_array_equal(found.indicated, plain.indicated)
    assert (plain.indicated_sign, found.indicated_sign) == (1, -1)
    output = tmp_path / "runs.csv"
    given = ["--signal", "indicated=-indicated_deg"]
    assert main(["join", str(joint), str(laser), "-o", str(output), *given]) == 0
    (run,) = ta.read_runs(output)
    np.testing.assert_array_equal(run.indicated, found.indicated)
    assert run.indicated_sign == -1
    with pytest.raises(FileError, match="column 'encoder': no such column"):
        ta.join(joint, laser, signals={"indicated": "-encoder"})


def test_logs_that_cannot_be_joined(tmp_path):
    joint, laser = logs(tmp_path, 1)
    with pytest.raises(ArgumentError, match=r"one log must hold indicated_deg"):
        ta.join(joint, joint)
    bare = tmp_path / "bare.csv"
    bare.write_text("reference_deg\n1\n2\n3\n4\n5\n")
    with pytest.raises(FileError, match=r"bare\.csv.*no column time_s"):
        ta.join(joint, bare)
    with pytest.raises(ArgumentError, match="have a reference at their time"):
        ta.join(joint, laser, offset_s=1e6, rate_ppm=0.0)
    with pytest.raises(FileError, match=r"did you mean 'indicated_deg'"):
        ta.join(joint, laser, signals={"indicated": "indicatd_deg"})
