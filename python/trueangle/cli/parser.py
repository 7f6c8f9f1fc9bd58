"""The parser of the command line: usage errors that suggest what was meant."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Iterable, Sequence
from typing import Any, NoReturn

__all__ = ["Parser", "did_you_mean"]

_CHOICE = re.compile(r"invalid choice: '(?P<got>.*)' \(choose from (?P<known>.*)\)")


def did_you_mean(got: str, known: Iterable[str]) -> str:
    """``; did you mean X?``, or nothing where no known word is near.

    Examples
    --------
    >>> did_you_mean("moter", ["output", "motor", "wave_generator"])
    '; did you mean motor?'
    >>> did_you_mean("elbow", ["output", "motor"])
    ''
    """
    near = difflib.get_close_matches(got.lower(), list(known), n=1, cutoff=0.7)
    return f"; did you mean {near[0]}?" if near else ""


class Parser(argparse.ArgumentParser):
    """`argparse.ArgumentParser` whose errors suggest the option or command meant."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        #: Parsers of the commands, by name; those of a command have none.
        self.commands: dict[str, Parser] = {}

    def parse_args(  # type: ignore[override]
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        """Parse, and refuse what is not understood in the words of the command it stands in."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            chosen = self.commands.get(getattr(parsed, "command", None) or "", self)
            option = next((word for word in unknown if word.startswith("-")), "")
            guess = did_you_mean(option.partition("=")[0], chosen._option_string_actions)
            chosen.error(f"unrecognized arguments: {' '.join(unknown)}{guess}")
        return parsed

    def error(self, message: str) -> NoReturn:
        """Print usage and ``message`` with a suggestion, exit with status 2."""
        found = _CHOICE.search(message)
        if found is not None:
            known = re.findall(r"[\w-]+", found["known"])
            message += did_you_mean(found["got"], known)
        super().error(message)
