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


@pytest.mark.parametrize("name", MODULES)
def test_examples(name):
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError as cause:
        if (cause.name or "").startswith("trueangle"):
            raise
        pytest.skip(f"the extra with {cause.name} is not installed")
    found = doctest.testmod(module, extraglobs={"np": np, "ta": ta}, verbose=False)
    assert found.failed == 0


def written(name):
    """Docstrings of a module and of what is defined in it, by their dotted names."""
    try:
        module = importlib.import_module(name)
    except ModuleNotFoundError:  # an extra; `test_examples` looks at the cause
        return
    yield name, module.__doc__ or ""
    for finder in doctest.DocTestFinder(exclude_empty=False).find(module, name):
        yield finder.name, finder.docstring


@pytest.mark.parametrize("name", MODULES)
def test_help_in_a_terminal_shows_formulas_and_no_markup(name):
    for what, text in written(name):
        assert ":math:" not in text, what
        assert "math::" not in text, what
        assert not re.search(r"\\[a-zA-Z]{2,}", text), what  # \frac, \theta ...
