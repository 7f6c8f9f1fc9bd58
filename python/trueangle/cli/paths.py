"""Arguments that name inputs and outputs: marked by their type, checked before a command begins."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from glob import has_magic
from importlib import import_module
from typing import Any

from ..errors import ArgumentError
from ..support.files import FileKind, check_input, check_output, same_file


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

        made.output = True  # type: ignore[attr-defined]  # tells help that it is written
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
