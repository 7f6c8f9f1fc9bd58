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
