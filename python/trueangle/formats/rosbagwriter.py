"""Writing bags of the kind that was read: version, storage, compression, connections."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

from ..errors import FileError
from .mcapchunks import ChunkedBagWriter as Writer
from .mcapchunks import ChunkReader
from .openbag import OpenBag
from .rosbagmarks import KEY, caller_note


class BagWriter:
    """A bag being written beside the one read."""

    def __init__(self, bag: OpenBag, writer: Any, note: str) -> None:
        self._bag = bag
        self._writer = writer
        self._note = note
        self.write = getattr(writer, "write_message", writer.write)
        #: Of bags of ROS 2 in MCAP files, from which alone rows are read.
        self.write_rows: Any = getattr(writer, "write_rows", None)

    def add(self, connection: Any, topic: str, is_corrected: bool) -> Any:
        """A connection like one that was read, perhaps of another topic.

        In bags of ROS 1, which hold notes nowhere else, the header of one whose positions are
        corrected says so: its caller is the note, in which the caller stands that it had.

        Raises
        ------
        FileError
            An old bag holds no definition of a type of its own.
        """
        if self._bag.is_ros1:
            caller = connection.ext.callerid
            caller = caller_note(self._note, caller) if is_corrected else caller
            return self._writer.add_connection(
                topic,
                connection.msgtype,
                msgdef=connection.msgdef.data,
                md5sum=connection.digest,
                callerid=caller,
                latching=connection.ext.latching,
            )
        known = connection.msgdef.format != MessageDefinitionFormat.NONE and connection.digest
        if not known and connection.msgtype not in self._bag.types.fielddefs:
            raise FileError(
                self._bag.path,
                f"topic {connection.topic} is of type {connection.msgtype}, whose definition this "
                "old bag does not hold; convert it with ros2 bag convert first",
            )
        definition: dict[str, Any] = (
            {"msgdef": connection.msgdef.data, "rihs01": connection.digest}
            if known
            else {"typestore": self._bag.types}
        )
        return self._writer.add_connection(
            topic,
            connection.msgtype,
            serialization_format=connection.ext.serialization_format,
            offered_qos_profiles=connection.ext.offered_qos_profiles,
            **definition,
        )


@contextmanager
def opened_writer(bag: OpenBag, target: Path, note: str) -> Iterator[BagWriter]:
    """A writer of the kind of ``bag``; ``note`` says where the corrected topic is from."""
    if bag.is_ros1:
        made = _ros1(bag, target)
        try:
            with made:
                yield BagWriter(bag, made, note)
        finally:
            with suppress(OSError):  # a full disk leaves it open
                made.abort()
        return
    single = not bag.path.is_dir()
    folder = target.with_name(f"{target.name}.bag") if single else target
    storage = bag.reader.storage
    parts = [storage] if single else storage.storages
    mcap = bool(parts) and isinstance(parts[0], ChunkReader)
    writer = Writer(
        folder, version=9, storage_plugin=StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    )
    mode = bag.reader.compression_mode
    if mcap and any(chunk.compression for part in parts for chunk in part.chunks):
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    elif mode:
        writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    for key, value in {**bag.custom, KEY: note}.items():
        writer.set_custom_data(key, value)
    with writer:
        yield BagWriter(bag, writer, note)
    if single:
        (file,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
        os.replace(file, target)


def _ros1(bag: OpenBag, target: Path) -> Any:
    writer = Writer1(target)
    for compression in Writer1.CompressionFormat:
        if compression.name.lower() in bag.reader.codecs:
            writer.set_compression(compression)
    return writer
