"""The script that tries a wheel on every Python: what it finds, and what it refuses."""

import subprocess
import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from conftest import ROOT

SCRIPT = ROOT / ".ci" / "pythons"


@pytest.fixture(scope="module")
def pythons():
    loader = SourceFileLoader("pythons", str(SCRIPT))
    spec = spec_from_loader(loader.name, loader)
    assert spec is not None
    module = module_from_spec(spec)
    loader.exec_module(module)
    return module


def test_the_running_version_is_found_and_no_other(pythons):
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    assert pythons.found_here(version) is not None
    assert pythons.found_here("2.0") is None


def test_every_supported_version_is_tried(pythons):
    workflow = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    for version in pythons.VERSIONS:
        assert f'"{version}"' in workflow


def test_a_wheel_that_is_not_there_is_one_line(tmp_path: Path):
    wheel = tmp_path / "none.whl"
    done = subprocess.run(
        [sys.executable, str(SCRIPT), str(wheel)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    last = done.stderr.strip().splitlines()[-1]
    assert str(wheel) in last
    assert "maturin build" in last
