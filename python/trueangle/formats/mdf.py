"""MDF4 logs: channels read in parts, corrected ones added in a channel group of their own."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
from asammdf import MDF, Signal
from asammdf.blocks.mdf_v4 import MDF4
from asammdf.blocks.utils import DataBlockInfo
from asammdf.blocks.v4_blocks import FileHistory
from numpy.typing import NDArray

from ..errors import FileError
from ..support.layout import counted
from .budget import FileExtent
from .checksum import Checksum
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection, note
from .mdfblocks import check_chains

#: Bytes that one byte of a file can stand for: deflate reaches 1032.
_MOST_COMPRESSED = 2000
#: Readings taken together.
_BLOCK = 1 << 19
#: Bytes of a data block read at once: asammdf reads a block whole for each part of it.
_PIECE = 1 << 22
#: Acquisition name of the groups of corrected channels.
_GROUP = "trueangle"
#: Types of channels that have no place in a record: virtual master and data.
_VIRTUAL = (3, 6)
#: Flag of a channel whose readings may be marked invalid.
_HAS_MARKS = 2
#: Channels of values of any length stand elsewhere in the file.
_ELSEWHERE = 1
#: Flag of a group of records of any length: texts of a channel of another group, no channels. The
#: library writes them beside that channel, and no such group.
_OF_TEXTS = 1
#: First bytes of a file, also of one that was not finished.
_MAGIC = (b"MDF     ", b"UnFinMF ")
#: Compression argument of asammdf by the type of data block found.
_COMPRESSIONS = {0: 0, 1: 1, 2: 2, 3: 5, 4: 6, 5: 3, 6: 4}


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the channels that occur once; time channels left out."""
    with _opened(path) as mdf:
        return _names(mdf)


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Channels ``names`` in batches; see `format.FormatModule`."""
    with _opened(path) as mdf:
        _common_group(path, mdf, wanted.names)
        for parts in _parts(path, mdf, [_place(mdf, name) for name in wanted.names]):
            yield {name: part.samples for name, part in zip(wanted.names, parts, strict=True)}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected channels; see `format.FormatModule`.

    Each goes into a new channel group with the times of its source; a reading marked
    invalid stays marked.
    """
    with _opened(task.source) as mdf:
        channels = task.choose(_names(mdf))
        groups = [
            _common_group(task.source, mdf, [channel.column, *channel.signals.values()])
            for channel in channels
        ]
        rows = [_cycles(mdf, group) for group in groups]
    # What is added is kept beside the output until it is saved.
    with _opened(task.source, temporary_folder=str(task.target.parent)) as mdf:
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
    """What is told of the copy; of the time of the last entry, so that a log gives one copy."""
    known = mdf.file_history
    made = FileHistory()
    made.comment = f"<FHcomment><TX>{escape(comment)}</TX><tool_id>trueangle</tool_id></FHcomment>"
    made.time_stamp = known[-1].time_stamp if known else mdf.header.start_time
    return made


def contents(path: Path, topic: str | None = None) -> Contents:
    """Checksums of the corrected channels and the rows of every other group."""
    with _opened(path) as mdf:
        rows = [_cycles(mdf, i) for i in range(len(mdf.groups)) if _is_ours(mdf, i)]
        return Contents(max(rows, default=0), _kept(path, mdf))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of channels; see `format.FormatModule`."""
    with _opened(path) as mdf:
        groups = [_place(mdf, name)[0] for name in names] or range(len(mdf.groups))
        rows = [_cycles(mdf, group) for group in groups]
    return FileExtent(max(rows, default=0), 8 * sum(rows) if names else 0)


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are in the channel group of the channels ``needed``."""
    with _opened(path) as mdf:
        groups = {_place(mdf, name)[0] for name in needed}
        return [name for name in others if _place(mdf, name)[0] in groups]


@contextmanager
def _opened(path: Path, **options: Any) -> Iterator[MDF]:
    """The file, its errors told with its name."""
    with path.open("rb") as file:
        if file.read(8) not in _MAGIC:
            raise FileError(path, "is not MDF4")
    check_chains(path)
    with damage_told(path, "MDF4"), _told_once():
        try:
            with MDF(path, **options) as mdf:
                if mdf.version < "4":
                    raise FileError(path, f"is MDF {mdf.version}; convert it to MDF 4")
                _check_sizes(path, mdf)
                _take_in_pieces(mdf)
                yield mdf
        except Exception as cause:
            _close_half_built(cause)
            raise


@contextmanager
def _told_once() -> Iterator[None]:
    """Without what the library prints of damage beside the error that it raises."""

    def nothing(record: logging.LogRecord) -> bool:
        return False

    logger = logging.getLogger("asammdf")
    logger.addFilter(nothing)
    try:
        yield
    finally:
        logger.removeFilter(nothing)


def _check_sizes(path: Path, mdf: MDF) -> None:
    """Refuse groups that say they hold more than the file can: reading them would not end."""
    size = path.stat().st_size
    for group in mdf.groups:
        record = group.channel_group.samples_byte_nr + group.channel_group.invalidation_bytes_nr
        said = int(group.channel_group.cycles_nr) * max(int(record), 1)
        if group.channel_group.flags & _OF_TEXTS and group.channels:
            raise FileError(
                path,
                f"is damaged: a group of texts says to hold {counted(group.channels, 'channel')}",
            )
        if said > _MOST_COMPRESSED * size:
            raise FileError(path, f"is damaged: of {size} bytes it says to hold {said}")
        if record > _MOST_COMPRESSED * size:
            raise FileError(path, f"is damaged: of {size} bytes it says that records have {record}")
        marks = 8 * int(group.channel_group.invalidation_bytes_nr)
        for channel in group.channels:
            if channel.channel_type not in _VIRTUAL:
                bits = 8 * int(channel.byte_offset) + int(channel.bit_offset) + channel.bit_count
                if bits > 8 * int(group.channel_group.samples_byte_nr):
                    raise FileError(
                        path,
                        "is damaged: the channel ends behind its record of "
                        f"{group.channel_group.samples_byte_nr} bytes",
                        column=channel.name,
                    )
            if channel.flags & _HAS_MARKS and marks <= int(channel.pos_invalidation_bit):
                raise FileError(
                    path,
                    f"is damaged: its mark is bit {channel.pos_invalidation_bit} of {marks}",
                    column=channel.name,
                )


def _take_in_pieces(mdf: MDF) -> None:
    """Let large data blocks that are not compressed count as many small ones in a row."""
    for group in mdf.groups:
        if group.sorted:
            blocks = group.data_blocks
            group.data_blocks = [piece for block in blocks for piece in _pieces(block)]


def _pieces(block: DataBlockInfo) -> list[DataBlockInfo]:
    size = block.original_size or 0
    # What is compressed, has marks beside it or is cut short is taken as it is.
    whole = block.block_type or block.invalidation_block or block.block_limit is not None
    if whole or size <= _PIECE:
        return [block]
    return [
        DataBlockInfo(block.address + at, 0, length, length, block.param, location=block.location)
        for at in range(0, size, _PIECE)
        for length in (min(_PIECE, size - at),)
    ]


def _close_half_built(error: Exception) -> None:
    """A constructor of asammdf that fails leaves an object that cannot be closed."""
    place = error.__traceback__
    while place is not None:
        half_built = place.tb_frame.f_locals.get("self")
        if isinstance(half_built, MDF4) and not hasattr(half_built, "_file"):
            half_built._tempfile.close()
            half_built._closed = True
        place = place.tb_next


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
        if channel.channel_type == _ELSEWHERE or group.channel_dependencies[index]:
            raise FileError(path, "numbers are needed, one to a record", column=channel.name)
    head = group.channel_group
    record = int(head.samples_byte_nr) + int(head.invalidation_bytes_nr)
    # Its own reading of a stretch of records goes through all of them.
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
        raise FileError(path, f"is damaged: {found} of {said} records are there", column=name)


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
    if part.invalidation_bits is None and mdf.groups[group].channels[index].flags & _HAS_MARKS:
        # Of records without a mark none are given, which a group that has them cannot be told.
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
    holding = [i for i, g in enumerate(mdf.groups) if not g.channel_group.flags & _OF_TEXTS]
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
