"""One text of every message serves both doors: Python names arguments, a command its options."""

import ast
import importlib
import inspect
import json
import pickle
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import COMMANDS, build_parser, main
from trueangle.cli.wording import _COMMANDS, _OPTIONS, Wording
from trueangle.errors import ArgumentError, TrueAngleError
from trueangle.selfcalibration.calibrate import selfcal
from trueangle.support.suggestions import check_choice, did_you_mean

PACKAGE = Path(ta.__file__).parent
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
CODE = re.compile(r"`([^`\n]+)`")
#: Options of other programs, which messages tell to run.
OF_OTHERS = {"--calibrate", "--dump-config", "--back"}

THETA = np.arange(0.0, 720.0, 3.0)
MODEL = ta.HarmonicModel([ta.Shaft("output", 1.0, [1, 3], [0.1, 0.0], [0.2, 0.05])], period=360.0)
RUN = ta.CalibrationRun(THETA, THETA + 0.03 * np.sin(np.radians(THETA)), period=360.0)


def sources():
    for path in sorted(PACKAGE.rglob("*.py")):
        if "cli" not in path.relative_to(PACKAGE).parts:
            yield path, path.read_text()


def messages():
    """Texts of the package outside the commands: strings, with `{}` for what is filled in."""
    for path, source in sources():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.JoinedStr):
                parts = (v.value if isinstance(v, ast.Constant) else "{}" for v in node.values)
                yield path, "".join(map(str, parts))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield path, node.value


#: Commands that are printed whole, to be typed.
TYPED = [
    PACKAGE / "runs" / name
    for name in ("checks/columns.py", "checks/rows.py", "angles.py", "channelangle.py", "files.py")
]
TYPED += [PACKAGE / "export" / "channelform.py"]


def test_no_text_of_the_package_names_an_option():
    found = [
        (path.relative_to(PACKAGE), option)
        for path, source in sources()
        for option in OPTION.findall(source)
        if option not in OF_OTHERS and path not in TYPED
    ]
    assert not found


def parameters():
    """Names of arguments of every function and class of the package."""
    names = set()
    for _, source in sources():
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.FunctionDef):
                names |= {a.arg for a in [*node.args.args, *node.args.kwonlyargs]}
            elif isinstance(node, ast.ClassDef):
                fields = [one.target for one in node.body if isinstance(one, ast.AnnAssign)]
                names |= {field.id for field in fields if isinstance(field, ast.Name)}
    for target in importlib.import_module("trueangle.export.targets").TARGETS.values():
        names |= set(target.options)
    return names


def test_the_python_that_messages_hold_is_python_that_there_is():
    known, seen = parameters(), 0
    for path, text in messages():
        for code in CODE.findall(text):
            called = re.match(r"(?:ta|trueangle)\.([\w.]+)\(", code)
            if called:
                module, _, name = called[1].rpartition(".")
                holder = importlib.import_module(f"trueangle.{module}" if module else "trueangle")
                assert callable(getattr(holder, name)), (path, code)
                assert name in {**_COMMANDS, **dict.fromkeys(COMMANDS)}, (path, code)
            elif re.match(r"[a-z]\w*=", code):
                assert code.partition("=")[0] in known, (path, code)
            else:
                continue
            seen += 1
    assert seen > 50


def test_every_option_of_another_name_is_one():
    options = {action.dest for p in parsers().values() for action in p._actions}
    assert {dest for names in _OPTIONS.values() for dest in names} <= options | {"method"}
    first = {command.split()[0] for command in _COMMANDS.values()}
    assert {word for word in first if word[0] != "-"} <= set(COMMANDS)
    assert {word for word in first if word[0] == "-"} <= set(
        parsers()["diagnose"]._option_string_actions
    )


def parsers():
    return build_parser().commands


def corrected(*args, **kwargs):
    """Logs, or the error of the first of them."""
    for log in ta.correct_logs(*args, **kwargs).logs:
        if log.error is not None:
            raise log.error


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    MODEL.save("m.json")
    ta.write_runs(RUN, "r.csv")
    indicated = RUN.indicated.tolist()
    pairs = list(zip(THETA.tolist(), indicated, strict=True))
    rows = "".join(f"{a},{b}\n" for a, b in pairs)
    Path("q.csv").write_text("my q,b\n" + rows)
    Path("c.csv").write_text("reference_deg,indicated_count\n" + rows)
    Path("twice.csv").write_text("reference_deg,indicated_deg,indicated_rad\n")
    Path("motor.csv").write_text("motor_count,indicated_deg\n" + rows)


#: What is asked by Python; by the command; what Python names; what the command does.
ASKED = {
    "bits": (
        lambda: ta.export_model(MODEL, "c", bits=99),
        "export m.json --to c --bits 99 -o x.h",
        "bits must",
        "--bits must",
    ),
    "bits of another target": (
        lambda: ta.export_model(MODEL, "moteus", bits=25),
        "export m.json --to moteus --bits 25 -o x.cfg",
        "bits must",
        "--bits must",
    ),
    "what is there": (
        lambda: ta.export_model(MODEL, "klipper"),
        "export m.json --to klipper -o x.cfg",
        "`existing=`",
        "--existing,",
    ),
    "an option it lacks": (
        lambda: ta.export_model(MODEL, "c", varriant="a"),
        "export m.json --to c --variant a -o x.h",
        "`varriant=`; it has `bits=`",
        "no option --variant; it has --bits",
    ),
    "too few entries": (
        lambda: ta.export_model(MODEL, "csv", entries=4),
        "export m.json --to csv --entries 4 -o x.csv",
        "`entries=12` or more",
        "--entries 12 or more",
    ),
    "counts": (
        lambda: ta.read_runs("c.csv"),
        "fit c.csv -o x.json",
        "`counts_per_turn=`",
        "give --counts-per-turn",
    ),
    "no column": (
        lambda: ta.read_runs("q.csv"),
        "fit q.csv -o x.json",
        "`signals={'reference': ('NAME', 'UNIT')}`",
        "--signal reference=NAME:UNIT",
    ),
    "no unit": (
        lambda: selfcal("q.csv", signals={"indicated": "my q"}),
        "selfcal q.csv -o x.json --signal",
        "`signals={'indicated': ('my q', 'deg')}`",
        "--signal 'indicated=my q:deg'",
    ),
    "counts of a motor": (
        lambda: selfcal("motor.csv"),
        "selfcal motor.csv -o x.json",
        "`counts_per_turn=`",
        "give --counts-per-turn",
    ),
    "an angle of a log": (
        lambda: corrected("q.csv", MODEL, "o.csv"),
        "correct q.csv -m m.json -o o.csv",
        "name the angle's column with `column=`",
        "name the angle's column with --column",
    ),
    "where to": (
        lambda: ta.correct_logs("r.csv", MODEL),
        "correct r.csv -m m.json",
        "`output=` or `in_place=True`",
        "--output or --in-place",
    ),
    "an angle of a joint": (
        lambda: corrected("q.csv", {"a": MODEL, "b": MODEL}, "o.csv"),
        "correct q.csv -m a=m.json -m b=m.json -o o.csv",
        "`column={'a': 'NAME'}`",
        "--column a=NAME",
    ),
    "a ratio": (
        lambda: ta.fit(RUN, gear_ratio=0.0),
        "fit r.csv -o x.json --gear-ratio 0",
        "gear_ratio must",
        "--gear-ratio must",
    ),
    "a shaft of unknown speed": (
        lambda: ta.fit(RUN, {"motor": [1]}),
        "fit r.csv -o x.json --orders motor:1",
        "`gear_ratio=`, or its cycles per output turn as `shafts={'motor': CYCLES}`",
        "--gear-ratio, or its cycles per output turn as --shaft motor=CYCLES",
    ),
    "a plan": (
        lambda: ta.plan_mounts(7.3),
        "plan --gear-ratio 7.3",
        "`trueangle.planning.plan_encoder(...)`",
        "trueangle plan --reference encoder",
    ),
    "two logs": (
        lambda: ta.join("r.csv", "q.csv"),
        "join r.csv q.csv -o x.csv",
        "`signals={",
        "--signal a.indicated=NAME:UNIT --signal b.reference=NAME:UNIT",
    ),
}


@pytest.mark.parametrize("case", ASKED)
def test_each_door_speaks_its_own_language(case, files, capsys):
    call, line, python, command = ASKED[case]
    with pytest.raises(TrueAngleError) as raised:
        call()
    assert python in str(raised.value)
    assert not OPTION.search(str(raised.value))
    words = line.split() + (["indicated=my q"] if line.endswith("--signal") else [])
    assert main(words) == 1
    told = capsys.readouterr().err.splitlines()[-1]
    assert command in told
    assert "`" not in told
    assert not re.search(r"(?<![-\w.'])\w+=(?!NAME|CYCLES|my q)", told.partition(": error: ")[2])


def test_notes_are_told_as_errors_are(files, capsys):
    made = ta.export_model(MODEL, "mechaduino")
    assert any('`existing="Parameters.cpp"`' in note for note in made.notes)
    assert main(["export", "m.json", "--to", "mechaduino", "-o", "x.cpp"]) == 0
    assert "--existing Parameters.cpp" in capsys.readouterr().out
    assert main(["export", "m.json", "--to", "mechaduino", "-o", "y.cpp", "--json"]) == 0
    out, err = capsys.readouterr()
    import json

    assert any("--existing Parameters.cpp" in note for note in json.loads(out)["notes"])
    assert "--existing Parameters.cpp" in err


def test_an_error_of_another_process_is_told_alike():
    error = pickle.loads(pickle.dumps(ArgumentError("give `gear_ratio=100`")))
    words = Wording()
    assert words(str(error)) == "give `gear_ratio=100`"  # no command yet
    words.parser = parsers()["fit"]
    assert words(str(error)) == "give --gear-ratio 100"


@pytest.mark.parametrize(
    ("command", "text", "told"),
    [
        ("fit", '`signals={"a": {"torque": ("t x", "Nm")}}`', "--signal 'a.torque=t x:Nm'"),
        ("fit", "`orders=range(1, 9)`", "--orders 1-8"),
        ("fit", "`nuisance='auto', gear_ratio=7.3`", "--nuisance auto --gear-ratio 7.3"),
        ("selfcal", "`head_angles=[0, 119.2]`", "--head-angles 0,119.2"),
        ("correct", "`in_place=True`", "--in-place"),
        ("plan", "`method=`", "--self"),
        ("rehearse", "`simulation=`", "SIMULATION"),
        ("fit", "`ta.fit(..., gear_ratio=100)`", "trueangle fit --gear-ratio 100"),
        ("fit", "`trueangle.planning.plan_self('heads')`", "trueangle plan --self heads"),
        # What is no Python of ours stands as it is: names of files and columns.
        ("fit", "run=3/`x`/unit=4", "run=3/`x`/unit=4"),
        ("fit", "`a b`, `bits`, `x=y=z`, `gear_ratio=)`", "`a b`, `bits`, `x=y=z`, `gear_ratio=)`"),
        ("fit", "`unknown=`", "`unknown=`"),
    ],
)
def test_python_becomes_options(command, text, told):
    words = Wording()
    words.parser = parsers()[command]
    assert told in words(text)


#: Words of closed vocabularies, mistyped: by whom they are asked, and which was meant.
MISTYPED = {
    "target": (lambda: ta.export_model(MODEL, "moteuss"), "moteus"),
    "target read": (lambda: ta.import_model("m.json", "simplefock"), "simplefoc"),
    "option": (lambda: ta.export_model(MODEL, "c", entires=8), "entries"),
    "value": (lambda: ta.export_model(MODEL, "c", number="f23"), "f32"),
    "method": (lambda: ta.select_orders(RUN, method="evidnce"), "evidence"),
    "covariance": (lambda: ta.fit(RUN, covariance="custer"), "cluster"),
    "argument": (lambda: ta.fit(RUN, argument="refrence"), "reference"),
    "loss": (lambda: ta.fit(RUN, loss="hubber"), "huber"),
    "solver": (lambda: ta.fit(RUN, orders=[1], method="plian"), "plain"),
    "nuisance": (lambda: ta.fit(RUN, nuisance="rampp"), "ramp"),
    "member": (lambda: ta.fit(RUN, fixed_member="flexsplin"), "flexspline"),
    "loop": (lambda: ta.selfcal("q.csv", loop="opne"), "open"),
    "self-calibration": (lambda: ta.selfcal("q.csv", method="spindown"), "spin-down"),
    "cause": (lambda: ta.rehearse(sim(), causes=["backlsh"]), "backlash"),
    "role": (lambda: ta.read_runs("q.csv", signals={"torqe": "tau"}), "torque"),
    "column": (lambda: ta.read_runs("q.csv", signals={"reference": "my p"}), "my q"),
    "progress": (lambda: ta.diagnose(RUN, sim(), progress="jsn"), "json"),
    "unit of errors": (lambda: ta.fit(RUN, orders=[1]).summary("arcsecs"), "arcsec"),
    "figure": (lambda: ta.fit(RUN, orders=[1]).plot("spectrm"), "spectrum"),
    "plan": (lambda: importlib.import_module("trueangle.planning").plan_self("hedas"), "heads"),
    "term": (lambda: ta.LoadDependentGearError([1], [1], [1], torque="singed"), "signed"),
    "unit": (lambda: corrected("q.csv", MODEL, "o.csv", column="b", unit="degg"), "deg"),
}


def sim():
    design = importlib.import_module("trueangle.simulation").RunDesign("a", 1, 5.0, 60)
    return ta.Simulation(runs=(design,), sigma_arcsec=1.0)


@pytest.mark.parametrize("case", MISTYPED)
def test_a_mistyped_word_is_answered_by_the_nearest(case, files):
    call, meant = MISTYPED[case]
    with pytest.raises(TrueAngleError, match=f"did you mean '?{re.escape(meant)}'?\\?"):
        call()


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("export m.json --to klippr -o x", "klipper"),
        ("import m.json --from linuxnc -o x", "linuxcnc"),
        ("fit r.csv -o x.json --signal torqe=tau", "torque"),
        ("fit r.csv -o x.json --loss hubber", "huber"),
        ("fit r.csv -o x.json --covariance wite", "white"),
        ("plan --self hedas", "heads"),
        ("correct r.csv -m m.json -o x.csv --unit dge", "deg"),
        ("rehearse s.toml --causes backlsh", "backlash"),
        ("fit r.csv -o x.json --nuisance rampp", "ramp"),
    ],
)
def test_a_mistyped_word_of_a_command_too(line, meant, files, capsys):
    Path("s.toml").write_text(
        "[noise]\nsigma_arcsec = 1.0\n[[run]]\nsamples = 60\nspeed_deg_s = 5.0\n"
    )
    try:
        status = main(line.split())
    except SystemExit as ended:
        status = ended.code
    assert status in (1, 2)
    assert f"did you mean {meant}?" in capsys.readouterr().err.splitlines()[-1]


def test_words_are_suggested_by_one_function():
    holders = [path.name for path, source in sources() if "difflib" in source]
    assert holders in (["suggestions.py"], ["columns.py", "suggestions.py"])
    assert did_you_mean("moter", ["output", "motor"]) == "; did you mean motor?"
    with pytest.raises(ArgumentError, match="loop must be one of open, closed, got None"):
        check_choice("loop", None, ("open", "closed"))
    assert inspect.isfunction(check_choice)


def test_a_unit_that_is_wrong_is_told_by_an_option_that_there_is(tmp_path, capsys):
    columns = np.column_stack([THETA, THETA + 0.9 * np.sin(np.radians(THETA))])
    path = tmp_path / "degrees.csv"
    np.savetxt(path, columns, "%.6f", ",", header="reference_rad,indicated_rad", comments="")
    main(["fit", str(path), "-o", str(tmp_path / "m.json"), "--orders", "1"])
    said = capsys.readouterr().err
    assert "give --signal reference=NAME:deg --signal indicated=NAME:deg" in said
    assert "--period" not in said


@pytest.mark.parametrize("name", ['my "ref"', "pos", "it's", '"'])
def test_what_a_command_prints_as_json_stays_json(name):
    """Options with quotes are told, and the JSON around them holds the same text."""
    words = Wording()
    words.parser = parsers()["fit"]
    text = f"give `signals={{'reference': {(name, 'deg')!r}}}`"
    told = words(text)
    assert shlex.split(told) == ["give", "--signal", f"reference={name}:deg"]
    assert json.loads(words(json.dumps({"note": text}))) == {"note": told}
