"""Every sentence that commands and pages can say is shown by a transcript, or a test of its room.

A sentence that nobody has read may be changed by anyone. What stands in the sources of both rooms
as text of two words and more is looked for in the approved texts; what is no sentence (patterns,
marks of HTML, lists of options) is told apart by its signs.
"""

from __future__ import annotations

import ast
import html
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import trueangle

from .transcript import HERE

ROOMS = ("cli", "reports")
PACKAGE = Path(trueangle.__file__).parent

#: Letters of a piece of text from which on it is looked for.
LONG = 10

#: What is between sentences: fields of `%`, Python in backquotes, which commands tell otherwise.
_PARTS = re.compile(r"%\(\w+\)\w+|`[^`]*`")

#: What is no sentence: patterns, marks of HTML, arguments as they are declared, lists of options.
_SIGNS = re.compile(
    r"\(\?P?|\\[bdw]|[<>]|\" ?[a-z-]+=\"|^ ?transform=|^--\S+ --"
    r"|^-\S+( --\S+)? \S+$|^\w+ [A-Z|]+\.{3}$"
)

#: Said to nobody.
UNSAID = ("no value of an option", "has no attribute", "holding runs out")


def plain(text: str) -> str:
    """Letters and signs alone: lines are broken where a terminal or a source has to."""
    return re.sub(r"[\s\\\"'`]+", "", text)


@pytest.fixture(scope="module")
def shown() -> str:
    tests = HERE.parent
    files = [*HERE.glob("approved/*.txt"), *(f for r in ROOMS for f in (tests / r).glob("*.py"))]
    return plain(" ".join(path.read_text(encoding="utf-8") for path in files))


def sentences(path: Path) -> Iterator[tuple[int, str]]:
    """Texts of a module but its docstrings, with their lines."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documents = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in documents and " " in node.value.strip():
            yield node.lineno, node.value


def missing(texts: Iterator[tuple[int, str]], shown: str) -> list[str]:
    """Those that no approved text holds."""
    return [
        f"line {line}: {part!r}"
        for line, text in texts
        if not _SIGNS.search(text) and not any(said in text for said in UNSAID)
        for part in _PARTS.split(text)
        if len(plain(part)) >= LONG and plain(part) not in shown
    ]


def test_every_sentence_of_a_module_is_shown(shown):
    paths = [p for room in ROOMS for p in sorted((PACKAGE / room).glob("*.py"))]
    assert not [(p.name, lost) for p in paths if (lost := missing(sentences(p), shown))]


def test_every_sentence_of_a_template_is_shown(shown):
    lost = {}
    for path in sorted((PACKAGE / "reports" / "templates").glob("*.j2")):
        text = re.sub(r"<(style|script).*?</\1>", "", path.read_text("utf-8"), flags=re.S)
        # What is set between these is not what is shown as one piece.
        text = re.sub(r"\{%.*?%\}|\{\{.*?\}\}|<[^>]*>", "\n", text)
        lines = (html.unescape(line) for line in text.splitlines())
        lost[path.name] = missing(((0, line) for line in lines if " " in line.strip()), shown)
    assert not any(lost.values()), lost


def test_a_sentence_that_nobody_has_read_is_told(tmp_path):
    (tmp_path / "a.py").write_text('"""A document."""\nx = f"nobody has read {1} of these words"\n')
    assert missing(sentences(tmp_path / "a.py"), "ofthesewords") == ["line 2: 'nobody has read '"]
