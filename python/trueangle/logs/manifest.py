"""The list of logs that are done, kept next to the outputs so that a run can go on."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..errors import ArgumentError
from ..runs.paths import MANIFEST as MANIFEST
from ..support.decoding import finite_float
from ..support.files import check_output
from ..support.files.workplace import lock_path

Stamp = tuple[int, int]


class Manifest:
    """One line of JSON per finished log of one folder of outputs.

    A line is synced before its output takes its final name, and counts only while a file of
    the recorded size and time has that name: a process killed between the two leaves a line
    that does not count, one killed while writing a line leaves half a line, which is
    skipped.
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
        with lock_path(self.path) as free:
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
        if entry is None or entry["settings"] != settings:
            return None
        # A file that is lost has the stamp of nothing, which no output has.
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
        # One write at the end of the file: processes of a cluster append in parallel. The
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
        for line in self.path.read_bytes().splitlines():
            entry = _decoded(line)
            if entry is not None:
                self._entries[entry["output"]] = entry

    def _name(self, target: Path) -> str:
        return target.relative_to(self.folder).as_posix()


def _decoded(line: bytes) -> dict[str, Any] | None:
    """The entry of a line; None for what `Manifest.record` did not write: it does not count."""
    try:
        entry = json.loads(line)
        result = entry["result"]
        stamps = (entry["log_stamp"], entry["output_stamp"])
        texts = (entry["output"], entry["settings"])
        numbers = [result[key] for key in ("rows", "seconds", "rows_per_second")]
        joints, after = result["joints"], result["after"]
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
    good = (
        isinstance(entry, dict)
        and all(isinstance(text, str) for text in texts)
        and all(_is_list_of(stamp, int) and len(stamp) == 2 for stamp in stamps)
        and all(finite_float(number) is not None for number in numbers)
        and isinstance(result["rows"], int)
        and _is_list_of(joints, dict)
        and all(joint.keys() >= _JOINT_KEYS for joint in joints)
        and all(finite_float(joint[key]) is not None for joint in joints for key in _JOINT_NUMBERS)
        and isinstance(after, dict)
        and all(_is_state(state) for state in after.values())
    )
    return entry if good else None


_JOINT_NUMBERS = {"rms_correction_arcsec", "max_abs_correction_arcsec", "missing"}
_JOINT_KEYS = {"joint", "column", "corrected", "outside_span"} | _JOINT_NUMBERS


def _is_list_of(value: Any, kind: type) -> bool:
    return isinstance(value, list) and all(type(entry) is kind for entry in value)


def _is_state(value: Any) -> bool:
    """``[[last angle or null, turns], [numbers]]``, see `JointState`."""
    try:
        (last, turns), travel = value
    except (TypeError, ValueError):
        return False
    known = last is None or finite_float(last) is not None
    return (
        known
        and type(turns) is int
        and isinstance(travel, list)
        and all(type(number) in (int, float) for number in travel)  # NaN: no motion yet
    )


def stamp(path: Path) -> Stamp:
    """Size in bytes and time of the last change (ns) of a file, or of all in a folder."""
    files = [path] if path.is_file() else [p for p in path.rglob("*") if p.is_file()]
    stats = [file.stat() for file in files]
    return sum(s.st_size for s in stats), max((s.st_mtime_ns for s in stats), default=0)
