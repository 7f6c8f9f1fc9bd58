"""``trueangle completion``: what a shell needs to complete the command line."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from .parser import Parser, declare

HELP = "print a script with which bash, zsh or fish completes commands and options"
EXAMPLE = "trueangle completion bash >~/.local/share/bash-completion/completions/trueangle"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    declare(parser, "shell", tuple(SHELLS), "shell that the script is for")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from . import build_parser

    print(completion_script(build_parser(), args.shell), end="")
    return 0


class _Argument(NamedTuple):
    """What a shell has to know about one argument."""

    flags: tuple[str, ...]
    takes_value: bool
    choices: tuple[str, ...]
    is_file: bool
    help: str
    #: How values may begin; more is typed behind them.
    words: tuple[str, ...] = ()


def completion_script(parser: Parser, shell: str) -> str:
    """The text of a completion script.

    Parameters
    ----------
    parser : Parser
        With its commands.
    shell : str
        One of `SHELLS`.

    Examples
    --------
    >>> from trueangle.cli import build_parser
    >>> completion_script(build_parser(), "zsh").splitlines()[0]
    '#compdef trueangle'
    """
    return "\n".join(SHELLS[shell](parser)) + "\n"


def _arguments(parser: argparse.ArgumentParser) -> list[_Argument]:
    return [_argument(action) for action in parser._actions]


def _argument(action: argparse.Action) -> _Argument:
    choices = tuple(map(str, action.choices or ()))
    words = tuple(getattr(action, "words", ()))
    named = action.type is not None and action.type not in (int, float) and not words
    text = (action.help or "") % {"default": action.default, "prog": "trueangle"}
    return _Argument(
        tuple(action.option_strings),
        action.nargs != 0,
        choices,
        not choices and named,
        _first_part(text),
        words,
    )


def _first_part(text: str) -> str:
    """The help up to its first full stop or semicolon, without what shells would read."""
    plain = re.sub(r"[^\w\s,.()/=+-]", "", re.split(r"[;:]|\. ", text, maxsplit=1)[0])
    return " ".join(plain.split())


def _bash(parser: Parser) -> Iterator[str]:
    import shlex  # a help needs none of it

    yield "# bash completion of trueangle"
    yield "_trueangle() {"
    yield "  local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]}"
    yield "  COMPREPLY=()"
    yield "  if ((COMP_CWORD == 1)); then"
    top = [*parser.commands, *(f for a in _arguments(parser) for f in a.flags)]
    yield f'    COMPREPLY=($(compgen -W {shlex.quote(" ".join(top))} -- "$word")); return'
    yield "  fi"
    yield "  local options="
    yield "  case ${COMP_WORDS[1]}:$before in"
    for name, command in parser.commands.items():
        for argument in _arguments(command):
            if argument.words:
                cases = "|".join(f"{name}:{flag}" for flag in argument.flags)
                words = shlex.quote(" ".join(argument.words))
                yield f"    {cases}) compopt -o nospace 2>/dev/null"
                yield f'      COMPREPLY=($(compgen -W {words} -- "$word")); return;;'
            elif argument.choices and argument.flags:
                cases = "|".join(f"{name}:{flag}" for flag in argument.flags)
                words = shlex.quote(" ".join(argument.choices))
                yield f'    {cases}) COMPREPLY=($(compgen -W {words} -- "$word")); return;;'
            elif argument.flags and argument.takes_value and not argument.is_file:
                yield f"    {'|'.join(f'{name}:{flag}' for flag in argument.flags)}) return;;"
    yield "  esac"
    yield "  case ${COMP_WORDS[1]} in"
    for name, command in parser.commands.items():
        found = _arguments(command)
        flags = " ".join(flag for a in found for flag in a.flags)
        words = " ".join(word for a in found if not a.flags for word in a.choices)
        yield f"    {name}) options={shlex.quote(flags)}; words={shlex.quote(words)};;"
    yield "  esac"
    yield "  if [[ $word == -* ]]; then"
    yield '    COMPREPLY=($(compgen -W "$options" -- "$word"))'
    yield "  elif [[ $words ]]; then"
    yield '    COMPREPLY=($(compgen -W "$words" -- "$word"))'
    yield "  fi  # else files, by -o default"
    yield "}"
    yield "complete -o default -F _trueangle trueangle"


def _zsh(parser: Parser) -> Iterator[str]:
    yield "#compdef trueangle"
    yield "_trueangle() {"
    yield "  local -a commands"
    yield "  commands=("
    for name, command in parser.commands.items():
        yield f"    '{name}:{_first_part(command.description or '')}'"
    yield "  )"
    yield "  if ((CURRENT == 2)); then _describe command commands; return; fi"
    yield "  local command=$words[2]"
    yield "  shift words; ((CURRENT--))"
    yield "  case $command in"
    for name, command in parser.commands.items():
        yield f"    {name}) _arguments -S \\"
        for argument in _arguments(command):
            yield f"      {_zsh_argument(argument)} \\"
        yield "      && return;;"
    yield "  esac"
    yield "}"
    # Sourced it is made known; as a file of $fpath it is called.
    yield 'if [[ $funcstack[1] == _trueangle ]]; then _trueangle "$@"; '
    yield "else compdef _trueangle trueangle; fi"


def _zsh_argument(argument: _Argument) -> str:
    values = f":value:({' '.join(argument.choices)})" if argument.choices else ":value:"
    values = ":file:_files" if argument.is_file else values
    if argument.words:  # without a blank behind what is completed
        values = f':value:{{compadd -S "" {" ".join(argument.words)}}}'
    if not argument.flags:
        return f"'*{values}'"
    told = f"[{argument.help.replace('[', '(').replace(']', ')')}]"
    value = values if argument.takes_value else ""
    return " ".join(f"'*{flag}{told}{value}'" for flag in argument.flags)


def _fish(parser: Parser) -> Iterator[str]:
    yield "# fish completion of trueangle"
    first = "__fish_use_subcommand"
    for name, command in parser.commands.items():
        told = _first_part(command.description or "")
        yield f"complete -c trueangle -n {first} -f -a {name} -d {_quoted(told)}"
    for name, command in parser.commands.items():
        seen = f"-n '__fish_seen_subcommand_from {name}'"
        for argument in _arguments(command):
            words = _quoted(" ".join(argument.choices))
            if not argument.flags:
                if argument.choices:
                    yield f"complete -c trueangle {seen} -f -a {words}"
                continue
            flags = " ".join(
                f"-l {f[2:]}" if f.startswith("--") else f"-s {f[1:]}" for f in argument.flags
            )
            value = " -r" if argument.takes_value else ""
            words = _quoted(" ".join(argument.words)) if argument.words else words
            value += f" -f -a {words}" if argument.choices or argument.words else ""
            yield f"complete -c trueangle {seen} {flags}{value} -d {_quoted(argument.help)}"


def _quoted(text: str) -> str:
    return "'" + text.replace("\\", "\\\\").replace("'", "\\'") + "'"


#: Writers of the scripts, by shell.
SHELLS: Final[dict[str, Callable[[Parser], Iterator[str]]]] = {
    "bash": _bash,
    "zsh": _zsh,
    "fish": _fish,
}
