"""The command line: one file a command, listed in `COMMANDS`."""

from __future__ import annotations

import argparse
import contextlib
import gc
import importlib
import os
import sys
import warnings
from collections.abc import Container, Iterable, Sequence
from keyword import iskeyword
from typing import NoReturn, Protocol

from .._core import __version__
from ..errors import ArgumentError, TrueAngleError, shortened
from ..support.layout import wrapped_lines
from .ending import Ending
from .parser import Parser, check_paths
from .terminal import STANDARD_OUTPUT, plain_streams, silence_output
from .wording import Wording

#: Modules of this package that each define one command of the same name.
COMMANDS: tuple[str, ...] = (
    "record",
    "check",
    "robot",
    "join",
    "fit",
    "correct",
    "demo",
    "orders",
    "plot",
    "plan",
    "simulate",
    "diagnose",
    "rehearse",
    "report",
    "export",
    "import",
    "compare",
    "selfcal",
    "fleet",
    "watch",
    "bench",
    "completion",
)


class Command(Protocol):
    """What a command module defines."""

    HELP: str
    EXAMPLE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""

    def run(self, args: argparse.Namespace) -> int:
        """Do the work; the result is the exit status."""


def build_parser(words: Container[str] = COMMANDS, commands: Iterable[str] = COMMANDS) -> Parser:
    """Parser of ``commands``, with the arguments of those among ``words``.

    The options of a command are known to modules that take long to import (its targets,
    its methods): of a command that is not called only the name and the line of help are.
    """
    parser = Parser(
        prog="trueangle",
        description="Fit, diagnose and correct the angle error of encoders and robot joints.",
    )
    parser.add_argument("--version", action="version", version=f"trueangle {__version__}")
    subparsers = parser.add_subparsers(
        dest="command", metavar="COMMAND", required=True, prog=parser.prog
    )
    for name in commands:
        command: Command = importlib.import_module(f".{name}{'_' * iskeyword(name)}", __name__)
        is_called = name in words
        subparser = subparsers.add_parser(name, help=command.HELP, add_help=is_called)
        parser.commands[name] = subparser
        if not is_called:
            continue
        subparser.description = "\n".join(wrapped_lines(command.HELP))
        subparser.epilog = f"example:\n  {command.EXAMPLE}"
        command.add_arguments(subparser)
        subparser.add_argument(
            "--debug", action="store_true", help="print the traceback of an error too"
        )
        subparser.set_defaults(handler=command.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns
    -------
    int
        0 done; 1 bad input or no result (one line on stderr); 2 usage (by argparse); as a
        shell reports it, 130, 143, 129 interrupted (Ctrl-C, SIGTERM, SIGHUP) and 141: who read
        standard output has gone.
    """
    wording, ending = Wording(), Ending()
    args = argparse.Namespace(debug=False)
    before = warnings.showwarning
    with plain_streams(wording):
        try:
            with ending:
                words = list(sys.argv[1:] if argv is None else argv)
                # The others are imported only where their names are to be listed.
                called = words[:1] if words and words[0] in COMMANDS else COMMANDS
                parser = build_parser(words, called)
                wording.parser = parser.commands.get(words[0] if words else "")
                args = parser.parse_args(words)
                warnings.showwarning = _print_warning
                check_paths(args)
                status: int = args.handler(args)
                # What waits to be printed can fail as well: a full disk, a reader that has gone.
                if sys.stdout is not None:
                    sys.stdout.flush()
        except SystemExit:
            raise
        except BaseException as error:  # a panic of the core is no Exception
            return _failed(error, ending, wording, args)
        finally:
            warnings.showwarning = before
    return status


def process() -> NoReturn:
    """Run one command as a separate process, which ends with it."""
    # Objects made and kept between two searches for circles of them; Python's 700 are for programs
    # that run long. What a command imports is kept to its end, and searching it took a tenth of it.
    gc.set_threshold(50_000, *gc.get_threshold()[1:])
    if sys.argv[1:2] != ["bench"]:
        # The core has its own threads (`trueangle.support.blas`); a bench lets numpy have its own.
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        sys.exit(main())
    finally:
        gc.freeze()  # all ends here: Python need not search it for circles once more


def _failed(
    error: BaseException, ending: Ending, wording: Wording, args: argparse.Namespace
) -> int:
    """Print an error in one line; the result is the exit status."""
    if args.debug:
        import traceback  # brings the tokenizer with it

        traceback.print_exception(error)
    if ending.came or isinstance(error, KeyboardInterrupt):
        told = str(error) if isinstance(error, KeyboardInterrupt) else ""
        _say(ending.text + (f": {told}" if told else ""))
        return ending.status
    if isinstance(error, OSError) and error.filename == STANDARD_OUTPUT:
        silence_output()
        if isinstance(error, BrokenPipeError):
            return 141
    if isinstance(error, TrueAngleError):
        from .wording import command_that_helps

        said = wording.of_error(str(error)) if isinstance(error, ArgumentError) else str(error)
        _say(f"error: {said}{command_that_helps(error, args, build_parser)}")
    elif isinstance(error, OSError):
        _say(f"error: {_system(error)}")
    elif isinstance(error, MemoryError):
        _say(
            f"error: out of memory ({str(error) or 'no more is available'}); take fewer "
            "readings at a time, or --one-pass where the command has it"
        )
    elif isinstance(error, ImportError):  # one that is there: missing ones are reported above
        _say(f"error: a library cannot be loaded: {error}; is there memory enough for it?")
    else:
        _say(
            f"error: unexpected {type(error).__name__}: {error}; this is a defect of "
            "trueangle: please report this line and what --debug prints"
        )
    return 1


def _system(error: OSError) -> str:
    """What the system refused, and the file."""
    if error.filename is None:
        return str(error)
    name = error.filename
    shown = os.fsdecode(name) if isinstance(name, (str, bytes, os.PathLike)) else str(name)
    hint = "; name /dev/stdin to read a pipe" if shown == "-" else ""
    return f"{shown}: {error.strerror or error}{hint}"


def _say(text: str) -> None:
    """Print it in one line, however it was broken."""
    if sys.stderr is not None:
        with contextlib.suppress(OSError):  # a closed terminal
            # Blanks stay as they are: a name of a file may have two.
            line = shortened(" ".join(part.strip() for part in text.splitlines()))
            print(f"trueangle: {line}", file=sys.stderr, flush=True)


def _print_warning(message: Warning | str, *_: object, **__: object) -> None:
    _say(f"warning: {message}")
