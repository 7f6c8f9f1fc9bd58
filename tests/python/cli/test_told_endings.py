"""The last line of a command, to the letter: what went wrong, what an interruption left undone."""

import contextlib
import signal
import subprocess
import sys
import time
import weakref
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.cli.ending import Ending
from trueangle.errors import ArgumentError, TrueAngleError

DEFECT = "; this is a defect of trueangle: please report this line and what --debug prints"


class Panic(BaseException):
    """As a panic of the core arrives."""


HAS_TIMER = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="has no timer")

#: Errors of a command and the line that is told of each.
TOLD = {
    "error: of two parts": TrueAngleError("of two  \n  parts"),
    "error: --errors-in must be one": ArgumentError("errors_in must be one"),
    "error: give --joint arm": ArgumentError("give `joint=arm`"),
    "error: first is none": TrueAngleError("first is none"),
    "error: out of memory (no more is available); take fewer readings at a time, or "
    "--one-pass where the command has it": MemoryError(),
    "error: out of memory (1 GiB); take fewer readings at a time, or --one-pass where the command "
    "has it": MemoryError("1 GiB"),
    "error: a library cannot be loaded: libx; is there memory enough for it?": ImportError("libx"),
    "error: a.csv: No such file": OSError(2, "No such file", "a.csv"),
    "error: b.csv: No such file": OSError(2, "No such file", b"b.csv"),
    "error: -: No such file; name /dev/stdin to read a pipe": OSError(2, "No such file", "-"),
    "error: 7: Bad number": OSError(9, "Bad number", 7),
    "error: [Errno 28] No space left": OSError(28, "No space left"),
    "error: none of it": OSError("none of it"),
    f"error: unexpected Panic: lost{DEFECT}": Panic("lost"),
    f"error: unexpected ZeroDivisionError: by 0{DEFECT}": ZeroDivisionError("by 0"),
    "interrupted": KeyboardInterrupt(),
    "interrupted: 3 of 7 are done": KeyboardInterrupt("3 of 7 are done"),
}


@pytest.fixture
def models(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.1])
    ta.HarmonicModel([shaft], period=360.0).save("m.json")
    return ["compare", "m.json", "m.json"]


@pytest.mark.parametrize("line", TOLD)
def test_an_error_is_one_line(line, models, monkeypatch, capsys):
    def broken(*_):
        raise TOLD[line]

    monkeypatch.setattr("trueangle.export.comparison.compare", broken)
    assert main(models) == (130 if line.startswith("interrupted") else 1)
    assert capsys.readouterr().err == f"trueangle: {line}\n"


def ignored(number):
    """Python ignores what a callback of a weak reference raises; h5py has one in every object."""

    class Held:
        pass

    held = Held()
    _known = weakref.ref(held, lambda _: signal.raise_signal(number))
    del held
    time.sleep(60.0)


def cleared(number):
    """As pyarrow does with what comes in its import."""
    with contextlib.suppress(BaseException):
        signal.raise_signal(number)
    time.sleep(60.0)


def misnamed(number):
    """As numpy names what ends its import."""
    try:
        signal.raise_signal(number)
    except BaseException:
        raise ImportError("its installation is broken") from None


@pytest.mark.parametrize(
    "reach",
    [
        signal.raise_signal,
        misnamed,
        pytest.param(ignored, marks=HAS_TIMER),
        pytest.param(cleared, marks=HAS_TIMER),
    ],
)
@pytest.mark.parametrize(
    ("name", "status"),
    [
        ("SIGTERM", 143),
        *([("SIGHUP", 129)] if hasattr(signal, "SIGHUP") else []),
        ("SIGINT", 130),
    ],
)
def test_a_signal_is_told_with_its_status(name, status, reach, models, monkeypatch, capsys):
    number = getattr(signal, name)
    monkeypatch.setattr("trueangle.export.comparison.compare", lambda *_: reach(number))
    before = signal.getsignal(number)
    if name != "SIGINT":
        signal.signal(number, signal.SIG_DFL)  # under nohup it is ignored
    try:
        ours, hook = signal.getsignal(number), sys.unraisablehook
        began = time.monotonic()
        assert main(models) == status
        assert time.monotonic() - began < 10.0
        assert (signal.getsignal(number), sys.unraisablehook) == (ours, hook)
    finally:
        signal.signal(number, before)
    by = "" if name == "SIGINT" else f" by {name}"
    assert capsys.readouterr().err == f"trueangle: interrupted{by}\n"
    assert (Ending().status, Ending().text) == (130, "interrupted")


#: A signal that comes while a module is looked for.
IMPORTING = """\
import signal, sys
class Moment:
    def find_spec(name, *_):
        if name == {module!r}:
            signal.raise_signal(signal.{name})
sys.meta_path.insert(0, Moment)
"""
#: One that comes in the work of `compare`.
WORKING = """\
import signal
import trueangle.export.comparison
def compare(*_):
    {work}
trueangle.export.comparison.compare = compare
"""
STARTING = """import _signal, sys
class Early:
    def find_spec(self, name, *_):
        name.startswith("trueangle") or _signal.raise_signal(_signal.SIGINT)
sys.meta_path.insert(0, Early())"""
FROM_TEXT = WORKING.format(work="exec('signal.raise_signal(signal.SIGTERM)')")
TWICE = WORKING.format(
    work="""try: signal.raise_signal(signal.SIGTERM)
    finally: signal.raise_signal(signal.SIGINT)"""
)


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="has no processes that signals end")
@pytest.mark.parametrize(
    ("moment", "status", "told"),
    [
        (STARTING, -signal.SIGINT, ""),
        (IMPORTING.format(module="argparse", name="SIGINT"), -signal.SIGINT, ""),
        (IMPORTING.format(module="argparse", name="SIGTERM"), -signal.SIGTERM, ""),
        (IMPORTING.format(module="trueangle.cli.compare", name="SIGINT"), 130, ""),
        (IMPORTING.format(module="trueangle.cli.compare", name="SIGTERM"), 143, " by SIGTERM"),
        (IMPORTING.format(module="numpy.linalg", name="SIGHUP"), 129, " by SIGHUP"),
        (FROM_TEXT, 143, " by SIGTERM"),
        (TWICE, -signal.SIGINT, ""),
    ],
)
def test_a_process_ends_by_a_signal_at_any_moment(moment, status, told, models):
    code = f"{moment}\nfrom trueangle.__main__ import start\nstart()"
    done = subprocess.run([sys.executable, "-c", code, *models], capture_output=True, text=True)
    line = f"trueangle: interrupted{told}\n" if status > 0 else ""
    assert (done.returncode, done.stdout, done.stderr) == (status, "", line)


def test_a_reader_that_has_gone_is_told_nothing(models, monkeypatch, capsys):
    def gone(_):
        raise BrokenPipeError(32, "Broken pipe")

    monkeypatch.setattr(sys.stdout, "write", gone)
    assert main(models) == 141
    assert capsys.readouterr().err == ""


@pytest.fixture
def interrupted(monkeypatch):
    """Commands that were ended early find that their account is what it is."""

    @contextlib.contextmanager
    def ending():
        yield SimpleNamespace(happened=True)

    found = SimpleNamespace(
        to_json=lambda *_: "{}", summary=lambda *_, **__: "What is known.", complete=False
    )
    for module in ("rehearse", "diagnose"):
        monkeypatch.setattr(f"trueangle.cli.{module}.ending_early", ending)
    monkeypatch.setattr("trueangle.rehearsal.rehearse", lambda *_, **__: found)
    monkeypatch.setattr("trueangle.diagnosis.diagnose", lambda *_, **__: found)
    return found


@pytest.mark.parametrize(
    ("more", "complete", "told"),
    [
        ([], False, "the account so far is incomplete"),
        ([], True, "the account is complete"),
        (["--extend", "e.toml"], True, "the account is complete, and e.toml not written"),
        (["--plan", "p.toml", "--extend", "e.toml", "--corrected-model", "c.json"], False,
         "the account so far is incomplete, and e.toml and p.toml and c.json not written"),
    ],
)  # fmt: skip
def test_a_diagnosis_that_was_interrupted_tells_what_it_left(
    more, complete, told, interrupted, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    interrupted.complete = complete
    (tmp_path / "a.csv").write_text("reference_deg,indicated_deg\n0,0\n90,90\n180,180\n")
    assert main(["diagnose", "a.csv", "--gear-ratio", "3", *more]) == 130
    out, err = capsys.readouterr()
    assert (out, err) == ("What is known.\n", f"trueangle: interrupted: {told}\n")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("plot", [[], ["--plot", "p.svg"]])
def test_a_rehearsal_that_was_interrupted_tells_what_it_left(
    plot, interrupted, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text("[joint]\ngear_ratio = 3.0\n[[run]]\nsamples = 9\n")
    assert main(["rehearse", "s.toml", *plot]) == 130
    more = ", and p.svg not written" if plot else ""
    told = f"trueangle: interrupted: the account so far is incomplete{more}\n"
    assert capsys.readouterr() == ("What is known.\n", told)


@pytest.mark.parametrize("runs", [0, 2])
def test_a_plan_without_runs_is_told_and_not_written(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.csv").write_text("reference_deg,indicated_deg\n0,0\n90,90\n180,180\n")
    (tmp_path / "s.toml").write_text("[joint]\ngear_ratio = 3.0\n[[run]]\nsamples = 9\n")
    plan = SimpleNamespace(
        runs=[1] * runs, summary=lambda: "What next.", save=lambda path: print(f"saved {path}")
    )
    monkeypatch.setattr("trueangle.rehearsal.after.plan_after", lambda *_, **__: plan)
    line = ["plan", "--after", "a.csv", "--simulation", "s.toml", "-o", "n.toml"]
    assert main(line) == (0 if runs else 1)
    no = "trueangle: error: n.toml is not written: no run found; allow wider limits or more time\n"
    wanted = ("What next.\nsaved n.toml\n", "") if runs else ("What next.\n", no)
    assert capsys.readouterr() == wanted


@pytest.mark.parametrize(
    ("more", "terminal", "asked"),
    [([], True, "auto"), (["--json"], True, "json"), (["--json"], False, "auto"),
     (["--json", "--progress", "text"], True, "text")],
)  # fmt: skip
def test_progress_is_json_where_a_terminal_is_told_json(more, terminal, asked, models, monkeypatch):
    given = {}

    def corrected(*_, progress, **__):
        given["progress"] = progress
        raise ArgumentError("enough")

    monkeypatch.setattr("trueangle.logs.batch.correct_logs", corrected)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    (_, model, _) = models
    Path("a.csv").write_text("indicated_deg\n1\n")
    assert main(["correct", "a.csv", "-m", model, "-o", "b.csv", *more]) == 1
    assert given == {"progress": asked}


THETA = np.linspace(0.0, 720.0, 400)


def write(path, runs):
    """Runs in degrees with these labels, each its own; without labels one that has none."""
    names = ["run"] if runs else []
    rows = [
        ",".join(
            [
                *([label] if label else []),
                repr(t + k),
                repr(float(t + k + 0.1 * np.sin(np.radians(t)))),
            ]
        )
        for k, label in enumerate(runs or [""])
        for t in THETA.tolist()
    ]
    path.write_text("\n".join([",".join([*names, "reference_deg", "indicated_deg"]), *rows]) + "\n")
    return path


def told(arguments, capsys):
    assert main([str(a) for a in arguments]) == 1
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    return text


def test_a_run_is_asked_for_where_there_are_none(tmp_path, capsys):
    runs = write(tmp_path / "r.csv", [])
    text = told(["fit", runs, "-o", tmp_path / "m.json", "--run", "x"], capsys)
    assert "no column 'run'" in text
    assert "None" not in text


def test_a_mistyped_run_is_answered_with_the_one_meant(tmp_path, capsys):
    runs = write(tmp_path / "r.csv", ["slow-forth", *(f"r{k}" for k in range(30))])
    text = told(["fit", runs, "-o", tmp_path / "m.json", "--run", "slow-fort"], capsys)
    assert "did you mean slow-forth?" in text
    assert "and 19 more" in text


@pytest.mark.parametrize("command", ["fit", "report"])
def test_a_mistyped_shaft_is_answered_with_the_one_meant(command, tmp_path, capsys):
    runs = write(tmp_path / "r.csv", [])
    text = told([command, runs, "-o", tmp_path / "x", "--orders", "moter:1"], capsys)
    assert "there is no shaft 'moter'; the shafts are " in text
    assert text.endswith("; did you mean motor?\n")
    assert "shafts=" not in text


#: Columns of runs whose indicated angle moves otherwise than the reference: unit of both,
#: the indicated angle by the true one in degrees, and what is said of it.
MOVES = {
    "a gear": (360.0, lambda x: 7.3 * x, "7.3 times as far .* ratio 73/10 .* divide it by 7.3"),
    "a gear, in turns": (1.0, lambda x: 7.3 * x / 360, "7.3 times .* ratio 73/10"),
    "a gear, other way": (360.0, lambda x: -50.0 * x, "ratio 50 .* the other way"),
    "radians": (360.0, np.radians, "looks like radians in a column of degrees"),
    "turns": (360.0, lambda x: x / 360.0, "looks like turns in a column of degrees"),
    "degrees": (2 * np.pi, lambda x: x, "looks like degrees in a column of radians"),
    "other way": (1.0, lambda x: -x / 360.0, "runs backwards: change its sign"),
    # Neither can be told from its readings: nothing is guessed.
    "too fast to follow": (360.0, lambda x: 100.0 * x, "check units, sign, gear ratio"),
    "unrelated": (
        360.0,
        lambda x: np.random.default_rng(5).uniform(0.0, 360.0, x.size),
        "check units, sign, gear ratio",
    ),
}


# Another unit wraps at its own turn, not at that of its column.
@pytest.mark.parametrize(
    ("case", "wraps"),
    [
        (c, w)
        for c in MOVES
        for w in (False, True)
        if not (w and c in ("radians", "degrees", "turns"))
    ],
)
def test_what_moves_otherwise_is_told_by_its_measured_ratio(case, wraps):
    period, indicated, said = MOVES[case]
    reference, indicated = THETA * period / 360.0, indicated(THETA)
    if wraps:
        reference, indicated = reference % period, indicated % period
    with pytest.raises(ArgumentError, match=said):
        ta.fit(ta.CalibrationRun(reference, indicated, period=period), orders=[1])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--outptu", "m.json"], "unrecognized arguments: --outptu; did you mean --output?"),
        (["--outptu=m.json"], "--outptu; did you mean --output?"),
        (["--order", "1"], "required: -o/--output"),  # a beginning of --orders
        (["--gear-ratoi", "-5"], "--gear-ratoi; did you mean --gear-ratio?"),
        (["--gear-ratio", "5"], "required: -o/--output"),
        (["--xyzzy", "5"], "required: -o/--output"),
    ],
)
def test_a_mistyped_option_is_told_before_one_that_is_missing(words, says, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["fit", "r.csv", *words])
    assert ended.value.code == 2
    assert says in capsys.readouterr().err.splitlines()[-1]
