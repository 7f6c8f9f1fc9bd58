"""The page of promises names tests that are there."""

from __future__ import annotations

import re

from conftest import ROOT


def test_every_promise_names_tests_that_exist() -> None:
    page = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
    promised, planted, _ = page.partition("**Planted faults.**")
    assert planted
    rows = [line for line in promised.splitlines() if line.startswith("| ")][2:]
    assert len(rows) >= 12
    for row in rows:
        named = re.findall(r"`((?:tests|\.ci)/[^`]+)`", row)
        assert named, row
        for path in named:
            assert (ROOT / path).exists(), path


def test_every_part_of_the_night_has_a_job() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    workflow = (ROOT / ".github" / "workflows" / "nightly.yml").read_text(encoding="utf-8")
    parts = re.findall(r"^NIGHTLY = (.*)$", makefile, re.MULTILINE)[0].split()
    jobs = re.findall(r"^ +part: \[(.*)\]$", workflow, re.MULTILINE)[0].split(", ")
    assert len(parts) >= 8
    assert sorted(parts) == sorted(jobs)
    for part in parts:
        assert re.search(rf"^{part}:.*##", makefile, re.MULTILINE), part


def test_the_version_is_one_everywhere() -> None:
    import tomllib

    from trueangle import _core

    cargo = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))
    version = cargo["package"]["version"]
    assert _core.__version__ == version
    assert cargo["dependencies"]["trueangle-table"]["version"] == version
    table = tomllib.loads((ROOT / "src" / "table" / "Cargo.toml").read_text(encoding="utf-8"))
    assert table["package"]["version"] == version
    locked = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    own = [package for package in locked if package["name"].startswith("trueangle")]
    assert {package["version"] for package in own} == {version}
    log = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    released = re.findall(r"^## \[(\d\S*)\] - (\S+)$", log, re.MULTILINE)
    assert released[0][0] == version
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {version}\n" in cited
    assert f"\ndate-released: {released[0][1]}\n" in cited
