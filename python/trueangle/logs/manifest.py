"""The list of logs that are done, kept beside the outputs so that a run can go on."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from ..files import check_output
from .safety import Stamp, locked, stamp

__all__ = ["MANIFEST", "Manifest"]

MANIFEST = "trueangle-manifest.jsonl"


class Manifest:
    """One line of JSON per finished log of one folder of outputs.

    A line is synced before its output takes its final name, and counts only while a file of
    the recorded size and time has that name: a process killed between the two leaves a line
    that does not count, one killed while writing a line leaves half a line, which is
    skipped.

    Parameters
    ----------
    folder : Path
        Must exist.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / MANIFEST
        self._entries: dict[str, dict[str, Any]] = {}

    @contextmanager
    def opened(self) -> Iterator[Manifest]:
        """Hold the manifest for this process alone and read what is done.

        Raises
        ------
        ArgumentError
            Another process is working into the same folder.
        FileError
            Something that is no regular file has the manifest's name.
        """
        check_output(self.path, regular=True)
        with self.path.open("ab"):
            pass
        with locked(self.path) as free:
            if not free:
                raise ArgumentError(
                    f"{self.folder}: another run is correcting logs into this folder; wait for it"
                )
            self.read()
            try:
                yield self
            finally:
                if self.path.stat().st_size == 0:
                    self.path.unlink()

    def done(self, source: Path, target: Path, settings: str) -> Mapping[str, Any] | None:
        """What was recorded when ``source`` was corrected to ``target``, if that still holds."""
        entry = self._entries.get(self._name(target))
        if entry is None or entry["settings"] != settings or not target.exists():
            return None
        if tuple(entry["output_stamp"]) != stamp(target):
            return None
        if target != source and tuple(entry["log_stamp"]) != stamp(source):
            return None
        result: Mapping[str, Any] = entry["result"]
        return result

    def record(
        self,
        source: Path,
        target: Path,
        settings: str,
        log_stamp: Stamp,
        output_stamp: Stamp,
        result: Mapping[str, Any],
    ) -> None:
        """Note that the verified output of ``source`` is about to be named ``target``."""
        name = self._name(target)
        entry = {
            "output": name,
            "log": str(source),
            "log_stamp": list(log_stamp),
            "output_stamp": list(output_stamp),
            "settings": settings,
            "result": dict(result),
        }
        # One write at the end of the file: processes of a cluster append side by side. The
        # first line end closes the half line of a killed process; blank lines are skipped.
        handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        try:
            os.write(handle, b"\n" + json.dumps(entry).encode() + b"\n")
            os.fsync(handle)
        finally:
            os.close(handle)
        self._entries[name] = entry

    def read(self) -> None:
        """Read what is done."""
        if not self.path.exists():
            return
        keys = {"output", "log_stamp", "output_stamp", "settings", "result"}
        for line in self.path.read_bytes().splitlines():
            try:
                entry = json.loads(line)
            except ValueError:
                continue
            if isinstance(entry, dict) and keys <= entry.keys():
                self._entries[entry["output"]] = entry

    def _name(self, target: Path) -> str:
        return target.relative_to(self.folder).as_posix()
