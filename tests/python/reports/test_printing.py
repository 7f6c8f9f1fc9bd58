"""What a browser is asked to print, which one is taken, and what is told where it did not."""

import re
import stat
import sys

import pytest

from trueangle.errors import ArgumentError
from trueangle.reports import page
from trueangle.reports.page import _BROWSERS, find_browser, print_pdf

#: A browser that writes what it was asked, and one that says three lines and writes nothing.
PRINTS = """
import sys, pathlib, urllib.parse, urllib.request
asked = dict(word[2:].partition("=")[::2] for word in sys.argv[1:-1])
address, fragment = sys.argv[-1].split("#")
name = urllib.request.url2pathname(urllib.parse.urlparse(address).path)
told = [*(name for name in asked if not asked[name]), asked["virtual-time-budget"], fragment]
text = " ".join(told) + "|" + pathlib.Path(name).read_text("utf-8")
pathlib.Path(asked["print-to-pdf"]).write_text(text, "utf-8")
"""
FAILS = "import sys; sys.stderr.write('first\\nsecond\\nthird  \\n')"


def browser(folder, name, code=PRINTS):
    path = folder / name
    path.write_text(f"#!{sys.executable}\n{code}")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


@pytest.fixture(autouse=True)
def alone(tmp_path, monkeypatch):
    """A folder of programs that is the only one."""
    folder = tmp_path / "programs"
    folder.mkdir()
    monkeypatch.setenv("PATH", str(folder))
    return folder


@pytest.mark.skipif(sys.platform == "win32", reason="programs are scripts here")
@pytest.mark.parametrize(("user", "sandbox"), [(0, " no-sandbox"), (1000, "")])
def test_the_page_is_printed_whole_and_without_dates(alone, tmp_path, monkeypatch, user, sandbox):
    """As whoever runs it: the superuser without a sandbox, which browsers refuse it."""
    monkeypatch.setattr(page.os, "geteuid", lambda: user, raising=False)
    print_pdf("<p>Ångström</p>", tmp_path / "made.pdf", browser(alone, "own"))
    told, _, text = (tmp_path / "made.pdf").read_text("utf-8").partition("|")
    assert told == f"headless disable-gpu no-pdf-header-footer{sandbox} 20000 print"
    assert text == "<p>Ångström</p>"
    assert {path.name for path in tmp_path.iterdir()} == {"made.pdf", "programs"}


@pytest.mark.skipif(sys.platform == "win32", reason="programs are scripts here")
def test_the_first_browser_that_is_there_is_taken(alone):
    """One after the other is put beside those found before, from the last of the list on."""
    assert find_browser() is None
    for name in reversed(_BROWSERS):
        path = browser(alone, name)
        assert find_browser() == path


@pytest.mark.skipif(sys.platform == "win32", reason="programs are scripts here")
@pytest.mark.parametrize(
    ("code", "says"), [(FAILS, "did not print: third"), ("", "did not print: no message")]
)
def test_a_browser_that_did_not_print_is_named_with_its_last_line(alone, tmp_path, code, says):
    program = browser(alone, "chrome", code)
    with pytest.raises(ArgumentError) as found:
        print_pdf("", tmp_path / "made.pdf")
    assert str(found.value) == f"{program} {says}"
    assert not (tmp_path / "made.pdf").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="programs are scripts here")
def test_a_browser_that_does_not_end_is_given_up(alone, tmp_path, monkeypatch):
    monkeypatch.setattr(page, "_TIMEOUT_S", 0.2)
    program = browser(alone, "msedge", "import time; time.sleep(5)")
    with pytest.raises(ArgumentError, match=r"did not print within 0\.2 s") as found:
        print_pdf("", tmp_path / "made.pdf")
    assert str(found.value).startswith(program)


@pytest.mark.parametrize("asked", [None, "other"])
def test_no_browser_is_told_with_names_of_some(tmp_path, asked):
    with pytest.raises(ArgumentError) as found:
        print_pdf("", tmp_path / "made.pdf", asked)
    assert str(found.value) == (
        "a PDF needs an installed browser (chromium, chromium-browser, google-chrome ...): install "
        "one, or open the HTML report and print it"
    )


#: Directives that a page needs; all else falls back to none of it.
NEEDED = {
    "default-src": {"'none'"},
    "script-src": {"'unsafe-inline'"},
    "style-src": {"'unsafe-inline'"},
    "img-src": {"data:"},
}


def test_the_policy_lets_a_page_reach_nothing(made):
    page = made.html
    (policy,) = re.findall(r'<meta http-equiv="Content-Security-Policy" content="([^"]*)">', page)
    found = {}
    for directive in policy.split(";"):
        name, *sources = directive.split()
        assert name not in found
        found[name] = set(sources)
    assert found == NEEDED
    # It holds for what stands behind it: nothing runs before.
    before = page[: page.index("Content-Security-Policy")]
    assert not re.search(r"<(script|style|link|img)\b", before)
