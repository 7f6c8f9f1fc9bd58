"""Imports point one way, and the check of that sees what is planted."""

import importlib.util
import shutil
import subprocess
import sys
from importlib.machinery import SourceFileLoader

import pytest

from conftest import ROOT

CHECK = ROOT / ".ci" / "arrows"


loader = SourceFileLoader("arrows", str(CHECK))
arrows = importlib.util.module_from_spec(importlib.util.spec_from_loader("arrows", loader))
sys.modules["arrows"] = arrows
loader.exec_module(arrows)


@pytest.fixture
def package(tmp_path):
    """A copy of the package with the rules and the core's text where they belong."""
    shutil.copytree(
        ROOT / "python" / "trueangle",
        tmp_path / "python" / "trueangle",
        ignore=shutil.ignore_patterns("*.so", "__pycache__"),
    )
    shutil.copytree(ROOT / "src", tmp_path / "src")
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "arrows.toml", tmp_path / ".ci")
    return tmp_path / "python" / "trueangle"


def check(package):
    return arrows.check(package, package.parents[1] / ".ci" / "arrows.toml")


def plant(path, text):
    path.write_text(path.read_text("utf-8") + text, "utf-8")


def test_all_arrows_point_one_way():
    done = subprocess.run([sys.executable, str(CHECK)], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_make_lint_runs_it_and_weighs():
    text = (ROOT / "Makefile").read_text("utf-8")
    assert "$(PYTHON) .ci/arrows\n\t$(PYTHON) .ci/weight\n" in text


@pytest.mark.parametrize(
    "planted",
    [
        "def planted():\n    from .files import read_runs",
        "if TYPE_CHECKING:\n    from .files import read_runs",
        'planted = importlib.import_module("trueangle.runs.files")',
    ],
)
def test_a_circle_is_seen_whatever_its_import_is_for(planted, package):
    plant(package / "runs/run.py", f"\n\n{planted}\n")
    (said,) = (line for line in check(package) if "circle" in line)
    assert "runs.run:" in said
    assert "runs.files:" in said


#: Arrows that must never be: the file, an import, and a word of the reason.
FORBIDDEN = {
    "face": ("fitting/orders/verdicts.py", "from ... import fit", "face"),
    "face, by its name": ("fitting/orders/verdicts.py", "import trueangle", "face"),
    "drawing": ("model/corrector.py", "from ..plots import curves", "plots stands above model"),
    "drawing, by the full name": ("model/model.py", "import trueangle.plots.palette", "above"),
    "reports": ("diagnosis/levels.py", "from ..reports import page", "reports stands above"),
    "a fit by a picture": ("plots/planpictures.py", "from ..fitting import fit", "do not fit"),
    "a format and a model": ("formats/__init__.py", "from ..model import model", "above formats"),
    "an effect and a diagnosis": ("effects/backlash.py", "from .. import diagnosis", "above"),
    "a fit and a diagnosis": ("fitting/fit.py", "from ..diagnosis import gain", "above fitting"),
    "the ground": ("support/files/outputs.py", "from ...model import model", "above support"),
}


@pytest.mark.parametrize(
    ("case", "where"),
    [
        *((case, "def planted():\n    {}") for case in FORBIDDEN),
        ("face", "{}"),
        ("drawing", "if TYPE_CHECKING:\n    {}"),
    ],
)
def test_a_forbidden_arrow_is_seen(case, where, package):
    name, statement, reason = FORBIDDEN[case]
    plant(package / name, "\n\n" + where.format(statement) + "\n")
    said = check(package)
    module = name.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    assert any(line.startswith(f"{module}:") and reason in line for line in said), said


def test_python_in_the_core_is_seen(package):
    plant(package.parents[1] / "src" / "angle.rs", "\nuse pyo3::prelude::*;\n")
    (said,) = check(package)
    assert said.startswith("src/angle.rs:")
    assert "knows no Python" in said


def test_a_cause_named_in_another_file_is_seen(package):
    plant(package / "diagnosis" / "gain.py", '\nPLANTED = ("backlash",)\n')
    (said,) = check(package)
    assert said.startswith("diagnosis.gain:")
    assert "'backlash': a cause's name" in said


def test_an_exception_that_is_no_more_must_go(package):
    path = package / "plots" / "phasesoverruns.py"
    text = path.read_text("utf-8")
    assert "from ..fitting.phases import " in text
    path.write_text(text.replace("from ..fitting.phases import ", "from math import "), "utf-8")
    declared = "'plots.phasesoverruns -> fitting.phases'"
    assert check(package) == [f"arrows.toml: {declared} is declared and is no more"]


def test_a_room_on_no_floor_is_seen(package):
    (package / "attic.py").write_text("from . import errors\n", "utf-8")
    assert check(package) == ["arrows.toml: the room 'attic' stands on no floor"]
