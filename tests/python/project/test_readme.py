"""The front page does what it says."""

from conftest import ROOT
from markdown_blocks import run_page

README = ROOT / "README.md"


def test_every_block_runs(tmp_path):
    # The two commands that build and test everything are run by .ci/run itself.
    assert run_page(README, tmp_path, skip=("python3 -m venv", "cargo test")) >= 3
