"""What a target is: a format that some firmware reads, and its own arithmetic."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..files import Kind
from ..model import HarmonicModel
from .pattern import Pattern
from .proof import Correction, Proof

__all__ = ["Header", "Made", "Option", "Part", "Target", "comment_lines"]

Array = NDArray[np.float64]


class Option(NamedTuple):
    """An option of a target: what it may be, its default and a line of help.

    ``values`` is a tuple of the words allowed, or the type of a number or text.
    """

    values: tuple[str, ...] | type
    default: Any
    help: str


@dataclass(frozen=True)
class Header:
    """What is known when a file is written and stands in its comment."""

    name: str
    sha256: str
    package: str
    proof: Proof
    notes: tuple[str, ...]


class Part(NamedTuple):
    """A table in the target's arithmetic, and what it should be.

    Attributes
    ----------
    corrections : tuple of callable
        Turns subtracted at readings in 2^-32 turns; several where compilers differ.
    exact : callable
        What it should be, at readings in turns.
    slope : float
        Bound of the slopes of table and exact correction together.
    resolution : float
        Turns by which a result is rounded.
    """

    corrections: tuple[Correction, ...]
    exact: Callable[[Array], Array]
    slope: float = 0.0
    resolution: float = 0.0


@dataclass(frozen=True)
class Made:
    """A target's table of a model, before it is proven and written.

    Attributes
    ----------
    text : callable
        The file's content, which states what was proven.
    entries, bytes : int
        Numbers of the table, and the memory they take on the target.
    parts : tuple of Part
        What is proven; of several the maxima add up.
    floor_arcsec : float
        rms that the number format alone leaves.
    step : float
        Distance of two numbers of the format, in turns.
    zero_deg : float
        A constant that the table leaves to the target's own zero.
    lost : callable, optional
        Of its own where several tables are not one of the output's turn.
    notes : tuple of str
    tables : tuple of dict
        One line on each table, where there are several.
    neglected : float
        Turns by which several parts together may differ more than each alone.
    bits : int, optional
        Of a reading, where the target fixes them.
    """

    text: Callable[[Header], str]
    entries: int
    bytes: int
    parts: tuple[Part, ...]
    floor_arcsec: float
    step: float
    zero_deg: float = 0.0
    lost: Callable[[], list[dict[str, float]]] | None = None
    notes: tuple[str, ...] = ()
    tables: tuple[dict[str, Any], ...] = ()
    neglected: float = 0.0
    bits: int | None = None


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
        What is not known of the target, in a sentence; empty where nothing is.
    options : dict
    """

    name: ClassVar[str]
    what: ClassVar[str]
    kind: ClassVar[Kind]
    sign: ClassVar[str]
    argument: ClassVar[str] = "indicated"
    unknown: ClassVar[str] = ""
    options: ClassVar[Mapping[str, Option]] = {}
    #: Options that name files: read, never written.
    files: ClassVar[tuple[str, ...]] = ()

    #: The target's arithmetic is known: what is stated is proven.
    arithmetic_known: ClassVar[bool] = True

    #: It takes what follows the direction of travel besides the pattern.
    takes_direction: ClassVar[bool] = False

    @abstractmethod
    def make(self, pattern: Pattern, options: Mapping[str, Any]) -> Made:
        """The target's table of a pattern."""

    @abstractmethod
    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        """A model of what a table that is there does."""

    def sign_of(self, options: Mapping[str, Any]) -> str:
        """The sign, where it depends on an option."""
        return self.sign

    def sizes(self, options: Mapping[str, Any]) -> Sequence[int]:
        """Entries to try for ``max_arcsec``, increasing; none where the size is fixed."""
        return ()

    def finer(self, options: Mapping[str, Any]) -> Mapping[str, Any] | None:
        """Options to try where no size keeps ``max_arcsec``."""
        return None

    def checked(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """All options with their defaults.

        Raises
        ------
        ArgumentError
            Names an option the target does not have, or a value it does not take.
        """
        for name, value in given.items():
            if value is not None and name not in self.options:
                known = ", ".join(f"--{known.replace('_', '-')}" for known in self.options)
                raise ArgumentError(
                    f"{self.name} has no option --{name.replace('_', '-')}; "
                    f"it has {known or 'none'}"
                )
        found = {}
        for name, option in self.options.items():
            value = given.get(name)
            found[name] = option.default if value is None else _checked(name, option, value)
        return found


def _checked(name: str, option: Option, value: Any) -> Any:
    shown = f"--{name.replace('_', '-')}"
    if isinstance(option.values, tuple):
        if value not in option.values:
            raise ArgumentError(f"{shown} must be {' or '.join(option.values)}, got {value!r}")
        return value
    try:
        if option.values is int and float(value) != int(value):
            raise ValueError
        converted = option.values(value)
        if isinstance(converted, float) and not np.isfinite(converted):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ArgumentError(
            f"{shown} must be {'a whole number' if option.values is int else 'a number'}, "
            f"got {value!r}"
        ) from None
    return converted


def comment_lines(width: int, text: str, lead: str) -> list[str]:
    """``text`` broken into comment lines of at most ``width`` characters."""
    import textwrap

    return [
        f"{lead}{line}".rstrip()
        for paragraph in text.split("\n")
        for line in textwrap.wrap(paragraph, width - len(lead)) or [""]
    ]
