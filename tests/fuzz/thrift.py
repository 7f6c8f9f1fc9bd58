"""Thrift's compact protocol, as far as Parquet uses it: taken apart, and written with damage.

A structure is a dict of field numbers to (type, value), a list is (type of entries, values).
"""

from __future__ import annotations

import struct
from typing import Any

from pen import Pen

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _DOUBLE, _BINARY, _LIST, _SET, _MAP, _STRUCT = range(1, 13)
#: Kinds that stand for one another on the wire.
_WHOLE = (_I16, _I32, _I64)


def _varint(data: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[at]
        value |= (byte & 127) << shift
        at, shift = at + 1, shift + 7
        if byte < 128:
            return value, at


def _read(data: bytes, at: int, kind: int) -> tuple[Any, int]:
    if kind in (_TRUE, _FALSE):
        return kind == _TRUE, at
    if kind == _BYTE:
        return data[at], at + 1
    if kind in _WHOLE:
        value, at = _varint(data, at)
        return (value >> 1) ^ -(value & 1), at
    if kind == _DOUBLE:
        return struct.unpack_from("<d", data, at)[0], at + 8
    if kind == _BINARY:
        size, at = _varint(data, at)
        return data[at : at + size], at + size
    if kind == _LIST:
        size, entry = data[at] >> 4, data[at] & 15
        at += 1
        if size == 15:
            size, at = _varint(data, at)
        values = []
        for _ in range(size):
            if entry in (_TRUE, _FALSE):
                value, at = data[at] == 1, at + 1
            else:
                value, at = _read(data, at, entry)
            values.append(value)
        return (entry, values), at
    assert kind == _STRUCT, kind
    return structure(data, at)


def structure(data: bytes, at: int = 0) -> tuple[dict[int, tuple[int, Any]], int]:
    """A structure, and where it ends."""
    found: dict[int, tuple[int, Any]] = {}
    last = 0
    while data[at]:
        head, at = data[at], at + 1
        if head >> 4:
            last += head >> 4
        else:
            number, at = _varint(data, at)
            last = (number >> 1) ^ -(number & 1)
        value, at = _read(data, at, head & 15)
        found[last] = (head & 15, value)
    return found, at + 1


def _bits(value: int) -> bytes:
    made = bytearray()
    value &= (1 << 64) - 1
    while value >= 128:
        made.append(value & 127 | 128)
        value >>= 7
    return bytes((*made, value))


def _zigzag(value: int) -> bytes:
    return _bits((value << 1) ^ (value >> 63))


def _written(pen: Pen, kind: int, value: Any) -> bytes:
    if kind in (_TRUE, _FALSE):
        return b""
    if kind == _BYTE:
        return pen.number("<B", value)
    if kind in _WHOLE:
        form = {_I16: "<h", _I32: "<i", _I64: "<q"}[kind]
        return _zigzag(struct.unpack(form, pen.number(form, value))[0])
    if kind == _DOUBLE:
        return pen.number("<d", value)
    if kind == _BINARY:
        text = pen.text(value)
        size = len(text)
        if pen.hit():
            size = pen.rng.choice((size + 1, size - 1, 2**31, 2**32 - 1, 0))
        return _bits(size) + text
    if kind == _LIST:
        entry, values = value
        if entry in (_TRUE, _FALSE):
            parts = [b"\1" if v else b"\2" for v in values]
        else:
            parts = [_written(pen, entry, v) for v in values]
        parts = pen.parts(parts)
        size = len(parts)
        if pen.hit():
            size = pen.rng.choice((size + 1, max(size - 1, 0), 2**31 - 1, 10_000_000))
        head = bytes([size << 4 | entry]) if size < 15 else bytes([0xF0 | entry]) + _bits(size)
        return head + b"".join(parts)
    return written(pen, value)


def written(pen: Pen, fields: dict[int, tuple[int, Any]]) -> bytes:
    """A structure, some of whose fields go wrong, are missing, or are of another type."""
    made, last = [], 0
    for number, (kind, value) in fields.items():
        if kind in (_TRUE, _FALSE):
            kind = _TRUE if value ^ pen.hit() else _FALSE
        body = _written(pen, kind, value)
        if pen.hit():
            if pen.rng.random() < 0.6:
                continue
            kind = pen.rng.randrange(1, 13)
        step = number - last
        head = bytes([step << 4 | kind]) if 0 < step < 16 else bytes([kind]) + _zigzag(number)
        made.append(head + body)
        last = number
    return b"".join(made) + b"\0"
