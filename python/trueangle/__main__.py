"""``python -m trueangle``, and where the command ``trueangle`` starts."""

# From here on Ctrl-C ends it without a traceback. `signal` takes longer to import than all that
# ran before; what it is made of is in the interpreter.
import _signal  # type: ignore[import-not-found]

if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
    _signal.signal(_signal.SIGINT, _signal.SIG_DFL)


def start() -> None:
    """Run one command as a process."""
    from .cli import process

    process()


if __name__ == "__main__":
    start()
