"""Every example in a docstring runs and shows what it says."""

import doctest
import importlib
import pkgutil

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
