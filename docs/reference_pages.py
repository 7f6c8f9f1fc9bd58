"""Blocks ``{reference}`` of the pages: a summary table, then every entry in full."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

__all__ = ["entries", "expanded", "imported", "pages"]

#: A list of names between fences; a name may be followed by the members to show.
BLOCK = re.compile(r"^```\{reference\}\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def imported(name: str) -> object:
    """What stands at a dotted path of modules and attributes.

    Raises
    ------
    ImportError
        Nothing does.
    """
    module, _, attribute = name.rpartition(".")
    try:
        return getattr(importlib.import_module(module), attribute)
    except AttributeError:
        raise ImportError(f"{name}: {module} has no {attribute}") from None


def entries(block: str) -> Iterator[tuple[str, str]]:
    """Names of a block with their members; ``module.*`` is what ``__all__`` has to be called."""
    for line in filter(None, map(str.strip, block.splitlines())):
        name, _, members = line.partition(":")
        if not name.endswith(".*"):
            yield name, members.strip()
            continue
        module = name.removesuffix(".*")
        for attribute in importlib.import_module(module).__all__:
            if callable(imported(f"{module}.{attribute}")):
                yield f"{module}.{attribute}", ""


def expanded(text: str) -> str:
    """The page with its blocks as reStructuredText for autodoc."""
    return BLOCK.sub(lambda found: _block(found[1]), text)


def _block(block: str) -> str:
    found = list(entries(block))
    lines = ["```{eval-rst}", ".. autosummary::", "   :nosignatures:", ""]
    lines += [f"   ~{name}" for name, _ in found if callable(imported(name))]
    for name, members in found:
        lines += ["", *_directive(name, members)]
    return "\n".join([*lines, "```"])


def _directive(name: str, members: str) -> list[str]:
    what = imported(name)
    if inspect.isclass(what):
        # In full under the name that users import: of a class of another name Sphinx says no more
        # than "alias of" (`trueangle.model.terms.Backlash` is a `BacklashTerm`).
        what.__name__ = name.rpartition(".")[2]
        kind = "autoexception" if issubclass(what, BaseException) else "autoclass"
        options = [f"   :members: {members}".rstrip()]
        if kind == "autoclass" and not members:  # what it has of the classes below it, too
            options.append("   :inherited-members: Shown, tuple, Mapping")
        return [f".. {kind}:: {name}", *options]
    if callable(what):
        return [f".. autofunction:: {name}"]
    return [f".. autodata:: {name}", "   :no-value:"]


def pages(folder: Path) -> Iterator[tuple[str, str]]:
    """(page, name) of every entry below a folder."""
    for path in sorted(folder.glob("*.md")):
        for block in BLOCK.findall(path.read_text(encoding="utf-8")):
            for name, _ in entries(block):
                yield path.stem, name
