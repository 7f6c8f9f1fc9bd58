"""Every example in a docstring runs and shows what it says."""

import doctest
import importlib
import pkgutil
import re

import numpy as np
import pytest

import trueangle as ta

MODULES = ["trueangle"] + [
    module.name
    for module in pkgutil.walk_packages(ta.__path__, "trueangle.")
    if not module.name.endswith(("__main__", "._core"))
]


def imported(name):
    """A module; None where the extra that it needs is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as cause:
        if (cause.name or "").startswith("trueangle"):
            raise
        return None


@pytest.mark.parametrize("start", range(8))  # shared by workers
def test_examples(start):
    modules = [module for module in map(imported, MODULES[start::8]) if module]
    names = {"np": np, "ta": ta}
    failed = [m.__name__ for m in modules if doctest.testmod(m, extraglobs=names).failed]
    assert not failed


def written(name):
    """Docstrings of a module and of what is defined in it, by their dotted names."""
    module = imported(name)
    if module is None:
        return
    yield name, module.__doc__ or ""
    for finder in doctest.DocTestFinder(exclude_empty=False).find(module, name):
        yield finder.name, finder.docstring


#: Markup that help in a terminal would show as it stands: roles, and commands such as ``\theta``.
MARKUP = re.compile(r":math:|math::|\\[a-zA-Z]{2,}")


def test_help_in_a_terminal_shows_formulas_and_no_markup():
    shown = [(what, text) for name in MODULES for what, text in written(name)]
    assert len(shown) > 1000
    assert [what for what, text in shown if MARKUP.search(text)] == []
