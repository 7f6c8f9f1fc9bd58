"""Checksums: moved to `trueangle.formats.checksum`."""

from ..formats.checksum import Checksum

__all__ = ["Checksum"]
