"""One command sets the version of a release."""

import re
import shutil
import subprocess
import sys
import tomllib
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from conftest import ROOT

PLACES = ("Cargo.toml", "Cargo.lock", "src/table/Cargo.toml", "CITATION.cff", "CHANGELOG.md")


@pytest.fixture
def checkout(tmp_path):
    """What holds the version, with the script beside it."""
    for name in (*PLACES, "README.md", "docs/index.md", ".ci/version"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    return tmp_path


def version(checkout, *words):
    command = [sys.executable, str(checkout / ".ci" / "version"), *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.returncode, (done.stdout + done.stderr).strip()


def test_the_version_is_one_everywhere():
    from trueangle import _core

    assert version(ROOT) == (0, _core.__version__)


def test_a_version_is_set_everywhere_with_its_date(checkout):
    log = (checkout / "CHANGELOG.md").read_text("utf-8")
    log = log.replace("## [Unreleased]\n", "## [Unreleased]\n\n### Added\n- A thing.\n", 1)
    (checkout / "CHANGELOG.md").write_text(log, encoding="utf-8")
    assert version(checkout, "9.8.7", "--date", "2031-02-03") == (0, "9.8.7")
    assert version(checkout) == (0, "9.8.7")
    table = tomllib.loads((checkout / "Cargo.toml").read_text("utf-8"))
    assert table["package"]["version"] == "9.8.7"
    assert table["dependencies"]["trueangle-table"]["version"] == "9.8.7"
    log = (checkout / "CHANGELOG.md").read_text("utf-8")
    assert "## [Unreleased]\n\n## [9.8.7] - 2031-02-03\n\n### Added\n- A thing." in log
    assert "\ndate-released: 2031-02-03\n" in (checkout / "CITATION.cff").read_text("utf-8")
    assert "pip install trueangle-9.8.7-*.whl" in (checkout / "README.md").read_text("utf-8")
    status, told = version(checkout, "9.9.0")
    assert (status, told) == (
        1,
        "CHANGELOG.md: nothing under [Unreleased]; describe what users get",
    )


@pytest.mark.parametrize(("given", "status"), [("0.0.1", 1), ("0.3", 2), ("v9.0.0", 2)])
def test_no_earlier_version_and_no_other_form(checkout, given, status):
    before = (checkout / "Cargo.toml").read_text("utf-8")
    assert version(checkout, given)[0] == status
    assert (checkout / "Cargo.toml").read_text("utf-8") == before


def test_a_place_with_another_version_is_named(checkout):
    cited = checkout / "CITATION.cff"
    cited.write_text(re.sub(r"(?m)^version: .*$", "version: 0.0.9", cited.read_text("utf-8")))
    status, told = version(checkout)
    assert status == 1
    assert told.startswith("CITATION.cff: version 0.0.9; ")


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
