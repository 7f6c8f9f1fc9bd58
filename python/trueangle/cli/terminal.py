"""The terminal: plain streams that nothing steers, colours where it has them."""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Iterator
from typing import Any, Final, TextIO

STANDARD_OUTPUT: Final = "standard output"

#: Control characters but tab and line end, what turns the direction of text, and halves of
#: surrogates, which represent bytes of file names that are no UTF-8.
_UNPRINTABLE: Final = (
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2028\u2029"
    "\u2066-\u2069\ufeff\ud800-\udfff]"
)
#: What lays out text is no control character here.
_LAID_OUT: Final = {ord("\t"): None, ord("\n"): None}


def printable_text(text: str) -> str:
    r"""``text`` with control characters written as escapes.

    Examples
    --------
    >>> printable_text("run \x1b[31mred")
    'run \\x1b[31mred'
    """
    if text.isascii() and text.translate(_LAID_OUT).isprintable():
        return text
    return re.sub(_UNPRINTABLE, _escaped, text)


def _escaped(found: re.Match[str]) -> str:
    code = ord(found[0])
    if 0xDC80 <= code <= 0xDCFF:  # a byte that Python could not decode
        return f"\\x{code - 0xDC00:02x}"
    return f"\\x{code:02x}" if code < 0x100 else f"\\u{code:04x}"


class PlainStream:
    """A stream for text that passes on `printable_text` text only.

    Parameters
    ----------
    stream : text stream
    name : str
        Of the stream, as the file name of errors that it meets.
    wording : callable, optional
        Takes every text before it is passed on: `trueangle.cli.wording.Wording`.

    Attributes
    ----------
    steering : text stream
        The stream itself, for the program's own line of progress.
    """

    def __init__(
        self, stream: TextIO, name: str = STANDARD_OUTPUT, wording: Callable[[str], str] = str
    ) -> None:
        self.steering = stream
        self._name = name
        self._wording = wording
        self._coloured = has_colours(stream)

    def write(self, text: str) -> int:
        """Write; signs that the stream's encoding lacks become escapes."""
        shown = printable_text(self._wording(text))
        if self._coloured:
            shown = coloured_text(shown)
        with self._named():
            try:
                self.steering.write(shown)
            except UnicodeEncodeError:
                encoding = self.steering.encoding or "ascii"
                self.steering.write(shown.encode(encoding, "backslashreplace").decode(encoding))
        return len(text)

    def flush(self) -> None:
        """Flush."""
        with self._named():
            self.steering.flush()

    def writelines(self, lines: Any) -> None:
        """Write one after the other."""
        for line in lines:
            self.write(line)

    @contextlib.contextmanager
    def _named(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OSError(error.errno, error.strerror, self._name) from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self.steering, name)


@contextlib.contextmanager
def plain_streams(wording: Callable[[str], str] = str) -> Iterator[None]:
    """Let everything that is printed pass `PlainStream`, in the words of a command."""
    # A process started without them (pythonw, closed descriptors) has None.
    out, err = sys.stdout, sys.stderr
    with contextlib.ExitStack() as stack:
        if out is not None:
            stack.enter_context(contextlib.redirect_stdout(PlainStream(out, wording=wording)))
        if err is not None:
            stack.enter_context(
                contextlib.redirect_stderr(PlainStream(err, "standard error", wording))
            )
        yield


def silence_output() -> None:
    """Send what is still to be printed nowhere: Python would complain at its end."""
    try:
        handle = sys.stdout.fileno()
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, handle)
        os.close(nowhere)
    except (OSError, ValueError, AttributeError):
        pass


#: What is emphasised in a text: bold, red, yellow, green. Colours add nothing to the words.
_RULES: Final = (
    (r"\berror:|\bNOT UNDERSTOOD\b|\bNO ORDER RETAINED\b|\bNOT DETERMINED\b|\bDISAGREE\b", "1;31"),
    (r"\bwarning:|^ *! |\bNOT CONFIRMED\b|^Not confirmed:", "33"),
    (r"^Confirmed:|\bretained$|^Nothing beyond the simulation:|^No fault found", "32"),
    (r"^\d+\. .*|^[A-Z][^\n]*:$|did you mean [^\n?]+\?", "1"),
)


def has_colours(stream: Any) -> bool:
    """Whether a stream is a terminal that takes colours, and no variable turns them off."""
    if os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return False
    try:
        return bool(stream.isatty())
    except (AttributeError, ValueError):
        return False


def coloured_text(text: str) -> str:
    r"""``text`` with emphasis in colour; JSON stays as it is.

    Examples
    --------
    >>> coloured_text("trueangle: error: no such file")
    'trueangle: \x1b[1;31merror:\x1b[0m no such file'
    >>> coloured_text('{"says": "error:"}')
    '{"says": "error:"}'
    """
    if text[:1] in ("{", "["):
        return text
    for pattern, code in _RULES:
        text = re.sub(pattern, f"\x1b[{code}m\\g<0>\x1b[0m", text, flags=re.MULTILINE)
    return text
