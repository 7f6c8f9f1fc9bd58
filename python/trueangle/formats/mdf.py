"""MDF4 logs: channels read in parts, corrected ones added in a separate channel group."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.v4_blocks import FileHistory
from numpy.typing import NDArray

from ..errors import FileError
from .budget import FileExtent
from .format import Addition, Batch, Contents, CopyTask, Selection, note
from .openmdf import HAS_MARKS, OF_TEXTS, opened_mdf
from .stored import Checksum

#: Readings taken together.
_BLOCK = 1 << 19
#: Acquisition name of the groups of corrected channels.
_GROUP = "trueangle"
#: Compression argument of asammdf by the type of data block found.
_COMPRESSIONS = {0: 0, 1: 1, 2: 2, 3: 5, 4: 6, 5: 3, 6: 4}


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the channels that occur once; time channels omitted."""
    with opened_mdf(path) as mdf:
        return _names(mdf)


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Channels ``names`` in batches; see `format.FormatModule`."""
    with opened_mdf(path) as mdf:
        _common_group(path, mdf, wanted.names)
        for parts in _parts(path, mdf, [_place(mdf, name) for name in wanted.names]):
            yield {name: part.samples for name, part in zip(wanted.names, parts, strict=True)}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected channels; see `format.FormatModule`.

    Each goes into a new channel group with the times of its source; a reading marked
    invalid stays marked.
    """
    with opened_mdf(task.source) as mdf:
        channels = task.choose(_names(mdf))
        groups = [
            _common_group(task.source, mdf, [channel.column, *channel.signals.values()])
            for channel in channels
        ]
        rows = [_cycles(mdf, group) for group in groups]
    # What is added is kept next to the output until it is saved.
    with opened_mdf(task.source, temporary_folder=str(task.target.parent)) as mdf:
        sums = _kept(task.source, mdf)
        compression = _compression(mdf)
        done, total = 0, max(sum(rows), 1)
        for channel in channels:
            check = Checksum()
            made: int | None = None
            names = [channel.column, *channel.signals.values()]
            for part, *beside in _parts(task.source, mdf, [_place(mdf, name) for name in names]):
                values = (other.samples for other in beside)
                signals = dict(zip(channel.signals, values, strict=True))
                corrected = channel.correct(part.samples, signals)
                check.update(corrected)
                made = _put(mdf, made, part, corrected, channel)
                done += corrected.size
                task.watch(corrected.size, done / total)
            sums[channel.added] = check.text()
        mdf.file_history.append(_history(mdf, note(channels)))
        mdf.save(task.target, overwrite=True, compression=compression, add_history_block=False)
    return Contents(max(rows), sums)


def _history(mdf: MDF, comment: str) -> FileHistory:
    """The entry about the copy, with the time of the last one: equal logs give equal copies."""
    known = mdf.file_history
    made = FileHistory()
    made.comment = f"<FHcomment><TX>{escape(comment)}</TX><tool_id>trueangle</tool_id></FHcomment>"
    made.time_stamp = known[-1].time_stamp if known else mdf.header.start_time
    return made


def contents(path: Path, topic: str | None = None) -> Contents:
    """Checksums of the corrected channels and the rows of every other group."""
    with opened_mdf(path) as mdf:
        rows = [_cycles(mdf, i) for i in range(len(mdf.groups)) if _is_ours(mdf, i)]
        return Contents(max(rows, default=0), _kept(path, mdf))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of channels; see `format.FormatModule`."""
    with opened_mdf(path) as mdf:
        groups = [_place(mdf, name)[0] for name in names] or range(len(mdf.groups))
        rows = [_cycles(mdf, group) for group in groups]
    return FileExtent(max(rows, default=0), 8 * sum(rows) if names else 0)


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are in the channel group of the channels ``needed``."""
    with opened_mdf(path) as mdf:
        groups = {_place(mdf, name)[0] for name in needed}
        return [name for name in others if _place(mdf, name)[0] in groups]


def _master(mdf: MDF, group: int) -> int | None:
    """Index of the time channel of a group."""
    index: int | None = mdf.masters_db.get(group)
    return index


def _names(mdf: MDF) -> list[str]:
    return [
        name
        for name, places in mdf.channels_db.items()
        if len(places) == 1 and _master(mdf, places[0][0]) != places[0][1]
    ]


def _place(mdf: MDF, name: str) -> tuple[int, int]:
    (place,) = mdf.channels_db[name]
    return int(place[0]), int(place[1])


def _common_group(path: Path, mdf: MDF, names: Sequence[str]) -> int:
    groups = {name: _place(mdf, name)[0] for name in names}
    if len(set(groups.values())) > 1:
        listed = ", ".join(f"{name} in {group}" for name, group in groups.items())
        raise FileError(path, f"channels that belong together are in several groups: {listed}")
    return groups[names[0]]


def _cycles(mdf: MDF, group: int) -> int:
    return int(mdf.groups[group].channel_group.cycles_nr)


def _parts(path: Path, mdf: MDF, places: Sequence[tuple[int, int]]) -> Iterator[list[Signal]]:
    """Readings of channels of one group, part by part, the records read once.

    Without records there is one part without readings.
    """
    group = mdf.groups[places[0][0]]
    for _, index in places:
        channel = group.channels[index]
        # Channels of values of any length are elsewhere in the file.
        if channel.channel_type == 1 or group.channel_dependencies[index]:
            raise FileError(path, "numbers are needed, one to a record", column=channel.name)
    head = group.channel_group
    record = int(head.samples_byte_nr) + int(head.invalidation_bytes_nr)
    # The library's own reading of a range of records goes through all of them.
    mdf.configure(read_fragment_size=_BLOCK * max(record, 1))
    said, found = _cycles(mdf, places[0][0]), 0
    for records in mdf._mdf._load_data(group):
        parts = [_part(path, mdf, place, records) for place in places]
        size = parts[0].samples.size
        found += size
        if found > said or (said and not size):
            break
        yield parts
        if found == said:
            break
    if found != said:
        name = group.channels[places[0][1]].name
        raise FileError(path, f"is damaged: {found} of {said} records; copy it again", column=name)


def _part(path: Path, mdf: MDF, place: tuple[int, int], records: Any) -> Signal:
    """Readings of some records; those marked invalid become NaN and stay marked."""
    group, index = place
    part = mdf.get(group=group, index=index, data=records, ignore_invalidation_bits=True)
    if part.samples.dtype.kind not in "fiu" or part.samples.ndim != 1:
        shape = "".join(f"[{n}]" for n in part.samples.shape[1:])
        raise FileError(
            path,
            f"numbers are needed, the channel holds {part.samples.dtype}{shape}",
            column=part.name,
        )
    if part.invalidation_bits is None and mdf.groups[group].channels[index].flags & HAS_MARKS:
        # The library returns no marks where no record is marked, but a group with marks cannot
        # be extended without them.
        part.invalidation_bits = np.zeros(part.samples.size, dtype=bool)
    if part.invalidation_bits is not None and part.invalidation_bits.any():
        kind = np.float32 if part.samples.dtype == np.float32 else np.float64
        part.samples = np.where(part.invalidation_bits, np.nan, part.samples).astype(kind)
    return part


def _put(
    mdf: MDF, group: int | None, part: Signal, corrected: NDArray[Any], channel: Addition
) -> int:
    """Append a batch of corrected readings to their group, which the first batch makes."""
    invalid = part.invalidation_bits
    if group is not None:
        mdf.extend(group, [(part.timestamps, None), (corrected, invalid)])
        return group
    signal = Signal(
        corrected,
        part.timestamps,
        unit=part.unit,
        name=channel.added,
        invalidation_bits=invalid,
    )
    return int(mdf.append([signal], acq_name=_GROUP, comment=note([channel])))


def _is_ours(mdf: MDF, group: int) -> bool:
    return bool(mdf.groups[group].channel_group.acq_name == _GROUP)


def _kept(path: Path, mdf: MDF) -> dict[str, str]:
    """Checksums of corrected channels, rows and channels of every other group."""
    found: dict[str, str] = {}
    holding = [i for i, g in enumerate(mdf.groups) if not g.channel_group.flags & OF_TEXTS]
    for number, index in enumerate(holding):
        group = mdf.groups[index]
        if not _is_ours(mdf, index):
            found[f"group {number}"] = f"{_cycles(mdf, index)}:{len(group.channels)}"
            continue
        for i, channel in enumerate(group.channels):
            if i == _master(mdf, index):
                continue
            check = Checksum()
            for (part,) in _parts(path, mdf, [(index, i)]):
                check.update(part.samples)
            found[channel.name] = check.text()
    return found


def _compression(mdf: MDF) -> int:
    """How the data blocks of a file are compressed."""
    kinds = (int(block.block_type) for group in mdf.groups for block in group.get_data_blocks())
    return _COMPRESSIONS.get(max(kinds, default=0), 0)
