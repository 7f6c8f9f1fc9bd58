"""Trials side by side: a process on every core, BLAS with one thread in each."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..errors import TrueAngleError
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.deadline import Deadline, current_deadline, under_deadline
from .trial import ENDED, Trial, TrialOutcome, run_trial

#: Variables that set how many threads a linear algebra library may use.
THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
)


class WorkerError(TrueAngleError):
    """A process that ran trials has ended, or could not be given the simulation."""


def usable_cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # not every system has it
        return os.cpu_count() or 1


class LocalTrials:
    """Trials one after the other, in this process."""

    def __init__(self, sim: Simulation, signals: Signals, seed: int) -> None:
        self._asked = (sim, signals, seed)
        self._ready: list[Trial] = []
        self.count = 1

    def add(self, trial: Trial) -> None:
        """Add this trial."""
        self._ready.append(trial)

    def answers(self) -> Iterator[tuple[Trial, TrialOutcome]]:
        """Answers as they come, until none is outstanding or the time is up."""
        sim, signals, seed = self._asked
        at = current_deadline()
        while self._ready and not at.over:
            trial = self._ready.pop(0)
            left = None if at.within is None else max(at.within - at.seconds, 1e-3)
            with under_deadline(Deadline(left)) as own:
                outcome = run_trial(sim, signals, trial, seed)
            at.stopped = at.stopped or own.stopped
            if outcome.verdict != ENDED:
                yield trial, outcome

    def close(self) -> None:
        """Nothing to end."""


class Workers:
    """Trials side by side in ``count`` processes.

    A thread for each process hands it one trial after the other. `close` ends all of them at
    once, at any moment.
    """

    def __init__(self, sim: Simulation, seed: int, count: int) -> None:
        try:
            start = pickle.dumps((sim, seed))
        except Exception as reason:
            raise WorkerError(
                f"the simulation cannot be given to another process ({reason}); use `workers=1`"
            ) from None
        self._ready: queue.SimpleQueue[Trial | None] = queue.SimpleQueue()
        self._done: queue.SimpleQueue[tuple[Trial | None, Any]] = queue.SimpleQueue()
        self._outstanding = 0
        self.count = count
        self.processes = [_started() for _ in range(count)]
        for process in self.processes:
            threading.Thread(target=self._hand, args=(process, start), daemon=True).start()

    def add(self, trial: Trial) -> None:
        """Add this trial."""
        self._outstanding += 1
        self._ready.put(trial)

    def answers(self) -> Iterator[tuple[Trial, TrialOutcome]]:
        """Answers as they come, until none is outstanding or the time is up."""
        at = current_deadline()
        while self._outstanding and not at.over:
            try:
                # Seconds between two looks at the pace while answers are waited for.
                trial, answer = self._done.get(timeout=0.1)
            except queue.Empty:
                continue
            if isinstance(answer, Exception):
                raise answer
            assert trial is not None
            self._outstanding -= 1
            yield trial, answer

    def close(self) -> None:
        """End every process."""
        for process in self.processes:
            with contextlib.suppress(OSError):
                process.kill()
        for process in self.processes:
            process.wait()
            self._ready.put(None)

    def _hand(self, process: subprocess.Popen[bytes], start: bytes) -> None:
        """Give one process its trials, and take its answers."""
        source, target = process.stdout, process.stdin
        assert source is not None
        assert target is not None
        try:
            target.write(start)
            while True:
                trial = self._ready.get()
                if trial is None:
                    return
                pickle.dump(trial, target)
                target.flush()
                self._done.put((trial, pickle.load(source)))
        except (OSError, EOFError, pickle.UnpicklingError, ValueError):
            status = process.wait()
            self._done.put(
                (
                    None,
                    WorkerError(
                        f"a process that diagnoses has ended (status {status}): is there memory "
                        "for all of them? Give fewer workers"
                    ),
                )
            )
        finally:
            with contextlib.suppress(OSError):
                target.close()
            source.close()


def _started() -> subprocess.Popen[bytes]:
    """A process of `trueangle.rehearsal.worker` of this very package."""
    package = str(Path(__file__).resolve().parents[2])
    paths = [package, *(path for path in sys.path if path)]
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    environment["PYTHONPATH"] = os.pathsep.join(dict.fromkeys(paths))
    # Ctrl-C on a terminal reaches a whole group of processes: these have one of their own.
    own: dict[str, Any] = (
        {"creationflags": getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0)}
        if sys.platform == "win32"
        else {"start_new_session": True}
    )
    return subprocess.Popen(
        [sys.executable, "-m", "trueangle.rehearsal.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=environment,
        **own,
    )
