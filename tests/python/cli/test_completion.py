"""Completion of commands and options, asked of the shells themselves."""

import math
import os
import pty
import select
import shutil
import subprocess
import sys
import time

import pytest

from trueangle.cli import COMMANDS, build_parser, main
from trueangle.cli.completion import SHELLS, completion_script
from trueangle.cli.parser import GROUPS

#: Lines typed so far, and words of which each must be offered, and some that must not.
TYPED = {
    "trueangle dia": ({"diagnose"}, {"demo"}),
    "trueangle fit --lo": ({"--loss"}, {"--orders"}),
    "trueangle fit --loss ": ({"huber", "tukey"}, {"--loss", "cluster"}),
    "trueangle diagnose --ext": ({"--extend"}, {"--loss"}),
    "trueangle check --signal ref": ({"reference=", "reference_offset="}, {"indicated="}),
    "trueangle completion ": ({"bash", "zsh", "fish"}, {"fit"}),
}


def shell(name):
    path = shutil.which(name)
    if path is None:
        pytest.skip(f"no {name} installed")
    return path


@pytest.fixture
def saved(tmp_path):
    def write(name):
        file = tmp_path / f"completion.{name}"
        file.write_text(completion_script(build_parser(), name))
        return file

    return write


@pytest.mark.parametrize("line", TYPED)
def test_bash_offers_what_fits(line, saved):
    words = line.split(" ")
    quoted = " ".join(f"'{word}'" for word in words)
    asked = (
        f"source {saved('bash')}; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; "
        '_trueangle; printf "%s\\n" "${COMPREPLY[@]}"'
    )
    offered = run([shell("bash"), "--norc", "-c", asked])
    assert_offered(line, set(offered.split()))


@pytest.mark.parametrize("line", TYPED)
def test_fish_offers_what_fits(line, saved, tmp_path):
    asked = f"source {saved('fish')}; complete -C '{line}'"
    offered = run([shell("fish"), "--no-config", "-c", asked], HOME=str(tmp_path))
    assert_offered(line, {row.split("\t")[0] for row in offered.splitlines()})


def test_zsh_completes_as_somebody_types(saved, tmp_path):
    path = shell("zsh")
    file = saved("zsh")
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(tmp_path)
        os.execve(path, [path, "-f"], {"TERM": "dumb", "PATH": os.environ["PATH"], "PS1": "> "})
    try:
        typed(terminal, f"autoload -Uz compinit; compinit -u -D; source {file}; echo re''ady\n")
        answered(terminal, "ready")
        typed(terminal, "trueangle fit --lo\t h\t")
        assert "huber" in answered(terminal, "huber")
    finally:
        os.kill(process, 9)
        os.waitpid(process, 0)
        os.close(terminal)


def typed(terminal, text):
    os.write(terminal, text.encode())


def answered(terminal, word):
    """What the terminal shows until ``word`` appears, or what it did in 20 s."""
    seen, until = "", time.monotonic() + 20.0
    while word not in seen and time.monotonic() < until:
        if select.select([terminal], [], [], 0.1)[0]:
            seen += os.read(terminal, 65536).decode(errors="replace")
    return seen


def run(command, **environment):
    done = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ | environment
    )
    assert done.stderr == ""
    return done.stdout


def assert_offered(line, offered):
    wanted, unwanted = TYPED[line]
    assert wanted <= offered
    assert not unwanted & offered


@pytest.mark.parametrize("name", SHELLS)
def test_a_script_knows_every_command_and_option(name, capsys):
    assert main(["completion", name]) == 0
    text = capsys.readouterr().out
    for command, parser in build_parser().commands.items():
        assert command in text
        for action in parser._actions:
            for flag in action.option_strings:
                assert flag.lstrip("-") in text


def test_an_unknown_shell_is_answered_with_the_one_meant(capsys):
    with pytest.raises(SystemExit):
        main(["completion", "bsh"])
    assert "did you mean bash?" in capsys.readouterr().err


@pytest.mark.parametrize("command", COMMANDS)
def test_help_is_grouped(command):
    parser = build_parser().commands[command]
    parser.format_help()  # puts them in order
    groups = {group.title: group for group in parser._action_groups if group._group_actions}
    assert list(groups)[-1] == "other"
    assert "options" not in groups
    assert "positional arguments" not in groups
    known = [title for title in groups if title in GROUPS]
    assert known == [title for title in GROUPS if title in groups]
    for action in parser._actions:
        if "--output" in action.option_strings or "--json" in action.option_strings:
            assert action in groups["output"]._group_actions


def test_a_command_that_is_called_alone_has_its_arguments():
    """The others are there by name; what they can be asked takes long to import."""
    parser = build_parser(["fit", "runs.csv"])
    assert list(parser.commands) == list(COMMANDS)
    assert "--orders" in parser.commands["fit"]._option_string_actions
    assert "--method" not in parser.commands["selfcal"]._option_string_actions
    assert parser.format_help() == build_parser().format_help()


#: Packages whose import takes longer than a small command runs; what a help must not load too.
HEAVY = {"pyarrow", "pandas", "numpy.ma", "trueangle.effects"}
ARRAYS = {"numpy", "statistics", "dataclasses", "trueangle.export"}
ARRAYS |= {"json", "shlex", "shutil", "threading"}
#: What a small fit must not load: `shutil` loads every library that packs.
FIT_HEAVY = HEAVY | {"trueangle.export", "trueangle.joint.pattern", "shutil", "gzip", "shlex"}


@pytest.mark.parametrize(
    ("command", "heavy", "most"),
    [
        ("--help", HEAVY | ARRAYS, 49),
        ("fit --help", HEAVY | ARRAYS, 26),
        ("plan --help", HEAVY | ARRAYS, 27),
        ("selfcal --help", HEAVY | ARRAYS, 28),
        ("completion zsh", HEAVY, 120),
        ("fit runs.csv -o model.json", FIT_HEAVY, 121),
        ("fit runs.csv --orders 1-4 -o model.json", FIT_HEAVY, 113),
    ],
)
def test_small_work_starts_without_what_it_does_not_need(command, heavy, most, tmp_path):
    """Modules of this package are counted: each takes 0.4 ms, which adds up unnoticed."""
    rows = "".join(f"{x},{x + 0.1 * math.cos(math.radians(x))}\n" for x in range(0, 360, 10))
    (tmp_path / "runs.csv").write_text("reference_deg,indicated_deg\n" + rows)
    script = (
        "import sys\nfrom trueangle.cli import main\n"
        "try:\n    main(sys.argv[1:])\nexcept SystemExit:\n    pass\n"
        "print(*sys.modules, file=sys.stderr)"
    )
    words = [sys.executable, "-c", script, *command.split()]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    loaded = done.stderr.splitlines()[-1].split()
    assert not heavy & {*loaded}
    mine = [name for name in loaded if name.startswith("trueangle.")]
    assert 10 < len(mine) <= most, mine
