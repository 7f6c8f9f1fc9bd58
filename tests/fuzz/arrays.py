"""Files of arrays, written field by field: ``.npy``, ``.npz``, MATLAB 4 and MATLAB 5."""

from __future__ import annotations

import struct
import zlib

import numpy as np

from pen import Pen

_ROWS = 40


def _columns() -> dict[str, np.ndarray]:
    theta = np.linspace(0.0, 350.0, _ROWS)
    return {
        "time_s": np.arange(_ROWS) * 0.125,
        "reference_deg": theta,
        "indicated_deg": theta + 0.25 * np.sin(np.radians(theta)),
    }


_DESCRIPTIONS = (
    *("'<f8'", "'>f8'", "'<f4'", "'<f2'", "'<c16'", "'|b1'", "'<i2'", "'>u8'", "'|S8'", "'<U4'"),
    *("'|O'", "'<M8[ns]'", "'<m8[s]'", "'|V8'", "'|V0'", "'<U0'", "[]", "'<f16'", "'f8,f8'", "1"),
    *("[('indicated_deg', '<f8')]", "[('a', '<f8', (2,))]", "[('a', [('b', '<f4')])]", "None"),
    *("[('indicated_deg', '<f4'), ('indicated_deg', '<f4')]", "[(('t', 'a'), '<f8')]"),
)
_SHAPES = (
    *("()", "(0,)", "(1,)", "(5,)", "(40,)", "(41,)", "(-1,)", "(2, 20)", "(40, 1)", "(1, 40)"),
    *("(40, 0)", "(0, 40)", "(4294967296,)", "(9223372036854775807,)", "(18446744073709551616,)"),
    *("(40.0,)", "40", "[40]", "(True,)", "(2,) * 4", "(1,1,1,1,1,1,1,1,40)", "('40',)", "None"),
)


def npy(pen: Pen, variant: int, values: np.ndarray | None = None) -> bytes:
    """An array: of columns (0), of numbers (1), of a table in the order of Fortran (2)."""
    if values is None:
        columns = _columns()
        if variant == 0:
            kinds = [(name, column.dtype) for name, column in columns.items()]
            values = np.empty(_ROWS, dtype=kinds)
            for name, column in columns.items():
                values[name] = column
        else:
            values = np.array(list(columns.values())[variant]) if variant < 2 else np.eye(4)
    described = repr(np.lib.format.dtype_to_descr(values.dtype))
    described = pen.rng.choice(_DESCRIPTIONS) if pen.hit() else described
    shape = pen.rng.choice(_SHAPES) if pen.hit() else repr(values.shape)
    order = pen.rng.choice(("True", "False", "1", "None")) if pen.hit() else str(variant == 2)
    keys = [pen.text(key) for key in (b"'descr'", b"'fortran_order'", b"'shape'")]
    entries = [
        key + b": " + value.encode()
        for key, value in zip(keys, (described, order, shape), strict=True)
    ]
    text = b"{" + b", ".join(pen.parts(entries)) + b", }"
    text += b" " * (-(len(text) + 11) % 64) + b"\n"
    data = b"".join(pen.parts([values.tobytes()]))
    head = pen.number("<B", 1) + pen.number("<B", 0) + pen.number("<H", len(text) % 65536)
    return b"\x93NUMPY" + head + text + data


def npz(pen: Pen, variant: int) -> bytes:
    """An archive as it is (0), or packed (1): its directory and members are fields."""
    members = []
    for name, column in (_columns() | {"note": np.array(["a", "bc"] * (_ROWS // 2))}).items():
        members.append((name.encode() + b".npy", npy(pen, 1, column)))
    local, directory, place = [], [], 0
    for name, data in members:
        name = pen.text(name)
        stored = data
        if variant:
            packer = zlib.compressobj(6, zlib.DEFLATED, -15)
            stored = packer.compress(data) + packer.flush()
        fields = b"".join(
            (
                pen.number("<H", 20),
                pen.number("<H", 0),
                pen.number("<H", 8 if variant else 0),
                bytes(4),
                pen.number("<I", zlib.crc32(data)),
                pen.number("<I", len(stored)),
                pen.number("<I", len(data)),
                pen.number("<H", len(name) % 65536),
                pen.number("<H", 0),
            )
        )
        body = b"PK\x03\x04" + fields + name + stored
        local.append(body)
        more = pen.number("<H", 0) + bytes(8) + pen.number("<I", place)
        directory.append(b"PK\x01\x02" + pen.number("<H", 20) + fields + more + name)
        place += len(body)
    inside, listed = b"".join(local), b"".join(pen.parts(directory))
    count = pen.number("<H", len(directory))
    end = b"PK\x05\x06" + bytes(4) + 2 * count + pen.number("<I", len(listed))
    return inside + listed + end + pen.number("<I", len(inside)) + bytes(2)


def matlab4(pen: Pen, variant: int) -> bytes:
    """Matrices of MATLAB 4, of either order of bytes, and a text."""
    order = "<>"[variant % 2]
    made = []
    for name, column in (_columns() | {"note": np.frombuffer(b"words", "u1") * 1.0}).items():
        kind = 1 if name == "note" else 0
        title = pen.text(name.encode()) + b"\0"
        head = (
            pen.number(f"{order}I", 1000 * (order == ">") + kind),
            pen.number(f"{order}I", len(column) if not kind else 1),
            pen.number(f"{order}I", 1 if not kind else len(column)),
            pen.number(f"{order}I", 0),
            pen.number(f"{order}I", len(title)),
        )
        data = pen.numbers(f"{order}d", column.tolist())
        made.append(b"".join((*head, title, data)))
    return b"".join(pen.parts(made))


def _element(pen: Pen, kind: int, data: bytes) -> bytes:
    head = pen.number("<I", kind) + pen.number("<I", len(data))
    return head + data + bytes(-len(data) % 8)


def _matrix(pen: Pen, name: bytes, values: np.ndarray, kind: int = 6, stored: int = 9) -> bytes:
    flags = pen.number("<B", kind) + pen.number("<B", 0) + bytes(2) + pen.number("<I", 0)
    parts = [
        _element(pen, 6, flags),
        _element(pen, 5, pen.numbers("<i", (values.size, 1) if kind != 4 else (1, values.size))),
        _element(pen, 1, pen.text(name)),
        _element(pen, stored, values.tobytes()),
    ]
    return _element(pen, 14, b"".join(pen.parts(parts)))


def _struct(pen: Pen, name: bytes, fields: dict[str, np.ndarray]) -> bytes:
    flags = pen.number("<B", 2) + pen.number("<B", 0) + bytes(6)
    names = b"".join(pen.text(key.encode())[:31].ljust(32, b"\0") for key in fields)
    parts = [
        _element(pen, 6, flags),
        _element(pen, 5, pen.numbers("<i", (1, 1))),
        _element(pen, 1, pen.text(name)),
        _element(pen, 5, pen.number("<i", 32)),
        _element(pen, 1, names),
        *(_matrix(pen, b"", values) for values in fields.values()),
    ]
    return _element(pen, 14, b"".join(pen.parts(parts)))


def matlab5(pen: Pen, variant: int) -> bytes:
    """Variables as they are, packed, of whole numbers, or in a structure."""
    columns = _columns()
    if variant == 3:
        variables = [_struct(pen, b"rig", columns)]
    elif variant == 2:
        whole = {name: column.astype("<i2") for name, column in columns.items()}
        variables = [_matrix(pen, name.encode(), v, 10, 3) for name, v in whole.items()]
    else:
        variables = [_matrix(pen, name.encode(), v) for name, v in columns.items()]
    words = np.frombuffer(b"words", "u1").astype("<u2")
    variables.append(_matrix(pen, b"note", words, 4, 4))
    if variant == 1:
        packed = [zlib.compress(variable) for variable in variables]
        variables = [pen.number("<I", 15) + pen.number("<I", len(p)) + p for p in packed]
    head = b"MATLAB 5.0 MAT-file, fuzz".ljust(116) + bytes(8) + struct.pack("<H", 0x100) + b"IM"
    return head + b"".join(pen.parts(variables))
