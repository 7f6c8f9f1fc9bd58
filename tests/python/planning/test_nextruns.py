"""Further runs within limits: what they are, what they are said to tell, and what is refused."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError
from trueangle.joint.signals import join_runs
from trueangle.planning import Limits, load_limits, scales
from trueangle.planning.nextruns import plainest_run, run_choices, run_seconds, run_steps
from trueangle.planning.scales import DesignScales
from trueangle.planning.worth import NOTHING
from trueangle.simulation import (
    Backlash,
    Harmonic,
    Joint,
    LocalDefect,
    RunDesign,
    Simulation,
    simulate,
)
from trueangle.support import deadline

#: An arm of 270 degrees, out and back at one speed.
SIM = Simulation(
    harmonics=(Harmonic("output", 1, 14.0, 240.0),),
    sigma_arcsec=1.0,
    runs=(
        RunDesign("a", start_deg=-135.0, turns=1.5, reversals=(0.5,)),
        RunDesign("b", start_deg=-135.0, turns=1.5, reversals=(0.5,)),
    ),
)
RUNS = simulate(SIM.with_effects([Backlash(3.0)]), 11)


@pytest.fixture(scope="module")
def found():
    return ta.diagnose(RUNS, SIM)


@pytest.fixture(scope="module")
def plan(found):
    return found.plan()


def test_limits_without_any_are_the_arc_and_the_levels_that_were_seen():
    limits = Limits.of_runs(RUNS)
    assert limits.arc_deg == pytest.approx((-135.0, 135.0), abs=2.0)
    assert limits.speed_deg_s == (1.0, 60.0)
    assert limits.temperature_C == (20.0, 20.0)
    assert limits.torque_Nm == (0.0, 0.0)
    assert limits.mount_deg == (0.0,)
    whole = Limits.of_runs(simulate(Simulation(runs=(RunDesign(start_deg=77.0),))))
    assert whole.arc_deg == (0.0, 360.0)
    logged = Simulation(runs=(RunDesign(samples=5000), RunDesign(samples=700)))
    assert Limits.of_runs(simulate(logged)).samples == 2000
    assert Limits.of_runs(simulate(logged)[1:]).samples == 700
    back = replace(RUNS[1], reference=RUNS[1].reference + 720.0)
    assert Limits.of_runs([RUNS[0], back]).arc_deg == limits.arc_deg


def test_a_little_beyond_is_warmer_loaded_and_remounted():
    wider = Limits.of_runs(RUNS).wider()
    assert wider.temperature_C == (20.0, 35.0)
    assert wider.torque_Nm == (-10.0, 10.0)
    assert set(wider.mount_deg) == {0.0, 130.0, 250.0}


def test_play_and_a_delay_are_told_by_another_speed(plan):
    assert not plan.beyond
    assert not plan.alone
    (design,) = plan.runs
    assert design.speed_deg_s != 5.0
    assert plan.readings == design.samples < 360
    first = plan.between[0]
    assert first.causes == ("backlash", "latency")
    assert first.seen
    assert first.told
    assert first.chance_named >= 0.95


def test_every_run_stays_within_limits(plan):
    limits = Limits.of_runs(RUNS)
    design = plainest_run(limits, "x")
    options = [option for options in run_choices(limits) for option in options]
    assert len(options) > 8
    for run in (*plan.runs, *(replace(design, **option) for option in options)):
        measured = simulate(Simulation(), 0, [run])[0]
        low, high = measured.reference.min(), measured.reference.max()
        assert limits.arc_deg[0] - 1e-6 <= low
        assert high <= limits.arc_deg[1] + 1e-6
        speed = np.abs(measured.velocity)
        assert speed.min() >= 1.0 - 1e-9
        assert speed.max() <= 60.0
        # The time that is told is that of the simulated run, to one reading: of a run that
        # coasts to a quarter of its speed the last takes 2.2 times the mean.
        assert measured.time[-1] == pytest.approx(run_seconds(run), rel=2.2 / run.samples)
        assert any(f"read {run.samples} times" in step for step in run_steps(run))


def test_designs_that_were_weighed_are_worth_what_they_were(found, plan, monkeypatch):
    """And of two that tell as much the shorter and plainer one is worth more."""
    weighed, known = DesignScales.weighed, []

    def anew(self, designs, start, changes=0, least=NOTHING):
        known.append(len(self._known))
        self._known.clear()
        worth = weighed(self, designs, start, changes, least)
        assert worth.seconds == pytest.approx(-sum(run_seconds(design) for design in designs))
        assert worth.plain == -changes
        return worth

    monkeypatch.setattr(DesignScales, "weighed", anew)
    assert found.plan().to_dict() == plan.to_dict()
    assert max(known) == 1


def test_designs_that_cannot_be_better_cost_no_evidence(found, plan, monkeypatch):
    weighed, between, asked = DesignScales.weighed, scales.evidence_between, []

    def counted(*args):
        asked.append(1)
        return between(*args)

    def in_full(self, designs, start, changes=0, least=NOTHING):
        return weighed(self, designs, start, changes)

    monkeypatch.setattr(scales, "evidence_between", counted)
    assert found.plan().to_dict() == plan.to_dict()
    bounded = len(asked)
    monkeypatch.setattr(DesignScales, "weighed", in_full)
    assert found.plan().to_dict() == plan.to_dict()
    assert bounded < 0.7 * (len(asked) - bounded)


def test_without_reversals_none_is_planned(found):
    one_way = found.plan(replace(Limits.of_runs(RUNS), reversals=False))
    assert all(not run.reversals for run in one_way.runs)


def test_where_no_run_tells_there_is_none(found):
    still = found.plan(
        replace(Limits.of_runs(RUNS), speed_deg_s=(5.0, 5.0)), between=["thermal_drift"]
    )
    assert still.runs == ()
    assert "no run within the limits" in still.notes[0]
    assert "not distinguished: thermal_drift" in still.summary()


def test_what_was_not_seen_is_opened_a_little_beyond(found):
    warm = found.plan(between=["thermal_drift"])
    assert warm.between[0].told
    assert any("C" in text for text in warm.beyond)


def test_the_object_printed_keeps_the_contract(plan, tmp_path):
    told = json.loads(plan.to_json())
    assert {"runs", "between"} <= set(told)
    assert {"label", "speed_deg_s"} <= set(told["runs"][0])
    designs = [
        RunDesign(**{key: tuple(v) if isinstance(v, list) else v for key, v in run.items()})
        for run in told["runs"]
    ]
    assert tuple(designs) == plan.runs
    usual = RunDesign()
    for run in told["runs"]:
        # Beside the three that are always told only what is not as usual.
        others = run.keys() - {"label", "speed_deg_s", "samples"}
        assert not [key for key in others if run[key] == getattr(usual, key)]
    assert {"causes", "expected_bic", "chance_named"} <= set(told["between"][0])
    plan.save(tmp_path / "designs.toml")
    again = ta.load_simulation(tmp_path / "designs.toml")
    assert again.runs == plan.runs
    assert len(simulate(again)[0]) == plan.readings


def test_the_summary_is_a_table_for_the_rig(plan, found):
    text = plan.summary()
    assert "next-1" in text
    assert "- move " in text
    assert "distinguishes latency from" in " ".join(text.split())
    assert "Next: 1 run of" in found.summary()


@pytest.mark.parametrize(
    ("seconds", "told"),
    [(0.6, "1 s"), (119.4, "119 s"), (120.0, "2 min"), (179.0, "3 min"), (5971.0, "100 min")],
)
def test_the_time_of_motion_is_to_the_nearest_second_or_minute(plan, seconds, told):
    assert f" in all, {told} of motion" in replace(plan, seconds=seconds).summary()


def test_what_one_run_shows_is_shared_out_over_as_many_as_hold_out_each_other():
    """Of ten runs a diagnosis holds out two at a time: these must not be all that tell."""
    sim = replace(SIM, runs=tuple(RunDesign(f"{k}", samples=60, torque_Nm=5.0) for k in range(10)))
    limits = Limits(torque_Nm=(0.0, 10.0), gravity_Nm=10.0, samples=120)
    plan = ta.diagnose(simulate(sim, 2), sim).plan(limits, between=["stiffening_compliance"])
    assert plan.between[0].told
    assert len(plan.runs) > 2
    assert plan.readings <= 120 + len(plan.runs)
    assert len({replace(run, label="") for run in plan.runs}) == 1
    assert f"next-{len(plan.runs)}, {len(plan.runs)} times the same" in plan.summary()


def test_a_form_that_a_grid_leaves_open_is_asked_of_two_runs():
    """With one of them held out the other still tells it."""
    grid = RunDesign(samples=36, spacing="uniform")
    mounts = (0.0, 130.0, 250.0)
    grids = [replace(grid, label=f"{k}", mount_deg=mounts[k // 2]) for k in range(6)]
    sim = replace(SIM, joint=Joint(50.0, "circular_spline", "motor"), runs=tuple(grids))
    runs = simulate(sim.with_effects([LocalDefect(284.7, 4.3, 24.0)]), 1)
    plan = ta.diagnose(runs, sim).plan(between=["missing_order", "local_defect"])
    assert plan.between[0].told
    assert [run.spacing for run in plan.runs] == ["jittered", "jittered"]
    assert plan.readings < 100


def test_runs_by_themselves_tell_a_lag_with_any_speed_left_out():
    """Of two speeds each alone leaves the lag to the size of the lines."""
    lines = (*SIM.harmonics, Harmonic("motor", 2, 10.0, 20.0))
    sim = replace(SIM, joint=Joint(50.0, "circular_spline", "motor"), harmonics=lines)
    bare = [replace(run, velocity=None, time=None) for run in simulate(sim, 1)]
    plan = ta.diagnose(bare, sim).plan(Limits(samples=120, reversals=False), between=["filter_lag"])
    assert plan.alone
    assert plan.between[0].told
    assert len({run.speed_deg_s for run in plan.runs}) == 3


def test_a_file_of_limits(tmp_path):
    path = tmp_path / "limits.toml"
    path.write_text(
        "[limits]\narc_deg = [-90, 90]\nmount_deg = [0, 130]\nsamples = 100\nreversals = false\n"
    )
    limits = load_limits(path)
    assert limits.arc_deg == (-90.0, 90.0)
    assert limits.mount_deg == (0.0, 130.0)
    assert (limits.samples, limits.reversals) == (100, False)


WRONG = {
    "a table": ("[limit]\n", "unknown table 'limit'"),
    "none": ("", r"no table \[limits\]"),
    "a key": ("[limits]\nspeed = 3\n", "unknown key 'speed'"),
    "no TOML": ("[limits\n", "not a TOML file"),
    "a text": ("[limits]\narc_deg = 'all'\n", "arc_deg must be a list of finite numbers"),
    "three": ("[limits]\narc_deg = [0, 1, 2]\n", "arc_deg must be two finite numbers"),
    "turned": ("[limits]\ntorque_Nm = [1, 0]\n", "the least before the most"),
    "empty": ("[limits]\narc_deg = [1, 1]\n", "must have a length"),
    "at rest": ("[limits]\nspeed_deg_s = [0, 1]\n", "speed_deg_s must be positive"),
    "negative": ("[limits]\ngravity_Nm = -1\n", "gravity_Nm must not be negative"),
    "no mount": ("[limits]\nmount_deg = []\n", "mount_deg must be finite numbers"),
    "few": ("[limits]\nsamples = 3\n", "samples must be at least 20"),
    "none at all": ("[limits]\nruns = 0\n", "runs must be at least 1"),
    "a half": ("[limits]\nruns = 1.5\n", "runs must be a whole number"),
    "perhaps": ("[limits]\nreversals = 1\n", "reversals must be true or false"),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_file_that_is_none_is_refused(what, tmp_path):
    text, said = WRONG[what]
    path = tmp_path / "limits.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=said):
        load_limits(path)


def test_readings_that_lack_a_column_are_left_out_where_it_tells(found):
    blind = [replace(run, temperature=None) for run in RUNS]
    plan = ta.diagnose(blind, SIM).plan(between=["thermal_drift"])
    assert plan.alone
    assert "diagnose them alone" in plan.summary()


def test_signals_that_follow_are_those_of_all_runs_together():
    whole, parts = join_runs(RUNS), [join_runs([run]) for run in RUNS]
    joined = parts[0].followed_by(parts[1])
    for name in ("theta", "run", "segment", "segment_length", "velocity", "temperature", "clock"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    assert joined.labels == whole.labels
    lacking = replace(parts[1], temperature=None)
    assert parts[0].followed_by(lacking).temperature is None


@pytest.fixture
def desk(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    SIM.save("joint.toml")
    ta.write_runs(RUNS, "runs.csv")
    return tmp_path


def test_the_command_prints_and_writes(desk, capsys):
    arguments = ["plan", "--after", "runs.csv", "--simulation", "joint.toml", "--seeds", "1"]
    assert main([*arguments, "--json", "-o", "designs.toml"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["between"][0]["causes"] == ["backlash", "latency"]
    assert main(["simulate", "designs.toml", "-o", "next.csv"]) == 0
    assert main(["diagnose", "runs.csv", "--simulation", "joint.toml", "--plan", "next.toml"]) == 0
    assert "Runs to measure next: next.toml" in capsys.readouterr().out
    assert ta.load_simulation("next.toml").runs
    capsys.readouterr()
    assert main(["plan", "--after", "runs.csv"]) == 1
    assert "--after needs the assumed joint: --simulation FILE" in capsys.readouterr().err
    assert main(["plan", "--between", "backlash,latency"]) == 1
    assert "add --after RUNS" in capsys.readouterr().err


def test_a_diagnosis_with_nothing_open_writes_no_plan(desk, capsys):
    ta.write_runs(simulate(SIM, 3), "fine.csv")
    asked = ["diagnose", "fine.csv", "--simulation", "joint.toml", "--plan", "next.toml"]
    assert main(asked) == 1
    assert "no further run would distinguish" in capsys.readouterr().err
    assert not (desk / "next.toml").exists()


def test_what_cannot_be_planned_is_refused():
    with pytest.raises(ArgumentError, match="did you mean backlash"):
        ta.plan_after(RUNS, SIM, between=["backlas"])
    with pytest.raises(ArgumentError, match="no causes to distinguish"):
        ta.plan_after(RUNS, SIM, between=[])
    with pytest.raises(ArgumentError, match="seeds must be a whole number from 0"):
        ta.plan_after(RUNS, SIM, seeds=-1)


def test_a_plan_comes_to_an_end_by_itself_and_says_so(found, plan, monkeypatch):
    assert plan.notes == ()
    monkeypatch.setattr(deadline, "LEAST", 1e-6)
    monkeypatch.setattr(deadline, "PER_ITEM", 0.0)
    assert found.plan().notes[-1] == "the search was ended early"


@pytest.mark.parametrize("gravity", [0.0, 3.0])
@pytest.mark.parametrize("torque", [(0.0, 0.0), (2.0, 5.0), (-5.0, -2.0), (-2.0, 5.0)])
def test_loads_are_the_least_and_the_extremes_and_a_weight_hangs_alone(torque, gravity) -> None:
    limits = Limits(torque_Nm=torque, gravity_Nm=gravity)
    kinds = [kind for kind in run_choices(limits) if "torque_Nm" in kind[0]]
    if torque[0] == torque[1] and not gravity:
        assert not kinds
        return
    (loads,) = kinds
    pairs = [(choice["torque_Nm"], choice["gravity_Nm"]) for choice in loads]
    least = min(torque, key=abs) if torque[0] * torque[1] > 0.0 else 0.0
    assert pairs[0] == (least, 0.0)
    assert plainest_run(limits, "x").torque_Nm == least
    hung = [(0.0, gravity)] if gravity else []
    assert sorted(pairs) == sorted({(load, 0.0) for load in (least, *torque)} | set(hung))
    assert len(set(pairs)) == len(pairs)


@pytest.mark.parametrize("slow", [5.0, 20.0, 60.0])
def test_speeds_are_both_ends_and_the_middle_and_a_coast_stays_within(slow) -> None:
    limits = Limits(speed_deg_s=(slow, 60.0))
    (speeds,) = (kind for kind in run_choices(limits) if "speed_deg_s" in kind[0])
    steady = [c["speed_deg_s"] for c in speeds if c["speed_end_deg_s"] is None]
    coasts = [c["speed_end_deg_s"] for c in speeds if c["speed_end_deg_s"] is not None]
    assert steady[0] == 60.0
    assert {slow, 60.0} <= set(steady)
    assert all(slow <= speed <= 60.0 for speed in steady)
    assert coasts == ([max(15.0, slow)] if slow < 60.0 else [])


@pytest.mark.parametrize(("cold", "warm"), [(20.0, 20.0), (15.0, 40.0)])
def test_temperatures_are_both_ends_and_the_way_between(cold, warm) -> None:
    limits = Limits(temperature_C=(cold, warm))
    kinds = [kind for kind in run_choices(limits) if "temperature_C" in kind[0]]
    told = [(c["temperature_C"], c["temperature_end_C"]) for c in itertools.chain(*kinds)]
    assert told == ([(cold, None), (warm, None), (cold, warm)] if cold < warm else [])


@pytest.mark.parametrize("with_current", [True, False])
def test_mounts_and_currents_are_asked_for_where_there_are_several(with_current) -> None:
    limits = Limits(mount_deg=(0.0, 130.0), current_A=(0.0, 2.0))
    kinds = [*run_choices(limits, with_current)]
    assert [{"mount_deg": 0.0}, {"mount_deg": 130.0}] in kinds
    assert ([{"current_A": 0.0}, {"current_A": 2.0}] in kinds) == with_current
    one = [*run_choices(Limits(mount_deg=(40.0,), current_A=(1.0, 1.0)))]
    assert not any({"mount_deg", "current_A"} & {*kind[0]} for kind in one)
