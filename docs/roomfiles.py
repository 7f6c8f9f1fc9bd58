"""Every file of the package in a line with the names it defines, room by room, from the files."""

from __future__ import annotations

import ast
import functools
from pathlib import Path

__all__ = ["defined_names", "first_sentence", "room_files_page", "rooms_of", "syntax"]

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "python" / "trueangle"


def rooms_of(contributing: str) -> list[str]:
    """Rooms of the table, from the ground up."""
    start, end = (contributing.index(f"<!-- {mark} -->") for mark in ("rooms", "end of rooms"))
    cells = [line.split("|")[1] for line in contributing[start:end].splitlines() if "| `" in line]
    return [name.strip(" `/") for cell in cells for name in cell.split(",")]


@functools.cache
def syntax(file: Path) -> ast.Module:
    """A file taken apart."""
    return ast.parse(file.read_text(encoding="utf-8"))


def first_sentence(file: Path) -> str:
    """What a file says it holds."""
    told = ast.get_docstring(syntax(file)) or ""
    return " ".join(told.split("\n\n")[0].split())


def defined_names(file: Path) -> list[str]:
    """Functions and classes of a file that others use: what its page is searched for."""
    kinds = (ast.FunctionDef, ast.ClassDef)
    body = syntax(file).body
    names = {node.name for node in body if isinstance(node, kinds)}  # an overload once
    return sorted(name for name in names if not name.startswith("_"))


def room_files_page() -> str:
    """A table for each folder, closed until it is opened."""
    parts = []
    for room in rooms_of((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")):
        files = sorted((PACKAGE / room).rglob("*.py"))
        rows = [
            f"| `{file.relative_to(PACKAGE)}` | {first_sentence(file)} |"
            f" {', '.join(f'`{name}`' for name in defined_names(file))} |"
            for file in files
            if file.name != "__init__.py"
        ]
        if rows:
            table = ["| file | what it holds | names |", "| --- | --- | --- |", *rows]
            parts.append("\n".join([f":::{{dropdown}} {room}/", *table, ":::", ""]))
    return "\n".join(parts)


if __name__ == "__main__":
    print(room_files_page())
