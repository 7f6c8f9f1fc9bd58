"""Fuzzing of every loader: ``python tests/fuzz --cases 20000 --seed 7 [--loader model]``.

Each case is one damaged file, made from the seed and its number alone. It must end within
five seconds of the processor and 1 GiB beyond what was in use, either accepted or refused by a
`TrueAngleError`. What does not is printed with the command that repeats it.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from pathlib import Path

#: Of the processor, for a case; and of the clock, after which it counts as hanging.
SECONDS = 5.0
HANGS = 60.0
BYTES = 1 << 30
#: Exit status of a child whose own cases cannot be made.
BROKEN = 3


def main() -> int:
    """Run the cases of each loader in processes of their own."""
    parser = argparse.ArgumentParser(prog="python tests/fuzz", description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000, help="of each loader")
    parser.add_argument("--seed", type=int, help="default: drawn and printed")
    parser.add_argument("--loader", action="append", help="this one only (may be repeated)")
    parser.add_argument("--first", type=int, default=0, help="number of the first case")
    parser.add_argument("--keep", metavar="FOLDER", help="where files that fail are copied to")
    parser.add_argument("--child", metavar="STATE", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.seed is None:
        args.seed = random.SystemRandom().randrange(2**32)
    if args.child:
        return child(args.loader[0], args.seed, args.first, args.cases, args.child, args.keep)
    from loaders import loaders

    names = args.loader or list(loaders())
    print(f"seed {args.seed}, {args.cases} cases of each of {', '.join(names)}", flush=True)
    failures = 0
    for name in names:
        failures += parent(name, args)
    return 1 if failures else 0


def parent(name: str, args: argparse.Namespace) -> int:
    """Cases of one loader, going on behind one that took its process with it."""
    first, last, failures, start = args.first, args.first + args.cases, 0, time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        state = Path(folder, "state")
        while first < last:
            state.write_text(str(first))
            command = [sys.executable, str(Path(__file__).parent), "--loader", name]
            command += ["--seed", str(args.seed), "--first", str(first)]
            command += ["--cases", str(last - first), "--child", str(state)]
            command += ["--keep", args.keep] if args.keep else []
            done = subprocess.run(command, check=False)
            reached, told = (int(x) for x in state.read_text().split()[:2])
            failures += told
            if done.returncode == 0:
                break
            if done.returncode == BROKEN:
                return failures + 1
            failures += 1
            how = f"more than {HANGS:g} s" if done.returncode == 1 else f"died ({done.returncode})"
            print(f"{name}: case {reached} {how}: {_again(name, args.seed, reached)}", flush=True)
            first = reached + 1
    seconds = time.monotonic() - start
    print(f"{name}: {args.cases} cases, {failures} failed, {seconds:.0f} s", flush=True)
    return failures


def _again(name: str, seed: int, case: int) -> str:
    return f"python tests/fuzz --loader {name} --seed {seed} --first {case} --cases 1"


def child(name: str, seed: int, first: int, cases: int, state: str, keep: str | None) -> int:
    """Cases one after the other; the state file tells which one is in hand."""
    import faulthandler

    from loaders import loaders
    from trueangle.errors import TrueAngleError

    loader = loaders()[name]
    with tempfile.TemporaryDirectory() as folder:  # makes the seeds before memory is bounded
        try:
            loader.make(Path(folder), random.Random(0))
        except Exception:
            traceback.print_exc()
            return BROKEN
    warnings.simplefilter("ignore")
    failures = 0
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(
        resource.RLIMIT_AS, (pages * resource.getpagesize() + BYTES, resource.RLIM_INFINITY)
    )
    with tempfile.TemporaryDirectory() as folder:
        handle = os.open(state, os.O_WRONLY | os.O_TRUNC)
        for case in range(first, first + cases):
            os.pwrite(handle, f"{case:12d} {failures:8d}".encode(), 0)
            rng = random.Random(zlib.crc32(f"{name} {seed} {case}".encode()))
            path = loader.make(Path(folder), rng)
            faulthandler.dump_traceback_later(HANGS, exit=True)
            begun = time.process_time()
            try:
                with contextlib.suppress(TrueAngleError):
                    loader.use(path)
                assert time.process_time() - begun < SECONDS, f"more than {SECONDS:g} s"
            except BaseException:
                failures += 1
                os.pwrite(handle, f"{case:12d} {failures:8d}".encode(), 0)
                print(f"{name}: case {case}: {_again(name, seed, case)}", file=sys.stderr)
                traceback.print_exc(limit=-6)
                if keep:
                    shutil.copy(path, Path(keep, f"{name}-{case}{path.suffix}"))
            finally:
                faulthandler.cancel_dump_traceback_later()
        os.close(handle)
    return 0


if __name__ == "__main__":
    sys.exit(main())
