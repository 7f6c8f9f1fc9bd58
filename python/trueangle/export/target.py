"""What a target is: options, a comment and tables that some firmware reads, its own arithmetic."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..model.term import Term
from ..support.arrays import Array
from ..support.files import FileKind
from ..support.suggestions import check_choice, did_you_mean
from .pattern import TurnPattern, of_direction
from .proof import Correction, Proof
from .runtimeterms import RunTimeTerms

#: `Made` has a number of that name.
Bytes = bytes


class Option(NamedTuple):
    """An option of a target: what it may be, its default and a line of help.

    ``values`` is a tuple of the words allowed, or the type of a number or text.
    """

    values: tuple[str, ...] | type
    default: Any
    help: str


@dataclass(frozen=True)
class CommentBlock:
    """What is known when a file is written, for its comment.

    Attributes
    ----------
    name : str
        Of the functions, where there are any.
    difference : str
        One line: how far the corrected angle is from the model's, including what is omitted.
    proof : Proof
    source : tuple of str
        Lines on the model: its file and sha256, what it was made from, where it holds.
    notes : tuple of str
    """

    name: str
    difference: str
    proof: Proof
    source: tuple[str, ...]
    notes: tuple[str, ...]

    def comment(self, lead: str, *own: str) -> list[str]:
        """Lines of a file's comment: the difference, ``own`` words on the table, the others."""
        parts = [self.difference, *own, *self.source, *(f"Note: {note}." for note in self.notes)]
        return [line for part in parts for line in _comment_lines(98, part, lead)]


class TablePart(NamedTuple):
    """What a target computes, and what it should compute.

    Attributes
    ----------
    corrections : tuple of callable
        Turns subtracted at readings in 2^-32 turns; several where compilers differ.
    exact : callable
        What it should be, at readings in turns.
    resolution : float
        Rounding of a result, turns.
    turns : int
        Of the output, over which shafts are looked at that do not come back after one.
    continuous : bool
        Inputs are real numbers.
    """

    corrections: tuple[Correction, ...]
    exact: Callable[[Array], Array]
    resolution: float = 0.0
    turns: int = 1
    continuous: bool = False

    @classmethod
    def at_readings(
        cls, pattern: TurnPattern, *corrections: Correction, zero: float, **more: Any
    ) -> TablePart:
        """Of a table that is looked up at the reading; ``zero`` turns are left to the target."""
        return cls(corrections, lambda x: pattern.taken_off(x) - zero, **more)


@dataclass(frozen=True)
class Made:
    """A target's table of a model, before it is proven and written.

    Attributes
    ----------
    text : callable
        The file's content, which states what was proven.
    entries, bytes : int
        Numbers of the table, and the memory they take on the target.
    part : TablePart
        What is proven: how far the corrected angle is off.
    floor_arcsec : float
        rms that the number format alone leaves.
    zero_deg : float
        A constant added to the corrected angle: left to the target's own zero.
    lost : callable, optional
        Of its own where several tables are not one of the output's turn.
    notes : tuple of str
    tables : tuple of dict
        One line on each table, where there are several.
    bits : int, optional
        Of a reading, where the target fixes them.
    packed : callable, optional
        Makes the file of the text, where it is not text itself.
    decodes : bool
        It decodes a sine and a cosine channel, instead of correcting an angle.
    """

    text: Callable[[CommentBlock], str]
    entries: int
    bytes: int
    part: TablePart
    floor_arcsec: float
    zero_deg: float = 0.0
    lost: Callable[[], list[dict[str, float]]] | None = None
    notes: tuple[str, ...] = ()
    tables: tuple[dict[str, Any], ...] = ()
    bits: int | None = None
    packed: Callable[[str], Bytes] | None = None
    decodes: bool = False


class Target(ABC):
    """A format; one file each in this package, and a line in `TARGETS`.

    Class attributes
    ----------------
    name : str
    what : str
        One line: where the file goes.
    kind : Kind
        What is written, and the endings it may bear.
    sign : str
        ``"subtract"`` or ``"add"``: what the target does with a value; ``"absolute"`` where
        the table holds angles.
    argument : str
        The angle at which it looks up: ``"indicated"`` or ``"reference"``.
    unknown : str
        What is not known about the target, in a sentence; empty where nothing is.
    options : dict
    """

    name: ClassVar[str]
    what: ClassVar[str]
    kind: ClassVar[FileKind]
    sign: ClassVar[str]
    argument: ClassVar[str] = "indicated"
    unknown: ClassVar[str] = ""
    options: ClassVar[Mapping[str, Option]] = {}
    #: Entries that are tried for ``max_arcsec``, where options do not matter.
    tried: ClassVar[Sequence[int]] = ()

    #: Options that name files: read, never written.
    files: ClassVar[tuple[str, ...]] = ()

    #: The target's arithmetic is known: what is stated is proven.
    arithmetic_known: ClassVar[bool] = True

    #: It takes what the sensor reads, not the joint's own angle.
    at_sensor: ClassVar[bool] = True

    #: It takes what follows the direction of travel in addition to the pattern.
    takes_direction: ClassVar[bool] = False

    #: It decodes a sine and a cosine channel where the model has some.
    decodes: ClassVar[bool] = False

    def holds(self, term: Term) -> bool:
        """Whether a term that is no function of the angle gets into what is written."""
        return self.takes_direction and of_direction(term)

    def may_be_empty(self, options: Mapping[str, Any]) -> bool:
        """Whether a file makes sense without any error of the angle in it."""
        return False

    def at_run_time(self, pattern: TurnPattern, options: Mapping[str, Any]) -> RunTimeTerms | None:
        """The terms that are computed at every reading, where there are any."""
        return None

    @abstractmethod
    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        """The target's table of a pattern."""

    @abstractmethod
    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        """A model of what a table that is there does."""

    def how(self, proof: Proof) -> str:
        """How the difference is known."""
        if self.arithmetic_known:
            return proof.how
        return f"{proof.how} as its description has it, the device's own arithmetic is not known"

    def decoded(self, raw: bytes) -> str:
        """The text that `read` takes, of a file's bytes.

        Raises
        ------
        UnicodeDecodeError
            There is none.
        """
        return raw.decode("utf-8-sig")

    def sign_of(self, options: Mapping[str, Any]) -> str:
        """The sign, where it depends on an option."""
        return self.sign

    def sizes(self, options: Mapping[str, Any]) -> Sequence[int]:
        """Entries to try for ``max_arcsec``, increasing; none where the size is fixed."""
        return self.tried

    def finer(self, options: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
        """Options with which its sizes are tried again where none keeps a maximum."""
        return ()

    def checked(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All options with their defaults.

        Raises
        ------
        ArgumentError
            Names an option the target does not have, or a value it does not take.
        """
        for name, value in given.items():
            if value is not None and name not in self.options:
                known = ", ".join(f"`{known}=`" for known in self.options)
                raise ArgumentError(
                    f"{self.name} has no option `{name}=`; it has "
                    f"{known or 'none'}{did_you_mean(name, self.options)}"
                )
        found = {}
        for name, option in self.options.items():
            value = given.get(name)
            found[name] = option.default if value is None else _checked(name, option, value)
        return found


def _checked(name: str, option: Option, value: Any) -> Any:
    if isinstance(option.values, tuple):
        # A word of digits may be given as the number that it is.
        number = isinstance(value, int) and not isinstance(value, bool)
        return check_choice(name, str(value) if number else value, option.values)
    try:
        if option.values is int and float(value) != int(value):
            raise ValueError
        converted = option.values(value)
        if isinstance(converted, float) and not np.isfinite(converted):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{name} must be {'a whole number' if option.values is int else 'a number'}, "
            f"got {value!r}"
        ) from None
    return converted


def _comment_lines(width: int, text: str, lead: str) -> list[str]:
    """``text`` broken into comment lines of at most ``width`` characters.

    Nothing in it ends the comment or takes the next line into it.
    """
    import textwrap

    text = text.replace("*/", "* /").replace("\\", "/")
    return [
        f"{lead}{line}".rstrip()
        for paragraph in text.splitlines() or [""]
        for line in textwrap.wrap(paragraph, width - len(lead)) or [""]
    ]
