"""A process that runs trials: ``python -m trueangle.rehearsal.worker``, pickles in and out."""

from __future__ import annotations

import contextlib
import pickle
import signal
import sys
from typing import Any, BinaryIO

from .trial import measured_signals, run_trial


def serve_trials(source: BinaryIO, target: BinaryIO) -> None:
    """Answer every trial that comes until the input ends."""
    sim, seed = pickle.load(source)
    signals = measured_signals(sim)
    while True:
        try:
            trial = pickle.load(source)
        except EOFError:
            return
        answer: Any
        try:
            answer = run_trial(sim, signals, trial, seed)
        except Exception as failure:  # reported by the caller
            answer = failure
        pickle.dump(answer, target)
        target.flush()


if __name__ == "__main__":
    # Ctrl-C is for the calling process, which ends its workers.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(BrokenPipeError, EOFError):
        answers = sys.stdout.buffer
        sys.stdout = sys.stderr
        serve_trials(sys.stdin.buffer, answers)
