"""Whoever is refused is told the command that helps, and it works as it is printed."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, KindError, NoModelError, NotInvertibleError
from trueangle.simulation import (
    Backlash,
    Harmonic,
    Joint,
    Latency,
    Outliers,
    RunDesign,
    Simulation,
    TimePeriodic,
)

NOISE = 1.0

#: Times the noise that a correction of all that was hidden may leave, of readings held out.
LEFT = 1.15

BELIEVED = Simulation(
    Joint(100.0, "circular_spline", "motor"),
    harmonics=(Harmonic("output", 1, 30.0, 40.0),),
    sigma_arcsec=NOISE,
    runs=tuple(
        RunDesign(label=f"{v:g} deg/s", samples=300, speed_deg_s=v, turns=2.0, reversals=(0.5,))
        for v in (5.0, 12.0, 30.0)
    ),
)
TRUE = Simulation(
    BELIEVED.joint,
    (*BELIEVED.harmonics, Harmonic("motor", 2, 9.0, 70.0)),
    (Backlash(25.0), Latency(4e-4)),
    NOISE,
    BELIEVED.runs,
)


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    BELIEVED.save(tmp_path / "joint.toml")
    ta.write_runs(ta.simulate(TRUE, seed=21), "runs.csv")
    return tmp_path


def rms_arcsec(model: ta.HarmonicModel, runs: list[ta.CalibrationRun]) -> float:
    left = []
    for run in runs:
        fixed = model.correct(run.indicated, velocity=run.speed, direction=run.direction)
        error = fixed - run.reference
        left.append(3600.0 * (error - error.mean()))
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))


def test_the_shaft_that_a_plan_asks_for_is_taken(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["plan", "--positions", "36", "--orders", "worm:1,2"]
    assert main(words) == 1
    assert "add --shaft worm=CYCLES" in capsys.readouterr().err
    assert main([*words, "--shaft", "worm=40", "--json"]) == 0
    assert {*json.loads(capsys.readouterr().out)["noise_factors"]} == {"40", "80"}
    assert main(["plan", "--orders", "motor:1"]) == 1
    assert "give --gear-ratio, or " in (said := capsys.readouterr().err)
    assert "--shaft motor=CYCLES" in said
    assert main(["plan", "--orders", "motor:1", "--shaft", "motor=57"]) == 0


# -- a correction without a model to begin with --------------------------------------


def test_what_is_confirmed_is_a_model_by_itself(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["diagnose", "runs.csv", "--simulation", "joint.toml", "--corrected-model", "m.json"]
    assert main(command) == 0
    assert "\nCorrection model: m.json" in capsys.readouterr().out
    model = ta.load_model("m.json")
    assert set(model.orders) == {1.0, 200.0}
    assert {term.kind for term in model.terms} == {"backlash", "latency"}
    assert model.argument == "reference"
    assert model.fit is not None
    assert model.fit.samples == 900
    assert model.fit.runs == 3
    assert [source.file for source in model.provenance.inputs] == ["runs.csv"]
    held_out = ta.simulate(TRUE, seed=22)
    assert rms_arcsec(model, held_out) < LEFT * NOISE
    # In Python the same, from the readings that were diagnosed.
    found = ta.diagnose(ta.read_runs("runs.csv"), ta.load_simulation("joint.toml"))
    assert found.correction() == model
    assert found.correction(None, ta.read_runs("runs.csv")) == model


def test_other_arguments_of_a_correction_are_refused(desk: Path) -> None:
    found = ta.diagnose(ta.simulate(TRUE, seed=24), BELIEVED)
    with pytest.raises(KindError, match="model must be a trueangle"):
        found.correction(ta.simulate(TRUE, seed=24))  # type: ignore[arg-type]
    log = ta.simulate(BELIEVED, seed=24)
    on_log = ta.diagnose(ta.simulate(TRUE, seed=24), simulated=log)
    with pytest.raises(ArgumentError, match="known as a log only"):
        on_log.correction()


def test_a_log_cannot_be_corrected_by_a_model(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["diagnose", "runs.csv", "--simulated", "joint.csv", "--corrected-model", "m.json"]
    ta.write_runs(ta.simulate(BELIEVED, seed=25), "joint.csv")
    assert main(words) == 1
    assert "--extend FILE" in capsys.readouterr().err


@pytest.mark.parametrize("effects", [(), (TimePeriodic(0.7, 12.0),), (Outliers(0.02, 90.0),)])
def test_where_nothing_can_be_taken_off_the_diagnosis_is_all(
    effects: tuple[object, ...], desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = Simulation(sigma_arcsec=NOISE, runs=BELIEVED.runs)
    plain.save(desk / "plain.toml")
    ta.write_runs(ta.simulate(plain.with_effects(effects), seed=26), "plain.csv")  # type: ignore[arg-type]
    command = ["diagnose", "plain.csv", "--simulation", "plain.toml", "--json"]
    assert main([*command, "--corrected-model", "m.json"]) == 1
    shown = capsys.readouterr()
    names = [finding["cause"] for finding in json.loads(shown.out)["findings"]]
    assert names == [effect.kind for effect in effects]  # type: ignore[attr-defined]
    assert not Path("m.json").exists()
    assert shown.err.count("\n") == 1
    assert "no confirmed cause can be corrected" in shown.err
    assert all((e.title or e.kind) in shown.err for e in effects)  # type: ignore[attr-defined]
    assert ("--extend FILE" if effects else "measure") in shown.err
    with pytest.raises(NoModelError, match="no confirmed cause can be corrected"):
        ta.diagnose(ta.read_runs("plain.csv"), plain).correction()


# -- a diagnosis is told whatever becomes of what follows ----------------------------

STEEP = Simulation(
    harmonics=(Harmonic("output", 40, 7200.0, 10.0),),
    sigma_arcsec=NOISE,
    runs=tuple(RunDesign(samples=400, speed_deg_s=v, turns=2.0) for v in (5.0, 20.0)),
)


@pytest.mark.parametrize("form", [[], ["--json"]])
def test_a_correction_too_steep_loses_no_diagnosis(
    form: list[str], desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ta.write_runs(ta.simulate(STEEP, seed=31), "steep.csv")
    words = ["diagnose", "steep.csv", "--gear-ratio", "1", "--fixed-member", "none", *form]
    assert main(words) == 0
    alone = capsys.readouterr().out
    assert main([*words, "--corrected-model", "m.json"]) == 1
    shown = capsys.readouterr()
    assert shown.out == alone
    assert shown.err.count("\n") == 1
    assert "|error'| may reach" in shown.err
    assert not Path("m.json").exists()
    with pytest.raises(NotInvertibleError):
        ta.diagnose(ta.read_runs("steep.csv"), Simulation()).correction()


@pytest.mark.parametrize("option", ["--extend", "--corrected-model"])
def test_a_place_that_takes_no_file_loses_no_diagnosis(
    option: str,
    desk: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The disk is full; the other file is written all the same."""
    import trueangle.model.model as model
    import trueangle.simulation.simulation as simulation

    def full(self: object, path: object) -> None:
        raise OSError(28, "No space left on device", str(path))

    owner = simulation.Simulation if option == "--extend" else model.HarmonicModel
    monkeypatch.setattr(owner, "save", full)
    files = {"--extend": "better.toml", "--corrected-model": "m.json"}
    words = [word for pair in files.items() for word in pair]
    assert main(["diagnose", "runs.csv", "--simulation", "joint.toml", *words]) == 1
    shown = capsys.readouterr()
    assert "1. " in shown.out
    assert "No space left" in shown.err
    for name, path in files.items():
        assert Path(path).exists() == (name != option)


# -- refusals name a command that works ----------------------------------------------


def one_run(theta: np.ndarray, error: np.ndarray, label: str = "a  b") -> list[ta.CalibrationRun]:
    """A run whose label, as a file's name, needs quotes."""
    time = 0.01 * np.arange(theta.size)
    return [ta.CalibrationRun(theta, theta + error / 3600.0, 360.0, time=time, label=label)]


def noise() -> list[ta.CalibrationRun]:
    rng = np.random.default_rng(41)
    theta = np.sort(rng.uniform(0.0, 720.0, 500))
    return one_run(theta, rng.normal(0.0, 2.0, theta.size))


def wandering() -> list[ta.CalibrationRun]:
    """Play and a lag beside a walk in one run: orders do not hold from stretch to stretch."""
    rng = np.random.default_rng(43)
    there = np.linspace(0.0, 1000.0, 600)
    theta = np.concatenate([there, there[::-1]])
    way = np.repeat([1.0, -1.0], 600)
    walk = np.cumsum(rng.normal(0.0, 1.0, theta.size))
    return one_run(theta, 300.0 * way + walk + rng.normal(0.0, 2.0, theta.size))


def steep() -> list[ta.CalibrationRun]:
    rng = np.random.default_rng(44)
    theta = np.sort(rng.uniform(0.0, 720.0, 1500))
    return one_run(theta, 10_800.0 * np.sin(24.0 * np.radians(theta)))


def coarse() -> list[ta.CalibrationRun]:
    theta = np.arange(0.0, 360.0, 10.0)
    return one_run(theta, 300.0 * np.sin(np.radians(theta)))


def few() -> list[ta.CalibrationRun]:
    theta = np.arange(0.0, 360.0, 33.0)
    return one_run(theta, np.random.default_rng(6).normal(0.0, 5.0, theta.size))


def three() -> list[ta.CalibrationRun]:
    return one_run(np.arange(3.0), np.arange(3.0) ** 2)


#: What is refused: readings, the command, words of the message, the command that helps.
REFUSALS: dict[str, tuple[Callable[[], list[ta.CalibrationRun]], str, str, str]] = {
    "no order": (noise, "fit R -o m.json", "no order is above the noise", "diagnose"),
    "no order, few readings": (few, "fit R -o m.json", "take 20 readings", "plan"),
    "no order, 3 readings": (three, "fit R -o m.json", "1 zero need 4 readings", "plan"),
    "no order, a gear": (
        noise, "fit R -o m.json --gear-ratio 50.5 --fixed-member none",
        "no order is above the noise", "diagnose",
    ),
    "too steep": (steep, "fit R -o m.json --orders 24", "may reach", "fit"),
    "too steep, diagnosed": (
        steep, "diagnose R --gear-ratio 1 --corrected-model m.json",
        "may reach", "diagnose",
    ),
    "aliases": (coarse, "fit R -o m.json --orders 1,37", "cannot be", "orders"),
    "not told apart, other names": (
        coarse, "fit R -o m.json --orders 1,37 --signal indicated=indicated_deg:deg",
        "cannot be distinguished from", "orders",
    ),
    "no heads": (noise, "selfcal R -o m.json --method heads", "two heads", "plan"),
    "no motion to calibrate by, a gear": (
        noise, "selfcal R -o m.json --method heads --gear-ratio 50.5",
        "two heads", "plan",
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "words",
    [
        ["fit", "{}", "-o", "o.json"], ["check", "{}"], ["watch", "{}", "-m", "m.json"],
        ["correct", "{}", "-m", "m.json", "-o", "o.csv"], ["simulate", "{}", "-o", "o.csv"],
        ["diagnose", "runs.csv", "--simulation", "{}"],
    ],
    ids=lambda words: words[0],
)  # fmt: skip
def test_a_model_or_fleet_in_place_of_another_file_is_named_with_its_use(
    words: list[str], desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fit", "runs.csv", "-o", "m.json", "--orders", "1-2"]) == 0
    assert main(["fleet", "runs.csv", "--by", "run", "-o", "f.json", "--orders", "1-2"]) == 0
    is_simulation = words[0] in ("simulate", "diagnose")
    wanted = "a simulation" if is_simulation else "readings"
    for name, what, use in (
        ("m.json", "a correction model", "correct LOG --model m.json --output OUT"),
        ("f.json", "a fleet", "fit RUNS --prior f.json"),
    ):
        capsys.readouterr()
        assert main([name if word == "{}" else word for word in words]) == 1
        said = f"{name}: is {what}, not {wanted}; it is used by trueangle {use}"
        assert capsys.readouterr().err == f"trueangle: error: {said}\n"
        typed = use.replace("LOG", "runs.csv").replace("OUT", "o.csv").replace("RUNS", "runs.csv")
        assert main([*typed.split(), *(["-o", "n.json"] if what == "a fleet" else [])]) == 0


@pytest.mark.parametrize("columns", ["60", "100"])
@pytest.mark.parametrize("name", ["indicated_deg", "motor encoder left", 'the "enc"'])
@pytest.mark.parametrize("minus", ["", "-"])
def test_the_option_that_changes_a_sign_works(
    name: str, minus: str, columns: str, desk: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Whole in a line, however narrow the terminal, with the unit where it was given."""
    monkeypatch.setenv("COLUMNS", columns)
    x = np.linspace(0.0, 350.0, 60)
    quoted = name.replace('"', '""')
    y = -x if minus == "" else x
    rows = [f"{p},{q}" for p, q in zip(x, y, strict=True)]
    Path("r.csv").write_text("\n".join([f'reference_deg,"{quoted}"', *rows]) + "\n")
    unit = "" if name == "indicated_deg" else ":deg"
    words = ["check", "r.csv", "--signal", f"indicated={minus}{name}{unit}"]
    assert main(words) == 1
    said = capsys.readouterr().out
    (line,) = [line for line in said.splitlines() if "--signal" in line]
    option = shlex.split(line[line.index("--signal") :])[:2]
    assert option == ["--signal", f"indicated={'' if minus else '-'}{name}:deg"]
    assert main(["check", "r.csv", *option]) == 0
    assert f"'{option[1][10:-4]}' in deg" in " ".join(capsys.readouterr().out.split())
    assert main(["fit", "r.csv", "-o", "m.json", "--orders", "1", *words[2:]]) == 1
    assert option[1] in shlex.split(capsys.readouterr().err.partition(": error: ")[2])
    assert main(["fit", "r.csv", "-o", "m.json", "--orders", "1", *option]) == 0


def test_columns_of_a_simulators_log_are_named_by_an_option_that_works(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = Path("runs.csv").read_text()
    for name, ref, enc in (("a.csv", "laser", "q 1"), ("b.csv", "true", "seen")):
        head = text.replace("reference_deg", ref, 1).replace("indicated_deg", enc, 1)
        Path(name).write_text(head)
    named = ["--signal", "reference=laser:deg", "--signal", "indicated=q 1:deg"]
    words = ["diagnose", "a.csv", *named]
    assert main([*words, "--simulated", "b.csv"]) == 1
    said = capsys.readouterr().err
    assert "another named with --signal simulated.reference=NAME:UNIT)" in said
    assert "; --signal ROLE=NAME is of the runs only, for the same names add --signal sim" in said
    assert main([*words, "--simulated", "a.csv"]) == 1
    added = shlex.split(capsys.readouterr().err.split("same names add ")[1])
    named = ["simulated.reference=laser:deg", "simulated.indicated=q 1:deg"]
    assert added == ["--signal", named[0], "--signal", named[1]]
    assert main([*words, "--simulated", "a.csv", *added[:2]]) == 1
    rest = shlex.split(capsys.readouterr().err.split("same names add ")[1])
    assert rest == added[2:]
    assert main([*words, "--simulated", "a.csv", *added]) == 0


@pytest.mark.parametrize("name", ['my "ref" []', "it's [x]", "pos act", 'ref "'])
def test_a_unit_that_is_missing_is_told_as_an_option_that_works(
    name: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ta.read_runs("runs.csv")
    quoted = name.replace('"', '""')
    rows = [f"{x},{y}" for x, y in zip(runs[0].reference, runs[0].indicated, strict=True)]
    Path("r.csv").write_text("\n".join([f'"{quoted}",indicated_deg', *rows]) + "\n")
    words = ["fit", "r.csv", "-o", "m.json", "--orders", "1", "--signal"]
    assert main([*words, f"reference={name}"]) == 1
    said = capsys.readouterr().err
    assert "its unit is not known; give it: --signal " in said
    option = shlex.split(said.split("give it: ")[1])
    assert option == ["--signal", f"reference={name}:deg"]
    assert main([*words, option[1]]) == 0
    # A wrong one is refused with the right one.
    words[-1:] = ["--signal", option[1], "--signal", "indicated=indicated_deg:rad"]
    assert main(words) == 1
    advice = capsys.readouterr().err.split("give --signal ")[1].strip()
    assert main([*words[:-1], advice.replace("NAME", "indicated_deg")]) == 0


@pytest.mark.parametrize("what", REFUSALS)
def test_the_command_that_is_named_works(
    what: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    readings, line, told, command = REFUSALS[what]
    words = line.split()
    ta.write_runs(readings(), "two  blanks.csv")
    assert main(["two  blanks.csv" if word == "R" else word for word in words]) == 1
    said = capsys.readouterr().err
    assert told in said
    program, *again = shlex.split(said.split("; run: ")[1])
    assert (program, again[0]) == ("trueangle", command)
    if "--gear-ratio" in words:  # of the same joint
        before, after = (float(by[by.index("--gear-ratio") + 1]) for by in (words, again))
        assert after == before
    assert main(again) == 0
    assert capsys.readouterr().out


def test_where_a_fit_is_refused_the_diagnosis_writes_what_it_confirms(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ta.write_runs(
        ta.simulate(
            Simulation(effects=(Backlash(60.0),), sigma_arcsec=2.0, runs=BELIEVED.runs), seed=45
        ),
        "play.csv",
    )
    assert main(["fit", "play.csv", "-o", "m.json"]) == 1
    said = capsys.readouterr().err
    assert "--corrected-model FILE" in said
    again = shlex.split(said.split("; run: ")[1])[1:]
    assert main([*again, "--corrected-model", "m.json"]) == 0
    (term,) = ta.load_model("m.json").terms
    assert term.kind == "backlash"
    assert term.half_width == pytest.approx(60.0 / 3600.0, rel=0.05)  # type: ignore[attr-defined]


def test_nothing_believed_needs_a_joint_and_a_joint_no_file(
    desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["diagnose", "runs.csv"]) == 1
    advice = capsys.readouterr().err.split("run: trueangle ")[1]
    assert main(shlex.split(advice)) == 0
    capsys.readouterr()
    assert main(["diagnose", "runs.csv", "--simulation", "joint.toml", "--gear-ratio", "3"]) == 1
    assert "the simulation states the joint" in capsys.readouterr().err
    assert main(["diagnose", "runs.csv", "--gear-ratio", "100", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    orders = [
        f["parameters"]["output_order"]["value"]
        for f in found["findings"]
        if f["cause"] == "missing_order"
    ]
    assert 200.0 in orders


@pytest.mark.parametrize(
    ("command", "name"),
    [
        ("report R --orders 1 -o", "r.txt"),
        ("plot R --orders 1 -o", "p.xyz"),
        ("fit R --orders 1 -o", "m.mdl"),
        ("correct R -m M -o", "x.yyy"),
        ("export M --to c -o", "t.inc"),
        ("export M --to moteus -o", "t.toml"),
    ],
)
def test_the_name_that_an_unknown_ending_should_have_is_taken(
    command: str, name: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0).save("m.json")
    words = [{"R": "runs.csv", "M": "m.json"}.get(word, word) for word in command.split()]
    if words[0] == "report":
        pytest.importorskip("matplotlib")
    assert main([*words, name]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"{name}: the ending .{name[2:]} " in said
    assert not (desk / name).exists()
    better = said.rpartition("; name it ")[2].strip()
    assert main([*words, better]) == 0
    assert (desk / better).is_file()


@pytest.mark.parametrize("units", [":deg", ":count", ""])
def test_two_channels_in_one_file_are_joined_as_it_says(
    units: str, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A log on change: either angle has rows of its own."""
    ending = "" if units else "_deg"
    time = np.arange(300) * 0.1
    theta = 40.0 * time + 30.0 * np.sin(time)
    rows = [f"time_s,reference{ending},indicated{ending}"]
    for t, x in zip(time, theta, strict=True):
        rows += [f"{t:.4f},{x:.6f},", f"{t + 0.037:.4f},,{0.2 + x + 1.48:.6f}"]
    (desk / "two logs.csv").write_text("\n".join(rows) + "\n")
    asked = [f"{role}={role}{units}" for role in ("reference", "indicated") if units]
    words = [word for one in asked for word in ("--signal", one)]
    if units == ":count":
        words += ["--counts-per-turn", "360", "--counts-per-turn-reference", "360"]
    for command in (["check"], ["fit", "-o", "m.json"]):
        assert main([command[0], "two logs.csv", *command[1:], *words]) == 1
        said = capsys.readouterr().err
        assert "the two angles are in separate rows" in said
    program, *again = shlex.split(said.split("; run: ")[1])
    assert (program, again[0]) == ("trueangle", "join")
    assert main(again) == 0
    (run,) = ta.read_runs(again[again.index("-o") + 1])
    assert len(run) > 290


@pytest.mark.parametrize(
    ("order", "words", "steps"),
    [
        (400, "minicheetah", 1),
        (400, "linuxcnc", 1),
        (100, "linuxcnc", 0),
        (40, "linuxcnc --stop 720", 0),
        (40, "linuxcnc --stop 720 --entries 180", 1),
        (40, "linuxcnc --entries 60", 1),
        (100, "tinymovr", 1),
        (5000, "tinymovr", 1),
        (100, "simplefoc", 1),
        (300, "moteus", 1),
        (200, "csv", 1),
        (300, "pmac --counts-per-turn 65536", 0),
        (300, "pmac --counts-per-turn 65536 --entries 512", 1),
        (900, "twincat", 1),
        (40, "c --entries 16 --bits 12", 1),
    ],
)
def test_the_entries_or_the_target_that_is_advised_works(
    order: int, words: str, steps: int, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shaft = ta.Shaft("output", 1, [1, order], [0.1, 0.0], [0.0, 1e-4])
    ta.HarmonicModel([shaft], period=360.0).save("m.json")
    target, *more = words.split()
    for _ in range(steps):
        assert main(["export", "m.json", "-o", "t.txt", "--to", target, *more]) == 1
        advice = re.search(r": use --(\w+) (\w+)", capsys.readouterr().err)
        assert advice is not None
        if advice[1] == "to":
            target, more = advice[2], []
        elif "--entries" in more:
            more[more.index("--entries") + 1] = advice[2]
        else:
            more += ["--entries", advice[2]]
    assert main(["export", "m.json", "-o", "t.txt", "--to", target, *more]) == 0


@pytest.mark.parametrize("amplitude", [12.0, 40.0, 55.0])
@pytest.mark.parametrize("target", ["c", "rust"])
def test_a_steep_model_is_exported_without_options(
    target: str, amplitude: float, desk: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shaft = ta.Shaft("output", 1, [1, 2], [amplitude, 0.0], [0.0, 0.3])
    ta.HarmonicModel([shaft], period=360.0).save("m.json")
    words = ["export", "m.json", "--to", target, "-o", "t.txt", "--bits", "12"]
    assert main(words) == 0
    assert main([*words, "--max-arcsec", "300"]) == 0
    assert main([*words, "--number", "q15", "--method", "cubic"]) == (amplitude > 11.25)
    said = capsys.readouterr().err
    if said:
        advice = re.search(r"; use --number (\w+)", said)
        assert advice is not None
        assert main([*words, "--method", "cubic", "--number", advice[1]]) == 0
