"""The weight of the package: counted as stated, and a limit that is exceeded fails."""

import shutil
import subprocess
import sys

import pytest

from conftest import ROOT


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


def test_lint_weighs_the_package():
    assert "$(PYTHON) .ci/weight\n" in (ROOT / "Makefile").read_text("utf-8")
