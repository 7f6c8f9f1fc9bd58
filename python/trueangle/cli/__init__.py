"""The command line: one file a command, listed in `COMMANDS`."""

from __future__ import annotations

import argparse
import importlib
import sys
import warnings
from collections.abc import Sequence
from typing import Protocol

from .. import __version__
from ..errors import TrueAngleError

__all__ = ["COMMANDS", "main"]

#: Modules of this package that each define one command of the same name.
COMMANDS: tuple[str, ...] = (
    "fit",
    "correct",
    "demo",
    "orders",
    "plan",
    "simulate",
    "diagnose",
    "report",
    "bench",
)


class Command(Protocol):
    """What a command module defines."""

    HELP: str
    EXAMPLE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do the work; the result is the exit status."""


def build_parser() -> argparse.ArgumentParser:
    """Parser of the whole command line."""
    parser = argparse.ArgumentParser(
        prog="trueangle",
        description="Fit, diagnose and correct the angle error of encoders and robot joints.",
    )
    parser.add_argument("--version", action="version", version=f"trueangle {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        command: Command = importlib.import_module(f".{name}", __name__)
        subparser = subparsers.add_parser(
            name,
            help=command.HELP,
            description=command.HELP,
            epilog=f"example:\n  {command.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(subparser)
        subparser.set_defaults(handler=command.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns
    -------
    int
        0 done, 1 bad input or no result (one line on stderr), 2 usage (by argparse).
    """
    args = build_parser().parse_args(argv)
    warnings.showwarning = _print_warning
    try:
        status: int = args.handler(args)
    except (TrueAngleError, OSError) as error:
        print(f"trueangle: error: {_one_line(error)}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        return 1
    except KeyboardInterrupt:
        print("trueangle: interrupted", file=sys.stderr)
        return 130
    return status


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror or error}"
    return " ".join(str(error).split())


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"trueangle: warning: {' '.join(str(message).split())}", file=sys.stderr)
