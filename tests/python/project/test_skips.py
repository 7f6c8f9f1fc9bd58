"""Every reason for a skip belongs to a list, so that no job fails on one nobody listed."""

import ast

import pytest

from conftest import ROOT, expected_skips

TESTS = ROOT / "tests" / "python"


def reasons():
    """Reasons of `pytest.skip` and `skipif` in the tests, with placeholders as ``cc``."""
    for path in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            if node.func.attr == "skip" and ast.unparse(node.func.value) == "pytest":
                given = node.args[:1]
            elif node.func.attr == "skipif":
                given = [word.value for word in node.keywords if word.arg == "reason"]
            else:
                continue
            for text in given:
                parts = text.values if isinstance(text, ast.JoinedStr) else [text]
                read = [p.value if isinstance(p, ast.Constant) else "cc" for p in parts]
                yield f"{path.relative_to(TESTS)}:{node.lineno}", "".join(map(str, read))


def test_every_reason_is_on_a_list():
    found = list(reasons())
    assert len(found) > 30
    listed = expected_skips("darwin", "win32", "linux", "partial")
    known = [f"{place}: {reason}" for place, reason in found if not listed.search(reason)]
    assert known == []


@pytest.mark.parametrize(
    ("names", "reason", "expected"),
    [
        (("linux", "1"), "not installed: avr-gcc (.ci/firmware installs them)", False),
        (("linux", "partial"), "not installed: avr-gcc (.ci/firmware installs them)", True),
        (("linux", "partial"), "no fork here", False),
        (("win32", "partial"), "no fork here", True),
        (("linux", "1"), "no measured data at /x", True),
    ],
)
def test_a_reason_holds_where_it_is_listed(names, reason, expected):
    assert bool(expected_skips(*names).search(reason)) is expected
