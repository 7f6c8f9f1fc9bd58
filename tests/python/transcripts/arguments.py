"""Every argument of every command as lines to be compared, whichever way a Python lays out help."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from trueangle.cli import COMMANDS, build_parser


def argument_lines() -> Iterator[str]:
    """One line an argument: its names, place, default, choices, heading and help.

    What another command has to the letter is told once.
    """
    parser = build_parser(COMMANDS)
    known: dict[str, str] = {}
    yield parser.description or ""
    for name, command in parser.commands.items():
        yield f"{name}: {' '.join((command.description or '').split())}"
        yield f"  {command.epilog.removeprefix('example:').strip()}"
        headings = {a: g.title for g in command._action_groups for a in g._group_actions}
        for action in command._actions:
            if action.dest in ("help", "debug"):
                continue
            line = f"  {headings[action]}: {_told(action)}"
            if known.setdefault(line, name) == name:
                yield line
            else:
                yield f"  {'/'.join(action.option_strings) or action.dest} as of {known[line]}"


def _told(action: argparse.Action) -> str:
    kind = getattr(action.type, "__name__", "")
    parts = ["/".join(action.option_strings) or action.dest]
    parts += [str(action.metavar)] if action.metavar else []
    parts += ["required"] if action.required and action.option_strings else []
    parts += [f"({kind})"] if kind in ("int", "float") else []
    parts += [f"as often as wanted: {action.nargs}"] if action.nargs not in (None, 0) else []
    parts += ["repeated"] if isinstance(action, argparse._AppendAction) else []
    parts += ["switch"] if action.nargs == 0 else []
    parts += (
        [f"= {action.default!r}"] if action.default not in (None, "") and action.nargs != 0 else []
    )
    parts += ["of " + ", ".join(map(str, action.choices))] if action.choices else []
    values = {"default": action.default, "prog": "trueangle"}
    return f"{' '.join(parts)}: {(action.help or '') % values}"
