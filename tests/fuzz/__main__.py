"""Fuzzing of every loader: ``python tests/fuzz --cases 1000000 --seed 7 [--loader model]``.

Each case is one damaged file, made from the seed and its number alone. It must end within
five seconds of the processor and 1 GiB beyond what was in use, either accepted or refused by a
`TrueAngleError` whose one line names the file. What does not is printed with the command that
repeats it. Stopped before its end (Ctrl-C, or SIGTERM), it says how many cases each loader has
reached. ``--places`` tells which functions refused how many: how deep the damage lies.
"""

from __future__ import annotations

import argparse
import gc
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import FrameType
from typing import Any

#: Of the processor, for a case; and of the clock, after which it counts as hanging.
SECONDS = 5.0
HANGS = 60.0
BYTES = 1 << 30
#: Exit status of a child whose own cases cannot be made.
BROKEN = 3
#: What is counted of files that no function refuses.
READ = "read"
#: Where cases are written: a file system in memory where there is one, for outputs are synced.
MEMORY = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None

#: Children at work, and whether they are to end.
running: set[subprocess.Popen[bytes]] = set()
stopped = False


def main() -> int:
    """Run the cases of each loader in processes of their own."""
    parser = argparse.ArgumentParser(prog="python tests/fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000, help="of each loader")
    parser.add_argument("--seed", type=int, help="default: drawn and printed")
    parser.add_argument("--loader", action="append", help="this one only (may be repeated)")
    parser.add_argument("--jobs", type=int, default=1, help="loaders at a time")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--keep", metavar="FOLDER", help="where files that fail are copied to")
    parser.add_argument("--places", action="store_true", help="print who refused how many")
    parser.add_argument("--child", metavar="STATE", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.seed is None:
        args.seed = random.SystemRandom().randrange(2**32)
    if args.child:
        return child(args.loader[0], args)
    names = args.loader
    if not names:
        from loaders import loaders

        names = list(loaders())
    if args.keep:
        Path(args.keep).mkdir(parents=True, exist_ok=True)
    print(f"seed {args.seed}, {args.cases} cases of each of {', '.join(names)}", flush=True)
    signal.signal(signal.SIGTERM, stop)
    signal.signal(signal.SIGINT, stop)
    with ThreadPoolExecutor(args.jobs) as pool:
        failures = sum(pool.map(lambda name: parent(name, args), names))
    return 1 if failures or stopped else 0


def stop(number: int, frame: FrameType | None) -> None:
    """End the children; their parents tell how far they came."""
    global stopped
    stopped = True
    for process in list(running):
        process.kill()


def parent(name: str, args: argparse.Namespace) -> int:
    """Cases of one loader, going on behind one that took its process with it."""
    first, last, start = args.first, args.first + args.cases, time.monotonic()
    reached, failures, accepted = first, 0, 0
    with tempfile.TemporaryDirectory(dir=MEMORY) as folder:
        state = Path(folder, "state")
        while first < last and not stopped:
            state.write_text(f"{first} 0 0")
            command = [sys.executable, str(Path(__file__).parent), "--loader", name]
            command += ["--seed", str(args.seed), "--first", str(first)]
            command += ["--cases", str(last - first), "--child", str(state)]
            command += ["--keep", args.keep] if args.keep else []
            command += ["--places"] if args.places else []
            # A group of its own: Ctrl-C is for the parent, which ends it.
            with subprocess.Popen(command, process_group=0) as process:
                running.add(process)
                if stopped:
                    process.kill()
                status = process.wait()
                running.discard(process)
            reached, told, read = (int(x) for x in state.read_text().split()[:3])
            failures += told
            accepted += read
            if status == 0:
                reached = last
                break
            if status == BROKEN:
                return failures + 1
            if stopped:
                break
            failures += 1
            how = f"more than {HANGS:g} s" if status == -signal.SIGALRM else f"died ({status})"
            print(f"{name}: case {reached} {how}: {_again(name, args.seed, reached)}", flush=True)
            first = reached = reached + 1
    seconds = time.monotonic() - start
    if stopped or reached > args.first:
        cases = reached - args.first
        told = f"{accepted} read, {failures} failed, {seconds:.0f} s"
        print(f"{name}: {cases} cases, {told}", flush=True)
    return failures


def _again(name: str, seed: int, case: int) -> str:
    return f"python tests/fuzz --loader {name} --seed {seed} --first {case} --cases 1"


def child(name: str, args: argparse.Namespace) -> int:
    """Cases one after the other; the state file tells which one is in hand."""
    import faulthandler

    from loaders import loaders

    loader = loaders()[name]
    here = Path(args.child).parent
    with tempfile.TemporaryDirectory(dir=here) as folder:  # seeds, before memory is bounded
        try:
            loader.make(Path(folder), random.Random(0))
        except Exception:
            traceback.print_exc()
            return BROKEN
    warnings.simplefilter("ignore")
    failures, places = 0, Counter[str]()
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(
        resource.RLIMIT_AS, (pages * resource.getpagesize() + BYTES, resource.RLIM_INFINITY)
    )
    # A timer of the system costs a call; the thread of faulthandler's own, a thread for each case.
    faulthandler.register(signal.SIGALRM, chain=True)
    gc.freeze()
    with tempfile.TemporaryDirectory(dir=here) as folder:
        handle = os.open(args.child, os.O_WRONLY | os.O_TRUNC)

        def note(case: int) -> None:
            os.pwrite(handle, f"{case:12d} {failures:8d} {places[READ]:12d}".encode(), 0)

        for case in range(args.first, args.first + args.cases):
            note(case)
            rng = random.Random(zlib.crc32(f"{name} {args.seed} {case}".encode()))
            path = loader.make(Path(folder), rng)
            signal.setitimer(signal.ITIMER_REAL, HANGS)
            begun = time.process_time()
            try:
                places[refused_by(loader, path)] += 1
                assert time.process_time() - begun < SECONDS, f"more than {SECONDS:g} s"
            except BaseException:
                failures += 1
                print(f"{name}: case {case}: {_again(name, args.seed, case)}", file=sys.stderr)
                traceback.print_exc(limit=-6)
                if args.keep:
                    shutil.copy(path, Path(args.keep, f"{name}-{case}{path.suffix}"))
            finally:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
        note(args.first + args.cases)
        os.close(handle)
    if args.places:
        for place, count in places.most_common():
            print(f"{name}: {100.0 * count / args.cases:5.1f} % {place}", flush=True)
    return 0


def refused_by(loader: Any, path: Path) -> str:
    """Which function of the package refuses a file; `READ` where none does.

    Raises
    ------
    AssertionError
        The message does not name the file, or is more than a line.
    """
    from loader import well_told
    from trueangle.errors import TrueAngleError

    try:
        loader.use(path)
    except TrueAngleError as error:
        wrong = well_told(error, path)
        if wrong is not None:
            raise AssertionError(f"the message {wrong}: {str(error)[:2000]!r}") from error
        # Of what a library refuses, the function that was at work in it.
        frames = traceback.extract_tb((error.__cause__ or error).__traceback__)
        inside = [f for f in frames if "trueangle" in Path(f.filename).parts]
        told = [f for f in inside if f.name not in ("damage_told", "error", "failed")]
        return f"{Path(told[-1].filename).stem}.{told[-1].name}" if told else "elsewhere"
    return READ


if __name__ == "__main__":
    sys.exit(main())
