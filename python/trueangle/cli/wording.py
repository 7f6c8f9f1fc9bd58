"""Messages in the words of a command, with the command that helps: Python becomes options.

A message is written once, in Python: what a caller would type is in backquotes, as
```bits=16```, ```signals={"torque": "tau"}``` or ```ta.diagnose(...)```. A command prints
``--bits 16``, ``--signal torque=tau`` and ``trueangle diagnose``.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from ..errors import (
    MissingSignalError,
    NoCurveError,
    NoModelError,
    NoOrderError,
    NotInvertibleError,
    RankError,
    TrueAngleError,
)
from .parser import Parser

if TYPE_CHECKING:
    import ast

_CODE: Final = re.compile(r"`([^`\n]{1,300})`")
_ARGUMENT: Final = re.compile(r"\w+=")
_CALL: Final = re.compile(r"(?:ta|trueangle)\.[\w.]+\(.*\)")

#: How an error begins that is of one argument.
_LEADING: Final = re.compile(r"(\w+)(?= (?:must|needs|has|is) )")

#: Arguments of Python whose options have another name; the first that a command has is meant.
_OPTIONS: Final = {
    "candidates": ("orders",),
    "column": ("column", "signal"),
    "max_gap_s": ("max_gap",),
    "method": ("method", "self_method"),
    "noise": ("noise_arcsec",),
    "offset_s": ("offset",),
    "rate_ppm": ("rate",),
    "shafts": ("shaft",),
    "signals": ("signal",),
    "standard_error": ("std_arcsec",),
    "target": ("to", "source"),
}

#: Units of columns by the period that they have in Python.
_UNITS: Final = {"360": "deg", "360.0": "deg", "1": "turn", "1.0": "turn"}

#: Functions of Python that are commands of another name, and methods that are options.
_COMMANDS: Final = {
    "correct_logs": "correct",
    "diagnosis.correction()": "--corrected-model FILE",
    "export_model": "export",
    "fit_logs": "fit --one-pass",
    "import_model": "import",
    "diagnosis.plan()": "--plan FILE",
    "plan_arc": "plan --arc 0:360",
    "plan_encoder": "plan --reference encoder",
    "plan_mounts": "plan",
    "plan_self": "plan --self",
    "plan_tilts": "plan --reference off-null",
    "select_orders": "orders",
    "diagnosis.simulation()": "--extend FILE",
}

#: Makes the parser of commands: with the arguments of some, of those that are named.
_Build: TypeAlias = Callable[[Sequence[str], Sequence[str]], Parser]

#: Options of a command's own work and files, which another one does not share.
_OWN = frozenset(
    {"help", "debug", "output", "corrected_model", "extend", "checksums", "one_pass", "scheduler"}
)

#: What a diagnosis may do where no order is supported: there may be no model at all.
_PERHAPS = "; to find causes that are no order (--corrected-model FILE writes their model)"


class Wording:
    """What a text is to those who typed a command; until one is known, the text itself.

    Examples
    --------
    >>> import argparse
    >>> parser = argparse.ArgumentParser()
    >>> _ = parser.add_argument("--gear-ratio"), parser.add_argument("--signal")
    >>> words = Wording()
    >>> words.parser = parser
    >>> words('give `gear_ratio=100` or `signals={"motor": ("q m", "rad")}`')
    "give --gear-ratio 100 or --signal 'motor=q m:rad'"
    >>> words("run `ta.diagnose(...)`"), words.of_error("gear_ratio must be positive")
    ('run trueangle diagnose', '--gear-ratio must be positive')
    """

    def __init__(self) -> None:
        #: That of the command.
        self.parser: argparse.ArgumentParser | None = None

    def __call__(self, text: str) -> str:
        """``text`` with options in place of Python."""
        if self.parser is None or "`" not in text:
            return text
        return _CODE.sub(self._told, text)

    def of_error(self, text: str) -> str:
        """The same of an error of an argument, which may begin with its bare name."""
        found = _LEADING.match(text)
        option = found and self._option(found[1])
        return text if not found or not option else option + text[found.end() :]

    def _told(self, found: re.Match[str]) -> str:
        code = found[1].replace('\\"', '"')
        is_json = code != found[1]  # which has a backslash before every quote
        if _ARGUMENT.fullmatch(code):
            return self._option(code[:-1]) or found[0]
        if not (_ARGUMENT.match(code) or _CALL.fullmatch(code)):
            return _COMMANDS.get(code, found[0])
        import ast  # needed only where something is wrong

        try:
            call = ast.parse(code if _CALL.fullmatch(code) else f"f({code})", mode="eval").body
            assert isinstance(call, ast.Call)
            words = [*self._command(call), *self._options(call)]
        except (SyntaxError, ValueError):
            return found[0]
        told = " ".join(words)
        if "\\" in told:
            return found[0]
        return told.replace('"', '\\"') if is_json else told

    def _command(self, call: ast.Call) -> Iterator[str]:
        import ast

        if isinstance(call.func, ast.Attribute):
            name = call.func.attr
            yield f"trueangle {_COMMANDS.get(name, name)}"
            yield from (
                str(a.value) for a in call.args if isinstance(a, ast.Constant) and _is_text(a)
            )

    def _options(self, call: ast.Call) -> Iterator[str]:
        for keyword in call.keywords:
            name = keyword.arg or ""
            if name == "period" and not self._option(name):  # columns have units, not a period
                unit = _UNITS.get(_text(keyword.value), "UNIT")
                yield from (f"--signal {angle}=NAME:{unit}" for angle in ("reference", "indicated"))
                continue
            # Of another command than that which runs the option is named as a rule is.
            option = self._option(name) or f"--{name.replace('_', '-')}"
            values = _values(keyword.value)
            yield from (f"{option} {value}" for value in values) if values else (option,)

    def _option(self, name: str) -> str:
        """The option of an argument, or the place of one that has none; empty without both."""
        actions = self.parser._actions if self.parser is not None else ()
        for dest in (*_OPTIONS.get(name, (name,)), f"option_{name}"):
            for action in actions:
                if action.dest == dest:
                    long = [o for o in action.option_strings if o.startswith("--")]
                    place = action.metavar if isinstance(action.metavar, str) else dest.upper()
                    return long[0] if long else place
        return ""


def _is_text(node: ast.expr) -> bool:
    return isinstance(getattr(node, "value", None), str)


def _values(node: ast.expr) -> list[str]:
    """The values of an option, one for each time it is given; none of a switch."""
    import ast
    from shlex import quote

    if isinstance(node, ast.Dict):
        return [quote(entry) for entry in _entries(node)]
    if isinstance(node, ast.Constant) and node.value is True:
        return []
    return [quote(_text(node))]


def _entries(node: ast.Dict, prefix: str = "") -> Iterator[str]:
    """``NAME=VALUE`` of every entry, ``OUTER.NAME=VALUE`` of those within another."""
    import ast

    for key, value in zip(node.keys, node.values, strict=True):
        name = prefix + ("" if key is None else _text(key))
        if isinstance(value, ast.Dict):
            yield from _entries(value, f"{name}.")
        else:
            yield f"{name}={_text(value, ':')}"


def _text(node: ast.expr, between: str = ",") -> str:
    """A value as it is typed: text and names as they are, lists with commas, ranges with a dash."""
    import ast

    match node:
        case ast.Constant(value=value):
            return str(value)
        case ast.Name(id=name):
            return name
        case ast.UnaryOp(op=ast.USub(), operand=value):
            return f"-{_text(value)}"
        case ast.List(elts=several) | ast.Tuple(elts=several):
            return between.join(map(_text, several))
        case ast.Call(args=[first, ast.Constant(value=int(end))]):
            return f"{_text(first)}-{end - 1}"
    raise ValueError("no value of an option")


def command_that_helps(error: TrueAngleError, args: argparse.Namespace, build: _Build) -> str:
    """``; run: trueangle ...``, or nothing where no command is known to help.

    Files, signals and the joint are those of the command that was refused; ``build`` makes the
    parser of commands.
    """
    from shlex import join

    words = _words(error, args, build)
    if not words:
        return ""
    perhaps = _PERHAPS if isinstance(error, NoOrderError) and words[0] == "diagnose" else ""
    return f"{perhaps}; run: {join(['trueangle', *words])}"


def _words(error: TrueAngleError, args: argparse.Namespace, build: _Build) -> list[str]:
    """The command, word by word."""
    command = args.command
    if isinstance(error, NoCurveError):  # its message has what to do
        return []
    if isinstance(error, NotInvertibleError) and command in ("fit", "diagnose"):
        return _again(build, args, command, ("--argument", "indicated"), _named_outputs(args))
    if isinstance(error, MissingSignalError) and command == "diagnose":
        # The model to extend needs it; a new one holds what these readings show.
        return _again(build, args, command, (), _named_outputs(args), without=("model",))
    if command not in ("fit", "orders"):
        return _plan(error, args) if command == "selfcal" and args.method != "channels" else []
    if isinstance(error, RankError):
        return _again(build, args, "orders", (), (), without=("orders",))
    if isinstance(error, NoModelError) and "plan_arc" not in str(error):  # the error has it
        # Without a gear nothing but the output turns, and the command states that.
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
    build: _Build,
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
