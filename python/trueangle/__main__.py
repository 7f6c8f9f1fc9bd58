"""``python -m trueangle``, and where the command ``trueangle`` starts."""

# Ctrl-C ends it without a traceback: nothing slow is imported before that is so.
try:
    import signal

    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
except KeyboardInterrupt:
    raise SystemExit(130) from None


def start() -> None:
    """Run one command as a process."""
    from .cli import process

    process()


if __name__ == "__main__":
    start()
