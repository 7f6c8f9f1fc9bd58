"""Every file of the package in a line, room by room, from what the files say of themselves."""

from __future__ import annotations

import ast
from pathlib import Path

__all__ = ["first_sentence", "room_files_page", "rooms_of"]

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "python" / "trueangle"


def rooms_of(contributing: str) -> list[str]:
    """Rooms of the table, from the ground up."""
    start, end = (contributing.index(f"<!-- {mark} -->") for mark in ("rooms", "end of rooms"))
    cells = [line.split("|")[1] for line in contributing[start:end].splitlines() if "| `" in line]
    return [name.strip(" `/") for cell in cells for name in cell.split(",")]


def first_sentence(file: Path) -> str:
    """What a file says it holds."""
    told = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(told.split("\n\n")[0].split())


def room_files_page() -> str:
    """A table for each folder, closed until it is opened."""
    parts = []
    for room in rooms_of((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")):
        files = sorted((PACKAGE / room).rglob("*.py"))
        rows = [
            f"| `{file.relative_to(PACKAGE)}` | {first_sentence(file)} |"
            for file in files
            if file.name != "__init__.py"
        ]
        if rows:
            table = ["| file | what it holds |", "| --- | --- |", *rows]
            parts.append("\n".join([f":::{{dropdown}} {room}/", *table, ":::", ""]))
    return "\n".join(parts)
