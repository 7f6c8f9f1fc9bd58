"""The parser of the command line: grouped help, and errors that suggest what was meant."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from glob import has_magic
from importlib import import_module
from typing import Any, Final, NoReturn, TypeAlias

from ..errors import ArgumentError
from ..support.files import FileKind, check_input, check_output, same_file
from ..support.layout import text_columns
from ..support.suggestions import did_you_mean


class Input(str):
    """A file or folder that a command reads: ``type=Input`` of an argument."""

    __slots__ = ()

    @property
    def file(self) -> str:
        """The path itself."""
        return str(self)


class ModelInput(Input):
    """A file, perhaps after the name of its joint: ``joint3=FILE``."""

    __slots__ = ()

    @property
    def file(self) -> str:
        """The path behind the joint's name; without one, what was typed."""
        return self.partition("=")[2] or str(self)


class Output(str):
    """A file that a command writes: ``type=Output.of(KIND)`` of an argument."""

    kind: FileKind | None = None

    @classmethod
    def of(cls, kind: FileKind | None) -> Callable[[str], Output]:
        """What argparse calls with the text of an argument."""

        def made(text: str) -> Output:
            output = cls(text)
            output.kind = kind
            return output

        made.output = True  # type: ignore[attr-defined]  # for help: it is written
        return made


def check_paths(args: argparse.Namespace) -> None:
    """Refuse inputs that cannot be read, and outputs that are inputs or no files.

    Raises
    ------
    FileError, OSError
        See `files.check_input` and `files.check_output`.
    ArgumentError
        Two outputs are one file.
    """
    import_module("trueangle.formats")  # whose endings no other output may bear; takes numpy
    values = list(_values(vars(args)))
    given = [value.file for value in values if isinstance(value, Input)]
    inputs = [path for name in given for path in _matched(name)]
    outputs = [value for value in values if isinstance(value, Output)]
    for path in inputs:
        check_input(path)
    for i, path in enumerate(outputs):
        check_output(path, path.kind, inputs)
        if any(same_file(path, other) for other in outputs[:i]):
            raise ArgumentError(f"{path}: two outputs of this name; name another file for one")


def _matched(name: str) -> list[str]:
    """The file of this name, or those that match a pattern."""
    if not has_magic(name):
        return [name]
    from ..runs.paths import matched_paths  # takes numpy, which most commands do without here

    return [*map(str, matched_paths([name]))]


def _values(given: dict[str, Any]) -> Iterator[Any]:
    for value in given.values():
        if isinstance(value, list | tuple):
            yield from value
        else:
            yield value


#: The message of argparse about missing arguments, and what looks like an option.
_MISSING: Final = "the following arguments are required"
_OPTION: Final = r"-{1,2}[A-Za-z]"

_CHOICE = r"argument (?P<name>.*): invalid choice: '(?P<got>.*)' \(choose from (?P<known>.*)\)"

#: Headings of a command's help, in this order.
GROUPS: Final = ("input", "model", "output", "other")

#: Options that control how files are read.
_INPUT: Final = (
    "--signal --column --unit --counts-per-turn --counts-per-turn-reference --topic --run --joint "
    "--unit-from"
)

#: Options that control what is printed or written, and how.
_OUTPUT: Final = (
    "--output --output-topic --in-place --json --errors-in --progress --title --checksums"
)

#: What an argument takes: nothing (``bool``), one of some words, or a text and what it becomes.
Kind: TypeAlias = type[bool] | tuple[str, ...] | Callable[[str], Any]


class HelpFormatter(argparse.RawDescriptionHelpFormatter):
    """As wide as other texts are; argparse asks `shutil` for that, whose import takes long."""

    def __init__(self, prog: str, **how: Any) -> None:
        super().__init__(prog, width=text_columns() - 2, **how)


class Parser(argparse.ArgumentParser):
    """`argparse.ArgumentParser` with grouped help whose errors suggest what was meant.

    An argument belongs to the group of its type, `Input` or `Output`, or to that of its
    name; what is neither read nor written is about the model.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._headed: dict[str, argparse._ArgumentGroup] = {}
        self._words: list[str] = []
        super().__init__(*args, **{"formatter_class": HelpFormatter, **kwargs})
        #: Parsers of the commands, by name; those of a command have none.
        self.commands: dict[str, Parser] = {}

    def add_argument(self, *args: Any, **kwargs: Any) -> argparse.Action:
        """As `argparse.ArgumentParser.add_argument`, under the heading that fits."""
        if not self._headed:
            self._headed.update({name: self.add_argument_group(name) for name in GROUPS})
        return self._headed[_group(args, kwargs)].add_argument(*args, **kwargs)

    def format_help(self) -> str:
        """The help, with what every command has at its end."""
        self._action_groups.sort(key=lambda group: group.title == "other")
        return super().format_help()

    def parse_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse, and refuse what is not understood in the words of its command."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            chosen = self.commands.get(getattr(parsed, "command", None) or "", self)
            option = next((word for word in unknown if word.startswith("-")), "")
            guess = did_you_mean(option.partition("=")[0], chosen._option_string_actions)
            chosen.error(f"unrecognized arguments: {' '.join(unknown)}{guess}")
        return parsed

    def parse_known_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> tuple[argparse.Namespace, list[str]]:
        """As `argparse.ArgumentParser.parse_known_args`, with the words at hand for `error`."""
        self._words = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def _mistyped(self) -> str:
        """The first word that no option has, with the one that was meant; empty without one."""
        known = self._option_string_actions
        for word in self._words:
            name = word.partition("=")[0]
            if name == "--":
                break
            if not re.match(_OPTION, name) or any(option.startswith(name) for option in known):
                continue
            # A short option may hold its value: -ojoint.json.
            guess = did_you_mean(name, known)
            if guess and name[:2] not in known:
                return f"unrecognized arguments: {name}{guess}"
        return ""

    def error(self, message: str) -> NoReturn:
        """Print a line of usage and ``message`` with a suggestion, exit with status 2."""
        if message.startswith(_MISSING):  # perhaps because it was mistyped
            message = self._mistyped() or message
        found = re.search(_CHOICE, message)
        if found is not None:
            known = re.findall(r"[\w-]+", found["known"])
            near = did_you_mean(found["got"], known)
            what = "command" if self.commands else found["name"]
            message = (
                f"there is no {what} {found['got']!r}{near or '; there are ' + ', '.join(known)}"
            )
        self.exit(2, f"usage: {self._in_short()}\n{self.prog}: error: {message}\n")

    def _in_short(self) -> str:
        """How the command is called: what it needs, and where the other options are listed."""
        if self.commands:
            return f"{self.prog} COMMAND ...; {self.prog} --help lists the commands"
        needed = [
            f"{'/'.join(a.option_strings[:1])} {a.metavar or a.dest.upper()}".strip()
            for a in self._actions
            if a.required
        ]
        return f"{' '.join([self.prog, *needed])} [options]; {self.prog} --help lists them"


def declare(
    parser: argparse._ActionsContainer, spelled: str, kind: Kind, told: str, **more: Any
) -> argparse.Action:
    """Declare an argument in the form of its help, as ``"-o --output FILE"`` or ``"runs RUNS..."``.

    ``told`` is its help, ``many=True`` lets an option be repeated, and ``more`` is what
    `argparse.ArgumentParser.add_argument` takes in addition.

    Examples
    --------
    >>> parser = Parser()
    >>> _ = declare(parser, "--rate HZ", float, "readings per second")
    >>> _ = declare(parser, "--reference", ("polygon", "encoder"), "the artefact")
    >>> parser.parse_args(["--rate", "20"])
    Namespace(rate=20.0, reference=None)
    """
    names = spelled.split()
    if len(names) > 1 and not names[-1].startswith("-"):
        more["metavar"] = names.pop()
        if more["metavar"].endswith("..."):
            more |= {"metavar": more["metavar"][:-3], "nargs": "+"}
    if kind is bool:
        more["action"] = "store_true"
    elif isinstance(kind, tuple):
        more["choices"] = kind
    elif kind is not str:
        more["type"] = kind
    if more.pop("many", False):
        more["action"] = "append"
    return parser.add_argument(*names, help=told, **more)


def _group(names: Sequence[str], options: dict[str, Any]) -> str:
    """The heading of an argument, by what it is declared with."""
    kind, name = options.get("type"), names[-1] if names else ""
    if options.get("action") in ("help", "version") or name == "--debug":
        return "other"
    if isinstance(kind, type) and issubclass(kind, Input):
        return "input" if name != "--model" else "model"
    if getattr(kind, "output", False) or name in _OUTPUT.split():
        return "output"
    return "input" if name in _INPUT.split() else "model"
