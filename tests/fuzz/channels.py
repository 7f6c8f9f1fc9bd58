"""MDF4 written block by block: links, types, widths, conversions and packed data are fields."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field

import numpy as np

from pen import Pen

#: Records of the channel group.
_ROWS = 12


@dataclass
class _Block:
    kind: bytes
    links: list[str]
    data: bytes
    count: int | None = field(default=None)


def mdf4(pen: Pen, variant: int) -> bytes:
    """A group of channels.

    ``variant``: 0 plain, 1 packed, 2 packed and transposed behind lists, 3 with conversions and
    invalidation bits, 4 unsorted with two groups, 5 texts of any length, 6 columns of their own.
    """
    blocks: dict[str, _Block] = {}
    number, numbers = pen.number, pen.numbers

    def text(key: str, words: bytes) -> str:
        body = pen.text(words) + b"\0"
        blocks[key] = _Block(b"##TX", [], body + bytes(-len(body) % 8))
        return key

    blocks["HD"] = _Block(
        b"##HD", ["DG", "FH", "", "", "", ""], number("<Q", 1_700_000_000 * 10**9) + bytes(24)
    )
    blocks["FH"] = _Block(
        b"##FH", ["", text("md", b"<FHcomment><TX>x</TX></FHcomment>")], bytes(16)
    )
    blocks["md"].kind = b"##MD"
    wide = 8 if variant == 4 else 0
    data = "HL" if variant == 2 else "DT"
    blocks["DG"] = _Block(b"##DG", ["", "CG", data, ""], number("<B", 1 if wide else 0) + bytes(7))
    channels = ["time_s", "reference_deg", "indicated_deg", "note"]
    invalid = 1 if variant == 3 else 0
    width = 8 * len(channels) + invalid
    second = "CG2" if variant == 4 else ""
    blocks["CG"] = _group(pen, second, "CN0", _ROWS, width - invalid, invalid, 1)
    if second:
        blocks["CG2"] = _group(pen, "", "CN_", 3, 8, 0, 2)
        blocks["CN_"] = _channel(pen, ["", "", text("TX_", b"other"), "", "", "", "", ""], 0, 4, 0)
    for i, name in enumerate(channels):
        after = f"CN{i + 1}" if i + 1 < len(channels) else ""
        links = [after, "", text(f"TX{i}", name.encode()), "", "", "", text(f"U{i}", b"deg"), ""]
        if variant == 3 and i:
            links[4] = f"CC{i}"
            blocks[f"CC{i}"] = _conversion(pen, i)
            if i == 3:
                blocks["CC3"].links += [text("a", b"on"), text("b", b"off"), ""]
        is_text = i == 3 and variant == 5
        if is_text:
            links[5] = "SD"
        kind = 2 if i == 0 else 1 if is_text else 0
        blocks[f"CN{i}"] = _channel(pen, links, kind, 7 if is_text else 4, i, invalid and i == 2)
    records, texts = [], b""
    for i in range(_ROWS):
        values = [0.125 * i, 30.0 * i, 30.0 * i + 0.25 * float(np.sin(i)), float(i % 3)]
        row = numbers("<d", values)
        if variant == 5:
            words = pen.text(b"words")
            row = row[:-8] + number("<Q", len(texts))
            texts += number("<I", len(words)) + words
        row += bytes(invalid)
        records.append((number("<B", 1) if wide else b"") + row)
        if wide and i % 4 == 0:
            records.append(number("<B", 2) + number("<d", float(i)))
    body = b"".join(pen.parts(records))
    if variant == 5:
        blocks["SD"] = _Block(b"##SD", [], texts)
    if variant == 6:
        blocks["DT"] = _Block(b"##DV", [], body)
        blocks["DG"].links[2] = "LD"
        flags = number("<I", 1) + number("<I", 1) + number("<Q", _ROWS)
        blocks["LD"] = _Block(b"##LD", ["", "DT"], flags)
    elif variant in (1, 2):
        blocks["DT"] = _packed(pen, body, variant == 2, width)
        if variant == 2:
            blocks["HL"] = _Block(b"##HL", ["DL"], number("<H", 1) + number("<B", 1) + bytes(5))
            listed = number("<B", 1) + bytes(3) + number("<I", 1) + number("<Q", len(body))
            blocks["DL"] = _Block(b"##DL", ["", "DT"], listed)
    else:
        blocks["DT"] = _Block(b"##DT", [], body)
    return _laid_out(pen, blocks)


def _group(
    pen: Pen, after: str, channel: str, rows: int, width: int, invalid: int, number: int
) -> _Block:
    made = pen.number("<Q", number) + pen.number("<Q", rows) + pen.number("<H", 0) + bytes(6)
    made += pen.number("<I", width) + pen.number("<I", invalid)
    return _Block(b"##CG", [after, channel, "", "", "", ""], made)


def _channel(
    pen: Pen, links: list[str], kind: int, data: int, i: int, invalid: bool | int = False
) -> _Block:
    made = pen.number("<B", kind) + pen.number("<B", 1 if kind == 2 else 0)
    made += pen.number("<B", data) + pen.number("<B", 0)
    made += pen.number("<I", 8 * i) + pen.number("<I", 64) + pen.number("<I", 2 if invalid else 0)
    made += pen.number("<I", 0) + pen.number("<B", 0) + bytes(1) + pen.number("<H", 0)
    return _Block(b"##CN", links, made + pen.numbers("<d", [0.0] * 6))


def _conversion(pen: Pen, i: int) -> _Block:
    """Linear, by a table, or to texts."""
    kind, values, count = (
        (1, [0.0, 1.0], 0),
        (4, [0.0, 0.0, 400.0, 400.0], 0),
        (7, [0.0, 1.0], 3),
    )[i - 1]
    made = pen.number("<B", kind) + pen.number("<B", 0) + pen.number("<H", 0)
    made += pen.number("<H", count) + pen.number("<H", len(values)) + bytes(16)
    return _Block(b"##CC", ["", "", "", ""], made + pen.numbers("<d", values))


def _packed(pen: Pen, body: bytes, turned: bool, width: int) -> _Block:
    inside = body
    if turned:
        whole = len(body) // width * width
        rows = np.frombuffer(body[:whole], np.uint8).reshape(-1, width)
        inside = rows.T.tobytes() + body[whole:]
    packed = zlib.compress(inside)
    made = pen.text(b"DT") + pen.number("<B", 1 if turned else 0) + bytes(1)
    made += pen.number("<I", width if turned else 0)
    made += pen.number("<Q", len(body)) + pen.number("<Q", len(packed))
    return _Block(b"##DZ", [], made + packed)


def _laid_out(pen: Pen, blocks: dict[str, _Block]) -> bytes:
    """Blocks after the other, their links the places where others came to stand."""
    places, place = {"": 0}, 64
    for key, block in blocks.items():
        places[key] = place
        place += 24 + 8 * len(block.links) + len(block.data)
        place += -place % 8
    made = bytearray(struct.pack("<8s8s8s4xH30xHH", b"MDF     ", b"4.10    ", b"fuzz", 410, 0, 0))
    other = list(places.values())
    for key, block in blocks.items():
        made += bytes(places[key] - len(made))
        links = []
        for link in block.links:
            at = places[link]
            if pen.hit():  # to another block, as often as to anywhere
                at = pen.rng.choice((*other, *other, at + 8, 2**40, 64))
            links.append(struct.pack("<Q", at))
        length = 24 + 8 * len(links) + len(block.data)
        made += pen.text(block.kind)[:4].ljust(4, b"#") + bytes(4)
        made += pen.number("<Q", length) + pen.number("<Q", len(links)) + b"".join(links)
        made += block.data
    return bytes(made)
