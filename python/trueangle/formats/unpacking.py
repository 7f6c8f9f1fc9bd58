"""Packed parts and files of bags, unpacked up to a limit, for any header.

A file that is packed as a whole is read at places all over, so it is unpacked to a temporary
folder before; a few kilobytes can fill a disk there.
"""

from __future__ import annotations

import bz2
import os
import re
import shutil
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import lz4.frame  # type: ignore[import-untyped]
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ..errors import ArgumentError, FileError
from . import budget
from .budget import check_part, shown_bytes, stored_size

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

#: Bytes on the disk that the files of a bag may unpack to: hours of a robot's sensors with images.
UNPACKED_BYTES: Final = 1 << 36
#: The environment variable that sets another limit.
LIMIT: Final = "TRUEANGLE_UNPACKED_BYTES"

_METADATA = "metadata.yaml"
#: A bag without it need not be looked at any closer.
_PACKED = re.compile(r"compression_mode\W+file\b", re.IGNORECASE)


def unpacked(path: Path, codec: str, part: str, data: bytes) -> bytes:
    """``data`` unpacked by ``codec``: bz2, lz4 or zstd; at most the budget at a time.

    Raises
    ------
    DecodedSizeError
        It unpacks to more.
    EOFError
        It ends before its end.
    """
    made: dict[str, Any] = {
        "bz2": bz2.BZ2Decompressor,
        "lz4": lz4.frame.LZ4FrameDecompressor,
        "zstd": zstd.ZstdDecompressor,
    }
    decompressor = made[codec]()
    found: bytes = decompressor.decompress(data, max_length=budget.DECODED_BYTES + 1)
    check_part(path, len(found), part)
    if not decompressor.eof:
        raise EOFError(f"a {part} ends before its end")
    return found


def unpacked_folder(folder: Path) -> TemporaryDirectory[str] | None:
    """A folder of the bag with its files unpacked; None where they are not packed as a whole.

    Raises
    ------
    FileError
        They unpack to more than the limit; the folder is gone then.
    """
    try:
        text = (folder / _METADATA).read_text()
        told: Any = YAML(typ="safe").load(text) if _PACKED.search(text) else None
        told = told and told["rosbag2_bagfile_information"]
        if not told or told["compression_mode"].lower() != "file":
            return None
        paths = [folder / Path(name).name for name in told["relative_file_paths"]]
    except (OSError, ValueError, YAMLError, KeyError, TypeError, AttributeError):
        return None  # a bag that rosbags complains of
    if told.get("compression_format") != "zstd" or not all(path.is_file() for path in paths):
        return None  # likewise
    made = TemporaryDirectory(prefix="trueangle-")
    try:
        room = _limit()
        for path in paths:
            room -= _unpack(path, Path(made.name, path.stem), room)
        told.update(
            compression_mode="",
            compression_format="",
            relative_file_paths=[path.stem for path in paths],
        )
        with Path(made.name, _METADATA).open("w", encoding="utf-8") as file:
            YAML(typ="safe").dump({"rosbag2_bagfile_information": told}, file)
    except BaseException:
        made.cleanup()
        raise
    return made


def _unpack(path: Path, target: Path, room: int) -> int:
    """Unpack one file to at most ``room`` bytes, and count them."""
    size = 0
    with zstd.open(path, "rb") as packed, target.open("wb") as file:
        while part := packed.read(1 << 20):
            size += len(part)
            if size > room:
                raise FileError(
                    path,
                    f"unpacks to {shown_bytes(size)} or more ({stored_size(path)} on the "
                    f"disk), above the limit of {shown_bytes(_limit())} for the files of "
                    f"a bag. If it is that large, set the variable {LIMIT} to "
                    "more bytes, or unpack the bag by `ros2 bag convert`",
                )
            file.write(part)
    shutil.copystat(path, target)
    return size


def _limit() -> int:
    """Bytes that a bag may unpack to.

    Raises
    ------
    ArgumentError
        The environment variable is not a number.
    """
    said = os.environ.get(LIMIT, "")
    if not said:
        return UNPACKED_BYTES
    try:
        return int(said)
    except ValueError:
        raise ArgumentError(
            f"the variable {LIMIT} must be a number of bytes, as {UNPACKED_BYTES}, got {said!r}"
        ) from None
