"""Every reason for a skip belongs to a list, so that no job fails on one nobody listed."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib

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


#: Distributions whose modules have other names, and those that others bring.
DISTRIBUTIONS = {
    "can": "python-can",
    "distributed": "dask",
    "markupsafe": "jinja2",
    "serial": "pyserial",
    "sklearn": "scikit-learn",
}


def imported():
    """Modules that `pytest.importorskip` asks for by name."""
    for path in sorted(TESTS.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = isinstance(node, ast.Call) and ast.unparse(node.func)
            if called == "pytest.importorskip" and isinstance(node.args[0], ast.Constant):
                yield str(node.args[0].value)


def test_every_module_asked_for_comes_with_the_extra_or_its_lack_is_on_a_list():
    """What only POSIX has is on the list of Windows; ours need what an extra brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras, here, pending = project["optional-dependencies"], set(), ["trueangle[test]"]
    while pending:
        name, _, more = pending.pop().partition("[")
        here.add(re.split("[^a-z0-9.-]", name.lower())[0])
        if name == "trueangle":
            pending += [entry for one in more.rstrip("]").split(",") for entry in extras[one]]
    unknown = []
    for module in set(imported()):
        top = module.partition(".")[0]
        if top in sys.stdlib_module_names:
            known = expected_skips("win32", "partial").search(f"could not import '{module}'")
        else:
            known = DISTRIBUTIONS.get(top, top).replace("_", "-") in here or module in here
        unknown += [] if known else [module]
    assert unknown == []


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


@pytest.fixture
def checkout(tmp_path):
    """A small package of 6 code lines with the script and limits beside it."""
    (tmp_path / ".ci").mkdir()
    for name in ("weight", "arrows"):
        shutil.copy(ROOT / ".ci" / name, tmp_path / ".ci" / name)
    room = tmp_path / "python" / "trueangle" / "fitting"
    room.mkdir(parents=True)
    (tmp_path / "tests").mkdir()
    (room / "fit.py").write_text(
        '"""A docstring\nof two lines."""\n\n# a comment\nimport numpy as np\n\n'
        '_LEAST = 3\nNAMES = ("a", 2)\n\n\ndef f(x):\n    """Return."""\n'
        "    return np.linalg.qr(\n        x  # the readings\n    )\n",
        encoding="utf-8",
    )
    (tmp_path / ".ci" / "weight.toml").write_text("", encoding="utf-8")
    return tmp_path


def weigh(checkout, *arguments):
    command = [sys.executable, checkout / ".ci" / "weight", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_counts_and_the_ratchet(checkout):
    assert weigh(checkout, "--lower").returncode == 1
    limits = (checkout / ".ci" / "weight.toml").read_text(encoding="utf-8")
    for row in ("code = 7", "constants = 1", "linalg = 1", "modules = 1", "fitting = 7"):
        assert f"\n{row}\n" in limits
    assert weigh(checkout).returncode == 0
    path = checkout / "python" / "trueangle" / "fitting" / "fit.py"
    path.write_text(path.read_text("utf-8") + "\nADDED = 2.5\n", encoding="utf-8")
    done = weigh(checkout)
    assert done.returncode == 1
    assert "package.constants: 2, the limit is 1" in done.stdout
    assert "rooms.fitting: 8, the limit is 7" in done.stdout
    weigh(checkout, "--lower")
    assert (checkout / ".ci" / "weight.toml").read_text(encoding="utf-8") == limits
