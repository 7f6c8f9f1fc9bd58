"""Progress: what is shown, when, and that nothing is shown to no terminal."""

import io
import json

from trueangle.logs.report import Progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


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
