"""What long work shows of how far it is: when, on what, and in which words."""

from __future__ import annotations

import io
import json

import pytest

from trueangle.logs.report import Progress
from trueangle.support.deadline import Deadline


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Clock:
    """Seconds that a test sets."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_nothing_is_shown_in_the_first_second_nor_off_a_terminal() -> None:
    clock = Clock()
    for stream, style, shown in (
        (Terminal(), "auto", "sums: 2 of 4, at least 1 s left"),
        (io.StringIO(), "auto", ""),
        (Terminal(), "none", ""),
        (io.StringIO(), "text", "sums: 2 of 4, at least 1 s left"),
    ):
        clock.now = 0.0
        work = Deadline(style=style, stream=stream, clock=clock)
        work.at("sums", 0, 4)
        clock.now = 0.99
        work.at("sums", 1, 4)
        assert stream.getvalue() == ""
        clock.now = 1.0
        work.at("sums", 2, 4)
        assert stream.getvalue().strip() == shown
        work.clear()
        assert stream.getvalue().split("\r")[-1] == ""


def test_it_is_shown_anew_every_half_second() -> None:
    clock, stream = Clock(), io.StringIO()
    work = Deadline(10.0, "json", stream, clock)
    for now in (0.0, 1.0, 1.49, 1.5, 1.75, 1.99, 2.0):
        clock.now = now
        work.at("sums", 0, 4)
    lines = [json.loads(line) for line in stream.getvalue().splitlines()]
    assert [line["seconds"] for line in lines] == [1.0, 1.5, 2.0]


@pytest.mark.parametrize("within", [10.0, None])
def test_progress_as_json_is_an_object_a_line(within: float | None) -> None:
    clock, stream = Clock(), io.StringIO()
    work = Deadline(within, "json", stream, clock)
    for stage, begin, total in (("sums", 0.0, 5), ("rounds", 20.0, 4)):
        for k in range(total):
            clock.now = begin + 2.0 * k
            work.at(stage, k, total, then=7.0)
    lines = stream.getvalue().splitlines()
    told = [json.loads(line) for line in lines]
    assert all(line.startswith("{") and line.endswith("}") for line in lines)
    # The first look falls into the first second.
    assert [(x["stage"], x["done"], x["total"]) for x in told] == [
        *(("sums", k, 5) for k in range(1, 5)),
        *(("rounds", k, 4) for k in range(4)),
    ]
    assert [x["seconds"] for x in told] == [2.0, 4.0, 6.0, 8.0, 20.0, 22.0, 24.0, 26.0]
    # Two seconds for each that is left of the stage, and what follows it; or what was given.
    left = [15.0, 13.0, 11.0, 9.0, None, 13.0, 11.0, 9.0]
    if within is not None:
        left = [max(within - x["seconds"], 0.0) for x in told]
    assert [x["seconds_left"] for x in told] == left


def work(stream, style):
    clock = Clock()
    shown = Progress(3, 4000, style, stream, clock)
    shown.finish_file(1000, skipped=True)
    shown.start_file(1000)
    for step in range(1, 5):
        clock.now += 0.25
        shown.advance(100, step / 4)
    shown.finish_file(1000)
    shown.clear()
    return stream.getvalue()


def test_nothing_is_shown_to_no_terminal():
    assert work(io.StringIO(), "auto") == ""
    assert work(Terminal(), "none") == ""


def test_text_tells_files_rows_rate_and_time_left():
    text = work(Terminal(), "auto")
    shown = [part.strip() for part in text.split("\r") if part.strip()]
    # Half a second for half of 1000 bytes; 2500 bytes are left.
    assert shown[0] == "1/3 files, 200 rows, 400 rows/s, 38 %, 3 s left"
    assert len(shown) == 2
    assert text.endswith("\r")  # the line is removed at the end


def test_json_is_an_object_a_line():
    states = [json.loads(line) for line in work(io.StringIO(), "json").splitlines()]
    assert states[1] == {
        "files_done": 1,
        "files": 3,
        "rows": 400,
        "rows_per_second": 400,
        "part": 0.5,
        "seconds_left": 2.0,
    }
