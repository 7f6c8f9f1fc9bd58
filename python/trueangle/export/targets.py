"""All targets: one file and one line each."""

from __future__ import annotations

from ..errors import ArgumentError
from .c import CHeader
from .csvtable import CsvTable
from .rust import RustModule
from .target import Target

__all__ = ["TARGETS", "target_of"]

#: Every target by its name.
TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        CHeader(),
        RustModule(),
        CsvTable(),
    )
}


def target_of(name: str) -> Target:
    """The target of a name.

    Raises
    ------
    ArgumentError
        There is none.
    """
    if name not in TARGETS:
        raise ArgumentError(f"there is no target {name!r}; the targets are {', '.join(TARGETS)}")
    return TARGETS[name]
