"""Parquet, Arrow and HDF5 with damage behind their first checks.

Their libraries make the files; what they say of themselves (footers and page headers of Parquet,
messages of Arrow, object headers of HDF5) is taken apart and put together with some of it wrong.
"""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from pen import Pen
from thrift import structure, written

#: Fields of Parquet's thrift: row groups, their columns, what a column says of itself.
_GROUPS, _COLUMNS, _COLUMN = 4, 1, 3
_PAGE, _DICTIONARY_PAGE, _PACKED, _OFFSET = 9, 11, 7, 2


def parquet(pen: Pen, whole: bytes) -> bytes:
    """A Parquet file written again: every page header and the footer, field by field."""
    size = int.from_bytes(whole[-8:-4], "little")
    footer, _ = structure(whole[-8 - size : -8])
    made = bytearray(b"PAR1")
    for group in footer[_GROUPS][1][1]:
        for column in group[_COLUMNS][1][1]:
            said = column[_COLUMN][1]
            first = said.get(_DICTIONARY_PAGE, said[_PAGE])[1]
            place, end = min(first, said[_PAGE][1]), 0
            end = place + said[_PACKED][1]
            begin = len(made)
            while place < end:
                if place == said[_PAGE][1]:
                    said[_PAGE] = (said[_PAGE][0], len(made))
                elif _DICTIONARY_PAGE in said and place == said[_DICTIONARY_PAGE][1]:
                    said[_DICTIONARY_PAGE] = (said[_DICTIONARY_PAGE][0], len(made))
                head, after = structure(whole, place)
                stop = after + head[3][1]
                made += written(pen, head) + pen.text(whole[after:stop])
                place = stop
            said[_PACKED] = (said[_PACKED][0], len(made) - begin)
    foot = written(pen, footer)
    return bytes(made) + foot + pen.number("<I", len(foot)) + b"PAR1"


def arrow(whole: bytes, rng: random.Random) -> bytes:
    """An Arrow file or stream with fields of its messages' tables changed, or of its buffers."""
    messages, at = [], 0 if whole[:4] == b"\xff\xff\xff\xff" else 8
    while whole[at : at + 4] == b"\xff\xff\xff\xff":
        size = int.from_bytes(whole[at + 4 : at + 8], "little")
        if not size:
            break
        messages.append((at + 8, size))
        at = whole.find(b"\xff\xff\xff\xff", at + 8 + size)
        if at < 0:
            break
    if whole.endswith(b"ARROW1"):
        size = int.from_bytes(whole[-10:-6], "little")
        messages.append((len(whole) - 10 - size, size))
    made = bytearray(whole)
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        begin, size = rng.choice(messages)
        if rng.random() < 0.2 and begin + size + 64 < len(whole):  # the buffers behind it
            begin, size = begin + size, 64
        width = rng.choice((1, 2, 4, 8, 8))
        place = begin + rng.randrange(max(size // width, 1)) * width
        form = {1: "<b", 2: "<h", 4: "<i", 8: "<q"}[width]
        value = int.from_bytes(made[place : place + width], "little", signed=True)
        if place + width <= len(made):
            pen = Pen(rng, frozenset((1,)))
            made[place : place + width] = pen.number(form, value)
    return bytes(made)


_KINDS = (
    *("f8", ">f4", "f2", "<i2", ">u8", "i1", "complex128", "S8", "S1", "bool", "V8", "V0"),
    *("enum", "vlen", "text", "reference", "pair", "array", "long"),
)


def _kind(name: str) -> Any:
    import h5py
    import numpy as np

    made: dict[str, Any] = {
        "enum": lambda: h5py.enum_dtype({"a": 0, "b": 1}, basetype="i1"),
        "vlen": lambda: h5py.vlen_dtype(np.dtype("f8")),
        "text": h5py.string_dtype,
        "reference": lambda: h5py.ref_dtype,
        "pair": lambda: np.dtype([("a", "f8"), ("indicated_deg", "f4")]),
        "array": lambda: np.dtype(("f8", (3,))),
        "long": lambda: np.dtype("longdouble"),
    }
    return made[name]() if name in made else np.dtype(name)


def hdf5(path: Path, columns: dict[str, Any], rng: random.Random) -> None:
    """A file whose data sets are of unusual kinds, and whose object headers are damaged."""
    import h5py
    import numpy as np

    headers: list[tuple[int, int]] = []
    with h5py.File(path, "w", libver=rng.choice(("earliest", "earliest", "v108"))) as file:
        for name, values in columns.items():
            data = np.array(values, dtype="S8" if isinstance(values[0], str) else float)
            action = rng.random()
            name = rng.choice((name,) * 12 + (f"g/{name}", "a/b/c", "x"))
            if name in file:
                continue
            try:
                if action < 0.06:
                    kind = _kind(rng.choice(_KINDS))
                    shape = rng.choice((data.shape, (), (0,), None, (5,), (2, 20), (2**40,)))
                    more = {"chunks": (5,)} if shape == (2**40,) else {}
                    made = file.create_dataset(name, shape, kind, **more)
                elif action < 0.1:
                    target = rng.choice(("/", "/nowhere", f"/{name}", "/reference_deg", "/g"))
                    file[name] = rng.choice(
                        (
                            h5py.SoftLink(target),
                            h5py.ExternalLink("none.h5", target),
                            h5py.ExternalLink(path.name, target),
                        )
                    )
                    continue
                elif action < 0.13:
                    layout = h5py.VirtualLayout((len(data),), "f8")
                    source = rng.choice((".", "none.h5", path.name))
                    layout[:20] = h5py.VirtualSource(source, "reference_deg", (len(data),))[:20]
                    made = file.create_virtual_dataset(name, layout)
                else:
                    more = rng.choice(
                        (
                            {},
                            {},
                            {"chunks": (7,), "compression": "gzip", "shuffle": True},
                            {"chunks": (16,), "fletcher32": True},
                            {"maxshape": (None,)},
                            {"chunks": (16,), "scaleoffset": 4} if data.dtype.kind == "f" else {},
                            {"chunks": (40,), "compression": "lzf"},
                            {"fillvalue": data[0]},
                        )
                    )
                    made = file.create_dataset(name, data=data, **more)
                for attribute in ("MATLAB_class", "units", "CLASS", "DIMENSION_LIST"):
                    if rng.random() < 0.1:
                        made.attrs[attribute] = rng.choice(
                            (
                                b"double",
                                b"cell",
                                "deg",
                                b"DIMENSION_SCALE",
                                3,
                                [1.5, 2.0],
                                "x" * 500,
                            )
                        )
                headers.append((made.id.get_offset() or 0, 0))
                about = h5py.h5o.get_info(made.id)
                headers[-1] = (about.addr, int(about.hdr.space.total))
            except (TypeError, ValueError, OSError, RuntimeError, OverflowError):
                continue
    whole = bytearray(path.read_bytes())
    for _ in range(rng.choice((0, 0, 0, 1, 1, 2))):
        if not headers:
            break
        begin, size = rng.choice(headers)
        if whole[begin : begin + 4] == b"OHDR":
            continue  # with a checksum: what is there is varied by its making alone
        width = rng.choice((1, 1, 2, 4, 8))
        place = begin + rng.randrange(max(size // width, 1)) * width
        form = {1: "<B", 2: "<H", 4: "<I", 8: "<Q"}[width]
        if place + width <= len(whole):
            value = int.from_bytes(whole[place : place + width], "little")
            whole[place : place + width] = Pen(rng, frozenset((1,))).number(form, value)
    path.write_bytes(bytes(whole))
