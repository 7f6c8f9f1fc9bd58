"""Parts of bags unpacked no farther than the budget, whatever their headers say of them."""

from __future__ import annotations

import bz2
import sys
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]

from . import budget
from .budget import check_part

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

__all__ = ["unpacked"]


def unpacked(path: Path, codec: str, part: str, data: bytes) -> bytes:
    """``data`` unpacked by ``codec``: bz2, lz4 or zstd; no more than the budget at a time.

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
