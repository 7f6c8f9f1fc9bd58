"""A desk with runs, a model, a simulation and logs, and the commands that are tried there."""

import shutil
import sys
from functools import cache

import numpy as np
import pytest

import trueangle as ta
from trueangle.model.writing import model_text

from .shim import Driver, compiled

SIMULATION = """\
[joint]
gear_ratio = 50.0
[noise]
sigma_arcsec = 2.0
[[run]]
samples = 60
[[run]]
samples = 60
direction = -1
"""

#: Commands and what they write; `correct` writes a folder and its manifest.
COMMANDS = {
    "fit": (["fit", "r.csv", "--orders", "1", "-o", "x.json"], "x.json"),
    "simulate": (["simulate", "b.toml", "-o", "x.csv"], "x.csv"),
    "correct": (["correct", "logs", "-m", "m.json", "-o", "out"], "out"),
    "correct one": (["correct", "logs/a.csv", "-m", "m.json", "-o", "x.csv"], "x.csv"),
    "report": (["report", "r.csv", "--orders", "1", "-o", "x.html"], "x.html"),
}


def commands():
    """Names of the commands whose libraries are there."""
    from importlib.util import find_spec

    return [name for name in COMMANDS if name != "report" or find_spec("matplotlib")]


def furnish(folder):
    """Put the inputs of all commands into an empty folder."""
    (folder / "logs").mkdir(parents=True)
    for name, content in inputs().items():
        (folder / name).write_bytes(content)


@cache
def inputs():
    """The inputs of all commands: a thousand desks hold the same."""
    rng = np.random.default_rng(5)
    theta = np.arange(0.0, 360.0, 4.0)
    error = 0.1 * np.sin(np.radians(theta)) + 1e-3 * rng.normal(size=theta.size)
    rows = [f"{t!r},{t + e!r}" for t, e in zip(theta.tolist(), error.tolist(), strict=True)]
    table = "\n".join(["reference_deg,indicated_deg", *rows]) + "\n"
    found = {"r.csv": table, "b.toml": SIMULATION}
    for name in ("a.csv", "b.csv"):
        lines = [f"{x:.9f}" for x in rng.uniform(0.0, 360.0, 50)]
        found[f"logs/{name}"] = "\n".join(["indicated_deg", *lines]) + "\n"
    shaft = ta.Shaft("output", 1, [1, 2], [0.1, 0.0], [0.4, -0.05])
    found["m.json"] = model_text(ta.HarmonicModel([shaft], constant=0.2, period=360.0))
    return {name: text.encode() for name, text in found.items()}


def tree(folder):
    """Every file below a folder, hidden ones too, with its bytes."""
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def desk(tmp_path):
    folder = tmp_path / "desk"
    furnish(folder)
    return folder


@pytest.fixture(scope="session")
def shim(tmp_path_factory):
    """The library that lets calls of the system fail."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not sys.platform.startswith("linux") or compiler is None:
        pytest.skip("calls of the system are made to fail on Linux with a C compiler")
    return compiled(tmp_path_factory.mktemp("shim"), compiler)


@pytest.fixture(scope="session")
def driver(shim, tmp_path_factory):
    """The process whose calls of the system can be made to fail."""
    folder = tmp_path_factory.mktemp("driver")
    furnish(folder / "desk")
    running = Driver(shim, folder / "desk", [COMMANDS[name][0] for name in commands()])
    yield running
    running.close()


@pytest.fixture(scope="session")
def expected(driver, tmp_path_factory):
    """What each command writes when nothing fails, and how often it calls the system."""
    found = {}
    for name in commands():
        folder = tmp_path_factory.mktemp("whole") / "desk"
        furnish(folder)
        before = tree(folder)
        answer = driver.run(folder, COMMANDS[name][0])
        assert answer.status == 0, answer.told
        written = {k: v for k, v in tree(folder).items() if k not in before}
        assert written
        found[name] = written, answer.counts
    return found
