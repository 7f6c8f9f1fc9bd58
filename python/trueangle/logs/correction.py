"""Correcting one log: copied with the corrected columns, verified, published."""

from __future__ import annotations

import errno
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileError
from ..formats.format import CopyTask, Selection, Watch
from ..formats.formats import find_format
from ..support.files import named_output, publish
from ..support.files.workplace import workplace
from .joints import JointChannel, JointState, LogSettings
from .manifest import Manifest, stamp
from .turns import TurnCounter, TurnSpan


@dataclass(frozen=True)
class CorrectionTask:
    """One log to correct: can be sent to another process.

    ``before`` gives, by joint, where the log before stopped; ``manifest`` is the folder
    whose manifest notes the output.
    """

    source: Path
    target: Path
    settings: LogSettings
    before: Mapping[str, JointState] | None = None
    manifest: Path | None = None


def correct_log(task: CorrectionTask, watch: Watch = lambda rows, part: None) -> dict[str, Any]:
    """Correct one log; its output is complete and verified, or not there.

    Returns
    -------
    dict
        ``rows`` (readings of a joint), ``seconds``, ``rows_per_second``, ``joints`` (see
        `JointChannel.summary`) and ``after``, the joints' states to pass on to the log that
        follows.

    Raises
    ------
    FileError
        A log that is damaged or has not the columns needed.
    OSError
        No space, no permission.
    """
    start = time.perf_counter()
    source, target, settings = task.source, task.target, task.settings
    kind = find_format(source)
    module = kind.module
    before = stamp(source)
    channels: list[JointChannel] = []

    def choose(header: Any) -> list[JointChannel]:
        channels.extend(settings.channels(source, header, task.before, kind.unit))
        return channels

    with kind.at_header(source), named_output(target, workplace(target), source) as aside:
        written = module.copy(
            CopyTask(source, aside, choose, watch, settings.topic, settings.output_topic)
        )
        read_back = module.contents(aside, settings.topic)
        if written != read_back:
            changed = [
                name
                for name in written.checksums.keys() | read_back.checksums.keys()
                if written.checksums.get(name) != read_back.checksums.get(name)
            ]
            moved = sorted({channel.column for channel in channels}.intersection(changed))
            if moved:  # parts of a damaged file lie over each other
                raise FileError(
                    source,
                    "is damaged: writing corrected readings changes the others; nothing is kept",
                    column=moved[0],
                )
            raise FileError(
                target,
                f"did not read back as written ({read_back.rows} of {written.rows} rows; "
                f"differing: {', '.join(sorted(changed)[:5]) or 'rows'}): not kept; "
                "check the disk",
            )
        if stamp(source) != before:
            raise FileError(source, "changed while it was read: it is still being written; wait")
        seconds = time.perf_counter() - start
        rows = max(channel.statistics.rows for channel in channels)
        result = {
            "rows": rows,
            "seconds": seconds,
            "rows_per_second": rows / seconds,
            "joints": [channel.summary() for channel in channels],
            "after": {c.name: c.state for c in channels},
        }
        if task.manifest is not None:
            Manifest(task.manifest).record(
                source, target, settings.digest, before, stamp(aside), result
            )
        publish(aside, target)
    return result


def states_after(result: Mapping[str, Any]) -> dict[str, JointState]:
    """The joints' states in a result of `correct_log` or its manifest."""
    return {name: JointState.of(state) for name, state in result.get("after", {}).items()}


def count_turns(source: Path, settings: LogSettings) -> dict[str, TurnSpan]:
    """What logs corrected in parallel must know about each other, by joint that needs it.

    One pass over the angle columns.
    """
    kind = find_format(source)
    module = kind.module
    header = module.columns(source, settings.topic)
    channels = [c for c in settings.channels(source, header, unit=kind.unit) if c.counts_turns]
    counters = {c.name: TurnCounter(c.angle.period) for c in channels}
    first: dict[str, float | None] = {c.name: None for c in channels}
    for batch in module.read(source, Selection([c.angle.name for c in channels], settings.topic)):
        for channel in channels:
            angle = batch[channel.angle.name]
            known = angle[np.isfinite(angle)]
            if first[channel.name] is None and known.size:
                first[channel.name] = float(known[0])
            counters[channel.name].count(angle)
    return {
        name: TurnSpan(counter.period, first[name], *counter.state)
        for name, counter in counters.items()
    }


def is_disk_full(error: BaseException) -> bool:
    """True when no further output can be written either."""
    return isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
