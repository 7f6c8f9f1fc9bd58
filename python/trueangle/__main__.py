"""``python -m trueangle``, and where the command ``trueangle`` starts."""

import signal
from typing import NoReturn


def start() -> NoReturn:
    """Run one command as a process; until it works, Ctrl-C ends it without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import process

    process()


if __name__ == "__main__":
    start()
