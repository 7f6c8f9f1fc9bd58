"""``python -m trueangle``, and where the command ``trueangle`` starts."""

# Ctrl-C ends it without a traceback: nothing slow is imported before that is so, not even `signal`,
# which takes half of the start of this package.
try:
    import _signal  # type: ignore[import-not-found]

    if _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)
except KeyboardInterrupt:
    raise SystemExit(130) from None


def start() -> None:
    """Run one command as a process."""
    from .cli import process

    process()


if __name__ == "__main__":
    start()
