"""``trueangle completion``: what a shell needs to complete the command line."""

from __future__ import annotations

import argparse

from .shells import SHELLS, script

HELP = "print a script with which bash, zsh or fish completes commands and options"
EXAMPLE = "trueangle completion bash >~/.local/share/bash-completion/completions/trueangle"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    parser.add_argument("shell", choices=tuple(SHELLS), help="of which the script is")


def run(args: argparse.Namespace) -> int:
    """Print the script."""
    from . import build_parser

    print(script(build_parser(), args.shell), end="")
    return 0
