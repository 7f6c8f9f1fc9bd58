"""The vocabulary of effects: each in one file, what it declares, what is not said twice."""

import ast
import sys
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest

import trueangle
from trueangle.effects import EFFECTS
from trueangle.effects.effect import telling_apart
from trueangle.model.terms import TERMS

PACKAGE = Path(trueangle.__file__).parent

#: Places where a word that is also a cause means something else: readings left out of a run,
#: and the fault of data whose columns are at another ratio.
WORDS = {
    ("outliers", "certificate/document.py"),
    ("outliers", "runs/checks/rows.py"),
    ("missed_counts", "runs/checks/rows.py"),
    ("wrong_gear_ratio", "runs/checks/angles.py"),
    ("wrong_gear_ratio", "runs/checks/fault.py"),
}

#: Most lines of an effect's file.
MOST_LINES = 400


def quoted(path):
    """Texts that stand in a module, without its docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    documented = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and id(node) not in documented
    }


def test_the_quoted_name_of_a_cause_stands_in_its_own_file_only():
    """In that of its term where it has one, from which the effect takes it."""
    own = {kind: sys.modules[TERMS.get(kind, EFFECTS[kind]).__module__] for kind in EFFECTS}
    strangers = {
        (kind, str(path.relative_to(PACKAGE)))
        for path in PACKAGE.rglob("*.py")
        for kind in quoted(path) & set(EFFECTS)
        if path != Path(own[kind].__file__)
    }
    assert strangers - WORDS == set()


@pytest.mark.parametrize("kind", list(EFFECTS))
def test_an_effect_says_what_it_is(kind):
    effect = EFFECTS[kind]
    assert effect.kind == kind
    assert is_dataclass(effect)
    assert effect.sentence.endswith(".")
    assert effect.measure
    assert effect.__module__ == f"trueangle.effects.{kind}"
    for field in fields(effect):
        assert field.name in effect.__doc__
    lines = (PACKAGE / "effects" / f"{kind}.py").read_text(encoding="utf-8").count("\n")
    assert lines <= MOST_LINES


def test_a_confusion_is_declared_once_by_the_later_of_two():
    order = list(EFFECTS.values())
    for k, effect in enumerate(order):
        for other, measure in effect.confused_with.items():
            assert order.index(other) < k
            assert effect not in other.confused_with
            assert telling_apart(effect, other) == telling_apart(other, effect) == measure
        for contained in effect.contains:
            assert order.index(contained) < k
