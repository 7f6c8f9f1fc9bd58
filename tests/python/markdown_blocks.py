"""Runs the code blocks of a Markdown page: what a page shows is what happens.

``python`` blocks are doctests (or plain code), one session a page; ``console`` blocks hold
``$ command`` lines and the output that must follow, run in one folder a page; a block
under ``<!-- file: NAME -->`` is written there. Commands of ``text`` blocks, which need what only
their reader has, are those of the program with its options.
"""

from __future__ import annotations

import contextlib
import doctest
import io
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from trueangle.cli import build_parser, main

FENCE = re.compile(
    r"(?:^<!-- file: (\S+) -->\n)?^```(\w+)[^\n]*\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


class Block(NamedTuple):
    language: str
    file: str | None
    text: str
    line: int


def blocks(page: Path) -> list[Block]:
    text = page.read_text(encoding="utf-8")
    return [
        Block(match[2], match[1], match[3], text.count("\n", 0, match.start()) + 1)
        for match in FENCE.finditer(text)
    ]


def run_page(page: Path, folder: Path, skip: tuple[str, ...] = ()) -> int:
    """Run every block of ``page`` in ``folder``; the number of blocks run.

    Commands that contain one of ``skip`` are not run (those that CI itself runs).
    """
    session: dict[str, object] = {}
    ran = 0
    for block in blocks(page):
        where = f"{page.name}:{block.line}"
        if block.file is not None:
            (folder / block.file).write_text(block.text, encoding="utf-8")
        elif block.language == "python":
            with contextlib.chdir(folder):
                run_python(block, session, where)
        elif block.language == "console":
            if any(word in block.text for word in skip):
                continue
            run_console(block.text, folder, where)
        elif block.language == "text":
            check_options(block.text)
        else:
            continue
        ran += 1
    return ran


def check_options(text: str) -> None:
    """Parse commands that cannot be run here."""
    commands = r"(?:^|\| )(?:\$ )?trueangle ([^|>\n]+)"
    for command in re.findall(commands, text.replace("\\\n", ""), re.MULTILINE):
        build_parser().parse_args(shlex.split(command, comments=True))


def run_python(block: Block, session: dict[str, object], where: str) -> None:
    if ">>>" not in block.text:
        exec(compile(block.text, where, "exec"), session)
        return
    test = doctest.DocTestParser().get_doctest(block.text, session, where, where, block.line)
    report: list[str] = []
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    runner.run(test, out=report.append, clear_globs=False)
    session.update(test.globs)
    assert runner.failures == 0, "".join(report)


def run_console(text: str, folder: Path, where: str) -> None:
    checker = doctest.OutputChecker()
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, expected = part.partition("\n")
        while command.endswith("\\"):
            more, _, expected = expected.partition("\n")
            command = command[:-1] + more.removeprefix("> ").strip()
        status, out, err = _done(command.removeprefix(".venv/bin/"), folder)
        assert status == 0, f"{where}: $ {command}\n{err}"
        if expected.strip():
            assert checker.check_output(expected, out, FLAGS), (
                f"{where}: $ {command}\nexpected:\n{expected}\ngot:\n{out}"
            )


def _done(command: str, folder: Path) -> tuple[int | str | None, str, str]:
    """Exit status, output and errors: of trueangle alone in this process, of a shell otherwise."""
    if command.startswith("trueangle ") and not re.search(r"[|<>&;*$`]", command):
        out, err = io.StringIO(), io.StringIO()
        with (
            contextlib.chdir(folder),
            contextlib.redirect_stdout(out),
            contextlib.redirect_stderr(err),
        ):
            try:
                status: int | str | None = main(shlex.split(command)[1:])
            except SystemExit as left:
                status = left.code or 0
        return status, out.getvalue(), err.getvalue()
    command = re.sub(r"^trueangle\b", f"{sys.executable} -m trueangle", command)
    done = subprocess.run(
        ["bash", "-c", command], cwd=folder, capture_output=True, text=True, timeout=300
    )
    return done.returncode, done.stdout, done.stderr
