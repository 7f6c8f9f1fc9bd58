"""The command that helps after a refusal, with its arguments: what it prints can be typed."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

from ..errors import (
    MissingSignalError,
    NoModelError,
    NoOrderError,
    NotInvertibleError,
    RankError,
    TrueAngleError,
)
from .parser import Parser

#: Makes the parser of commands: with the arguments of some, of those that are named.
Build: TypeAlias = Callable[[Sequence[str], Sequence[str]], Parser]

#: Options of a command's own work and files, which another one does not share.
_OWN = frozenset(
    {"help", "debug", "output", "corrected_model", "extend", "checksums", "one_pass", "scheduler"}
)

#: What a diagnosis may do where no order is supported: there may be no model at all.
_PERHAPS = (
    "; a diagnosis names what else there is, and with --corrected-model FILE writes the model of it"
)

#: Fewest readings of a diagnosis (`diagnosis.diagnose.LEAST_READINGS`, which takes numpy).
_LEAST_READINGS = 20


def command_that_helps(error: TrueAngleError, args: argparse.Namespace, build: Build) -> str:
    """``; run: trueangle ...``, or nothing where no command is known to help.

    Files, signals and the joint are those of the command that was refused; ``build`` makes the
    parser of commands.
    """
    words = _words(error, args, build)
    if not words:
        return ""
    perhaps = ""
    if isinstance(error, NoOrderError):
        more = f"; take {_LEAST_READINGS} readings or more"
        perhaps = _PERHAPS if words[0] == "diagnose" else more
    return f"{perhaps}; run: {shlex.join(['trueangle', *words])}"


def _words(error: TrueAngleError, args: argparse.Namespace, build: Build) -> list[str]:
    """The command, word by word."""
    command = args.command
    if isinstance(error, NotInvertibleError) and command in ("fit", "diagnose"):
        return _again(build, args, command, ("--argument", "indicated"), _named_outputs(args))
    if isinstance(error, MissingSignalError) and command == "diagnose":
        # The model to extend needs it; a new one holds what these readings show.
        return _again(build, args, command, (), _named_outputs(args), without=("model",))
    if command not in ("fit", "orders"):
        return _plan(error, args) if command == "selfcal" else []
    if isinstance(error, RankError):
        return _again(build, args, "orders", (), (), without=("orders",))
    if isinstance(error, NoOrderError) and 0 < error.readings < _LEAST_READINGS:
        return ["plan", "--arc", "0:360", "--readings", str(_LEAST_READINGS)]
    if isinstance(error, NoModelError):
        # Without a gear nothing but the output turns, and that is said.
        known = args.gear_ratio is not None
        bare = () if known else ("--gear-ratio", "1", "--fixed-member", "none")
        output = getattr(args, "output", None)
        # Where no order is supported there may be no model at all: what there is comes first.
        wanted = output is not None and not isinstance(error, NoOrderError)
        model = ["--corrected-model", str(output)] if wanted else []
        return _again(build, args, "diagnose", bare, model, without=("argument",))
    return []


def _plan(error: TrueAngleError, args: argparse.Namespace) -> list[str]:
    """How to measure for the method of a self-calibration."""
    if not isinstance(error, NoModelError) or "plan_self" in str(error):  # the error has it
        return []
    method = "spin-down" if args.method == "auto" else args.method
    words = ["plan", "--self", method]
    return [*words, "--gear-ratio", f"{args.gear_ratio!r}"] if args.gear_ratio else words


def _named_outputs(args: argparse.Namespace) -> list[str]:
    """What the command was to write, once more."""
    found: list[str] = []
    for option in ("output", "extend", "corrected_model"):
        path = getattr(args, option, None)
        if path is not None:
            found += [f"--{option.replace('_', '-')}", str(path)]
    return found


def _again(
    build: Build,
    args: argparse.Namespace,
    command: str,
    more: tuple[str, ...],
    outputs: list[str] | tuple[str, ...],
    without: tuple[str, ...] = (),
) -> list[str]:
    """``command`` with the inputs and options of ``args`` that it has as well."""
    known = build((command,), (command,)).commands[command]
    left_out = {*_OWN, *without, *(word[2:].replace("-", "_") for word in more if word[:2] == "--")}
    words = [command]
    for action in known._actions:
        given = getattr(args, action.dest, None)
        if action.dest in left_out or given is None or given == action.default:
            continue
        words += _typed(action, given)
    return [*words, *more, *outputs]


def _typed(action: argparse.Action, given: Any) -> Iterator[str]:
    """An argument as it is typed."""
    option = action.option_strings[-1:] if action.option_strings else []
    if action.nargs == 0:
        yield from option
        return
    values = given if isinstance(given, list) else [given]
    for value in values:
        text = getattr(value, "text", None) or (repr(value) if type(value) is float else str(value))
        yield from (*option, text)
