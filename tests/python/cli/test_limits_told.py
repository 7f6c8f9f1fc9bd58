"""What a help tells of limits is what the command goes by; options of one use only are refused."""

import argparse
import os
import re
from types import SimpleNamespace

import pytest

import trueangle as ta
from trueangle.cli import fit, main, plan
from trueangle.cli.options import refuse_given
from trueangle.cli.signal_options import add_signals
from trueangle.logs.keeping import KEPT, SAMPLE


def after_options():
    parser = argparse.ArgumentParser(add_help=False)
    plan.add_arguments(parser)
    (group,) = [g for g in parser._action_groups if "after" in str(g.title)]
    signals = argparse.ArgumentParser(add_help=False)
    add_signals(signals)
    output = [action for action in parser._actions if action.dest == "output"]
    found = [*group._group_actions, *signals._actions, *output]
    return [action for action in found if action.dest != "after"]


@pytest.mark.parametrize("given", after_options(), ids=lambda action: action.dest)
def test_an_option_of_a_plan_after_a_diagnosis_is_refused_without_one(given):
    """Whichever it is, and by its long name, also where what is given counts as nothing."""
    args = argparse.Namespace(**{action.dest: None for action in after_options()})
    refuse_given(args, plan.OF_AFTER, "is of")
    for value in ("x", 0):
        setattr(args, given.dest, value)
        with pytest.raises(ta.errors.ArgumentError, match=rf"^{given.option_strings[-1]} is of"):
            refuse_given(args, plan.OF_AFTER, "is of")


def test_a_command_refuses_it(capsys):
    for words in (["--seeds", "0"], ["--counts-per-turn", "4096"], ["--topic", "/joints"]):
        assert main(["plan", "--gear-ratio", "100", *words]) == 1
        assert f"{words[0]} is of plans after a diagnosis" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["fit", "orders"])
def test_readings_from_which_on_one_pass_is_made_are_those_that_the_help_tells(
    command, monkeypatch, capsys
):
    with pytest.raises(SystemExit):
        main([command, "--help"])
    text = " ".join(capsys.readouterr().out.split())
    asked, by_itself = (int(n) for n in re.findall(r"more than 2\^(\d+)", text))
    kept = int(re.search(r"some (\d+) 000 of them", text)[1])
    assert asked == KEPT.bit_length() - 1
    assert kept * 1000 == pytest.approx(SAMPLE, rel=0.01)
    limits = []

    def hold_at_most(paths, most, topic):
        limits.append(most)
        return True

    monkeypatch.setattr("trueangle.logs.sources.logs_hold_at_most", hold_at_most)
    args = SimpleNamespace(
        one_pass=False, scheduler=None, runs=["."], topic=None, nuisance="none",
        reference_orders=None, run=None,
    )  # fmt: skip
    assert not fit.wants_one_pass(args)
    assert limits == [1 << by_itself]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have no names here")
def test_a_pipe_is_read_once_and_into_memory(tmp_path):
    """It is not opened to see how much it holds, which would take from it."""
    os.mkfifo(tmp_path / "pipe")
    args = SimpleNamespace(
        one_pass=False, scheduler=None, runs=[str(tmp_path / "pipe")], topic=None, nuisance="none",
        reference_orders=None, run=None,
    )  # fmt: skip
    assert not fit.wants_one_pass(args)


def test_values_that_a_command_cannot_take(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["record", "log.txt", "-o", "c.csv", "--rate", "0"]) == 1
    assert "--rate must be positive, got 0.0" in capsys.readouterr().err
    (tmp_path / "a.csv").write_text("reference_deg,indicated_deg\n0,0.1\n90,90.2\n180,180\n")
    words = ["fit", "a.csv", "-o", "m.json", "--one-pass", "--periods-per-turn", "1"]
    assert main(words) == 1
    message = (
        "--periods-per-turn is for sine and cosine channels, which need all readings: leave "
        "--one-pass out"
    )
    assert message in capsys.readouterr().err
