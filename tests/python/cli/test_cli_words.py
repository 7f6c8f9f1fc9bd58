"""Messages give their own reason, and what to do."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError

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


def test_a_shaft_of_unknown_speed_asks_for_the_ratio(tmp_path, capsys):
    runs = write(tmp_path / "r.csv", [])
    text = told(["fit", runs, "-o", tmp_path / "x", "--orders", "motor:1"], capsys)
    assert "--gear-ratio" in text


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
