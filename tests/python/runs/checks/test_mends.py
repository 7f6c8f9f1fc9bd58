"""What a check says to do, done word for word: then it has nothing more to say of it."""

import re
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.runs.checks.check import data_faults
from trueangle.runs.checks.record import Record

SEED = 28_411


def sound(seed=SEED):
    """Three runs that are right, of unlike length and travel."""
    rng = np.random.default_rng(seed)
    runs = []
    for k, (count, span) in enumerate(((400, 340.0), (300, 350.0), (360, 330.0))):
        angle = 5.0 * k + np.sort(rng.uniform(0.0, span, count))
        error = 0.1 * np.cos(np.radians(angle)) + 0.002 * rng.normal(size=count)
        runs.append(Record(f"run {k}", angle, angle + error, time=angle / 20.0))
    return runs


def chosen(record, rows):
    """The record with some of its readings, in their order."""
    names = ("reference", "indicated", "time")
    return replace(record, **{name: getattr(record, name)[rows] for name in names})


def scaled(record, by):
    return replace(record, reference=record.reference * by, indicated=record.indicated * by)


def without(record, fault):
    return chosen(record, np.delete(np.arange(len(record)), np.array(fault.rows) - 1))


# Each damage of a record, as it happens at a rig.


def in_radians(record):
    return scaled(record, np.pi / 180.0)


def turned_round(record):
    return replace(record, indicated=-record.indicated)


def geared(record):
    return replace(record, indicated=record.indicated * 7.3)


def partly_twice(record):
    twice = np.sort(np.concatenate([np.arange(len(record)), [20, 21, 90]]))
    return chosen(record, twice)


def out_of_order(record):
    rows = np.arange(len(record))
    rows[100:140] = rows[100:140][::-1]
    return chosen(record, rows)


def wrapped(record):
    return replace(record, reference=np.mod(record.reference, 180.0))


def exchanged(record):
    """The column of the joint, which is good, under the name of a reference that is not."""
    rough = np.random.default_rng(SEED).normal(size=len(record))
    return replace(record, reference=record.indicated + 0.1 * rough, indicated=record.reference)


def slipped(record):
    after = np.arange(len(record)) >= len(record) // 3
    return replace(record, indicated=record.indicated + 3.6 * after)


def standing(record):
    ends = record.indicated.copy()
    ends[-60:] = ends[-61]
    return replace(record, indicated=ends)


# Each thing that is said, done to the record it is said of.


def multiplied(record, fault):
    number, _, below = re.fullmatch(r"multiply its angles by (\S+?)(/(pi))?", fault.mend).groups()
    return scaled(record, float(number) / (np.pi if below else 1.0))


def sign_changed(record, fault):
    code = "`signals={'indicated': '-NAME'}`"
    assert fault.mend == f"give {code} to change the sign of one of the two columns"
    return replace(record, indicated=-record.indicated)


def divided(record, fault):
    (number,) = re.match(r"divide the indicated angle by (\S+), or", fault.mend).groups()
    return replace(record, indicated=record.indicated / float(number))


def dropped(record, fault):
    assert fault.mend.startswith(("drop ", "remove these readings"))
    return without(record, fault)


def parted(record, fault):
    """The rows from there: those before are none of this test, which wants one record."""
    assert fault.mend.startswith("give the readings from there another run label")
    return chosen(record, slice(fault.rows[0] - 1, None))


def sorted_by_time(record, fault):
    assert fault.mend.startswith("sort the readings by time")
    return chosen(record, np.argsort(record.time))


def unwrapped(record, fault):
    assert "unwrap it before" in fault.mend
    (period,) = re.search(r"wraps after (\S+) deg", fault.says).groups()
    return replace(record, reference=np.unwrap(record.reference, period=float(period)))


def exchanged_back(record, fault):
    assert fault.mend.startswith("exchange the columns")
    return replace(record, reference=record.indicated, indicated=record.reference)


CASES = {
    "mixed_units": (in_radians, multiplied),
    "wrong_sign": (turned_round, sign_changed),
    "wrong_gear_ratio": (geared, divided),
    "duplicate_rows": (partly_twice, dropped),
    "unsorted_time": (out_of_order, sorted_by_time),
    "wrapped_reference": (wrapped, unwrapped),
    "saturated_travel": (standing, dropped),
    "missed_counts": (slipped, parted),
}


def told(records):
    return [fault.fault for fault in data_faults(records)]


@pytest.mark.parametrize("place", range(3))
@pytest.mark.parametrize("fault", CASES)
def test_what_it_says_to_do_mends_it(fault, place):
    print("seed", SEED)
    damaged, remedied = CASES[fault]
    records = sound()
    assert told(records) == []
    records[place] = damaged(records[place])
    (found,) = [f for f in data_faults(records) if f.fault == fault]
    assert found.runs == (f"run {place}",)
    records[place] = remedied(records[place], found)
    assert told(records) == []


def test_channels_of_all_runs_that_are_exchanged_are_exchanged_back():
    records = [exchanged(record) for record in sound()]
    (found,) = data_faults(records)
    assert found.fault == "swapped_channels"
    assert told([exchanged_back(record, found) for record in records]) == []


def test_of_runs_that_are_there_twice_one_is_kept():
    records = sound()
    records.append(replace(records[1], label="run 1 again"))
    (found,) = data_faults(records)
    assert found.mend == "read only the first of them: add --run '!run 1 again'"
    for label in found.runs:
        assert told([r for r in records if r.label == label or r.label not in found.runs]) == []


UNITS = (1.0, 2.0 * np.pi, 4096.0)


def runs_of(period: float = 360.0, sign: float = 1.0) -> list[ta.CalibrationRun]:
    """Two runs there and back, at two speeds and loads, remounted, one of them with a jump."""
    scale, found = sign * period / 360.0, []
    for k, speed in enumerate((10.0, 40.0)):
        rng = np.random.default_rng(68_000 + k)
        time = np.linspace(0.0, 1000.0 / speed, 400)
        theta = 500.0 - np.abs(500.0 - speed * time)
        error = 0.1 * np.sin(np.radians(theta)) + 1e-3 * rng.normal(size=400)
        if k:
            error[230:] += 5.0
        found.append(
            ta.CalibrationRun(
                scale * np.mod(theta, 360.0), scale * np.mod(theta + error, 360.0), period,
                time=time, label=f"r{k}", velocity=scale * speed * np.sign(500.0 - speed * time),
                temperature=np.linspace(20.0, 22.0 + k, 400), torque=np.full(400, 3.0 * k),
                mount=np.full(400, scale * 90.0 * k),
            )
        )  # fmt: skip
    return found


def plain(value: object) -> object:
    """Numbers to eight digits, in place."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return float(f"{value:.8g}") + 0.0 if isinstance(value, float) else value


@pytest.mark.parametrize("period", UNITS)
def test_every_unit_gives_one_check(period: float) -> None:
    assert plain(ta.check(runs_of(period)).to_dict()) == plain(ta.check(runs_of()).to_dict())


def test_what_was_moved_and_measured_is_told() -> None:
    told = ta.check(runs_of()).to_dict()
    assert (told["readings"], told["runs"]) == (800, 2)
    assert told["turns"] == pytest.approx(500.0 / 360.0, rel=0.01)
    assert (told["speeds"], told["loads"], told["mounts"]) == (
        [10.0, 40.0],
        [0.0, 3.0],
        [0.0, 90.0],
    )
    assert told["temperatures"] == pytest.approx([20.0, 22.5], abs=0.02)
    assert told["swept"] == ["temperature"]
    # Without a velocity the speed is the way gone over the time, there and back.
    silent = [replace(run, velocity=None) for run in runs_of()]
    assert ta.check(silent).extent.speeds == pytest.approx((10.0, 40.0), rel=0.01)
    # The run without a jump: beyond a turn as well.
    assert ta.check(runs_of()[:1]).ratio == pytest.approx(1.0, abs=5e-4)
    mirrored = ta.check(runs_of(sign=-1.0)).to_dict()
    assert mirrored["ratio"] == pytest.approx(told["ratio"])
    assert mirrored["usable"] == told["usable"]
    assert [f["fault"] for f in mirrored["data_faults"]] == [
        f["fault"] for f in told["data_faults"]
    ]
    backwards = ta.check(runs_of()[::-1]).to_dict()
    assert backwards["ratio"] == pytest.approx(told["ratio"])
    assert sorted(f["fault"] for f in backwards["data_faults"]) == sorted(
        f["fault"] for f in told["data_faults"]
    )
