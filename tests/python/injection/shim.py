"""The shim compiled, and the process whose calls of the system fail when told to."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

HERE = Path(__file__).parent

#: Errors of Linux that the failing calls give.
NO_SPACE, IO_ERROR, NO_MEMORY, TOO_MANY_FILES, TRY_AGAIN = 28, 5, 12, 24, 11


class Answer(NamedTuple):
    """What became of a job."""

    status: int
    told: str
    counts: dict[str, int]


def compiled(folder: Path, compiler: str) -> Path:
    """The shim as a library in ``folder``."""
    library = folder / "shim.so"
    command = [compiler, "-O1", "-Wall", "-shared", "-fPIC", "-fno-optimize-sibling-calls"]
    subprocess.run([*command, "-o", library, HERE / "shim.c", "-ldl", "-lpthread"], check=True)
    return library


class Driver:
    """A process that has everything imported, and runs each job in a fork."""

    def __init__(self, library: Path, folder: Path, commands: list[list[str]]) -> None:
        self._told = folder.parent / "told"
        self._process = subprocess.Popen(
            [sys.executable, HERE / "driver.py"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"LD_PRELOAD": str(library), "OPENBLAS_NUM_THREADS": "1"},
        )
        assert self._asked({"folder": str(folder), "commands": commands}) == "ready"

    def run(self, folder: Path, arguments: list[str] | None = None, **job: Any) -> Answer:
        """Run the command (or ``code``) in ``folder``."""
        job |= {} if arguments is None else {"arguments": arguments}
        found = self._asked({"folder": str(folder), "told": str(self._told), **job})
        return Answer(**found)

    def _asked(self, job: dict[str, Any]) -> Any:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(job) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, f"the driver died: {self._process.poll()}"
        return json.loads(line)

    def close(self) -> None:
        """End the process."""
        self._process.communicate(timeout=30)
