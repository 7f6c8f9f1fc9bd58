"""Process that runs commands in forks of its own, with a call of the system that fails.

Started by `shim.Driver` with the shim loaded. Reads one JSON object a line: ``arguments`` of
the command (or ``code`` to execute), the ``folder`` to work in, and ``kind``, ``n``, ``action``
and ``error`` as `shim_arm` takes them, or ``kill_after`` seconds. Answers with the status (of
`os.waitstatus_to_exitcode`), what was printed, and the calls counted.
"""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any

KINDS = (
    *("open", "read", "write", "sync", "rename", "allocate", "thread", "folder", "remove"),
    "change",
)
ACTIONS = ("fail", "kill", "half", "interrupt", "terminate", "hang up", "pause")

#: In the names of what is being written aside.
PARTIAL = ".trueangle-partial"

#: Seconds after which a fork counts as hanging.
HANGS = 60


def warm_up(folder: str, commands: list[list[str]]) -> None:
    """Import what the commands need, by running them once."""
    from trueangle.cli import main

    os.chdir(folder)
    for command in commands:
        with open(os.devnull, "w") as nowhere:
            kept = sys.stdout, sys.stderr
            sys.stdout = sys.stderr = nowhere
            try:
                main(command)
            finally:
                sys.stdout, sys.stderr = kept


def place_of_core() -> tuple[int, int]:
    """Addresses of the core's code."""
    lines = Path("/proc/self/maps").read_text().splitlines()
    spans = [line.split()[0].split("-") for line in lines if "_core" in line]
    return min(int(a, 16) for a, _ in spans), max(int(b, 16) for _, b in spans)


def child(job: dict[str, Any], shim: ctypes.CDLL, told: str) -> int:
    """Run one job; the exit status."""
    os.chdir(job["folder"])
    handle = os.open(told, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    signal.alarm(HANGS)
    # What a shell runs in the background is deaf to Ctrl-C.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    shim.shim_root(job["folder"].encode())
    shim.shim_exchange(int(job.get("exchange", True)))
    begin, end = place_of_core()
    shim.shim_core(
        ctypes.c_void_p(begin), ctypes.c_void_p(end), ctypes.c_size_t(job.get("least", 0))
    )
    if "states" in job:
        job |= {"kind": "change", "action": "pause"}
    kind = KINDS.index(job["kind"]) if "kind" in job else -1
    action = ACTIONS.index(job.get("action", "fail"))
    shim.shim_arm(kind, ctypes.c_long(job.get("n", -1)), action, job.get("error", 5))
    status = 3
    try:
        if "code" in job:
            exec(job["code"], {})
            status = 0
        else:
            from trueangle.cli import main

            status = main(job["arguments"])
    except SystemExit as left:
        status = int(left.code or 0)
    except MemoryError:
        status = 12
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    shim.shim_stop()
    counts = {name: shim.shim_count(k) for k, name in enumerate(KINDS)}
    # In one step: a kill may come just here.
    Path(told + ".new").write_text(json.dumps(counts))
    os.replace(told + ".new", told + ".counts")
    return status


def kept_states(pid: int, folder: Path, states: Path) -> int:
    """Copy what is on the disk whenever a process pauses, until it ends; its status.

    A call that leaves everything as it was makes no further copy, nor does one that goes on
    with what is being written aside: nobody reads that.
    """
    known, count = None, 0
    while True:
        _, status = os.waitpid(pid, os.WUNTRACED)
        paths = sorted(folder.rglob("*"))
        found = [
            (path, path.read_bytes() if path.is_file() and PARTIAL not in str(path) else b"")
            for path in paths
        ]
        if found != known:
            known = found
            shutil.copytree(folder, states / f"{count:03d}")
            count += 1
        if not os.WIFSTOPPED(status):
            return status
        os.kill(pid, signal.SIGCONT)


def main() -> None:
    """Answer jobs until standard input ends."""
    first = json.loads(sys.stdin.readline())
    warm_up(first["folder"], first["commands"])
    shim = ctypes.CDLL(None)
    shim.shim_count.restype = ctypes.c_long
    print(json.dumps("ready"), flush=True)
    for line in sys.stdin:
        job = json.loads(line)
        counts = Path(job["told"] + ".counts")
        counts.unlink(missing_ok=True)
        Path(job["told"]).write_text("")
        pid = os.fork()
        if pid == 0:
            status = 3
            try:
                status = child(job, shim, job["told"])
            finally:
                os._exit(status)
        if "kill_after" in job:
            time.sleep(job["kill_after"])
            os.kill(pid, signal.SIGKILL)
        status = (
            kept_states(pid, Path(job["folder"]), Path(job["states"]))
            if "states" in job
            else (os.waitpid(pid, 0)[1])
        )
        answer = {
            "status": os.waitstatus_to_exitcode(status),
            "told": Path(job["told"]).read_text(errors="replace"),
            "counts": json.loads(counts.read_text()) if counts.exists() else {},
        }
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
