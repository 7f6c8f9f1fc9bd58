"""Texts that are damaged word by word: tables of runs, logs of instruments, tables of firmware."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import trueangle as ta
from loader import Loader, columns, seeds, use_log, use_runs
from mutation import mutated_table, mutated_words
from trueangle.errors import TrueAngleError
from trueangle.formats.format import Selection
from trueangle.formats.formats import find_format


def _make_csv(folder: Path, rng: random.Random) -> Path:
    values = columns()
    rows = [list(values), *([str(v) for v in row] for row in zip(*values.values(), strict=True))]
    path = folder / "runs.csv"
    path.write_bytes(mutated_table(rows, rng))
    return path


def _numbered(form: str, **more: Any) -> str:
    """Rows of a text, of the columns by name."""
    values = columns() | more
    rows = zip(*values.values(), strict=True)
    return "\n".join(form.format(**dict(zip(values, row, strict=True))) for row in rows)


def _guided() -> str:
    head = (
        "PHD2 version 2.6.13, Log version 2.5. Log enabled at 2026-11-20 22:00:00\n\n"
        "Guiding Begins at 2026-11-20 22:10:00\nPixel scale = 1.50 arc-sec/px\n"
        "Mount = EQ, xAngle = 30.0, xRate = 3.750\nRA = 5.00 hr, Dec = 40.0 deg\n"
        "Lock position = 500.000, 400.000\n"
        "Frame,Time,mount,dx,dy,RARawDistance,DECRawDistance,RADuration,RADirection,SNR\n"
    )
    row = '1,{time_s},"Mount",0.1,0.2,{indicated_deg},0.1,120,W,45.6'
    middle = "\nINFO: DITHER by 1.0, 2.0, new lock pos = 501.000, 402.000\n"
    settled = "INFO: SETTLING STATE CHANGE, Settling complete\n"
    return head + _numbered(row) + middle + settled + _numbered(row)


_BLANKS = "{time_s:12.6f} {reference_deg:12.6f}\t {indicated_deg:e}"
_SERIAL = "reference_deg:{reference_deg},indicated_deg:{indicated_deg}\nok"
_SPOKEN = "22:00:01.5 -> angle = {indicated_deg} deg\n"
_CAMONITOR = "indicated_deg 2026-11-20 22:10:0{time_s:.3f} {indicated_deg} HIHI"
#: Ending, and the text.
_SMALL: dict[str, tuple[str, Callable[[], str]]] = {
    "blanks": (".dat", lambda: _numbered(_BLANKS)),
    "serial": (".log", lambda: _numbered(_SERIAL)),
    "spoken": (".log", lambda: _numbered(_SPOKEN)),
    "camonitor": (".txt", lambda: _numbered(_CAMONITOR)),
    "guidelog": (".txt", _guided),
}


def _make_small(name: str) -> Callable[[Path, random.Random], Path]:
    ending, made = _SMALL[name]
    text = made()

    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / f"log{ending}"
        path.write_bytes(mutated_words(text, rng))
        return path

    return make


def _use_small(path: Path) -> None:
    """Corrected, and every column read: an error of the one must not keep the other away."""
    with contextlib.suppress(TrueAngleError):
        use_log(path)
    module = find_format(path).module
    names = module.columns(path)
    for batch in module.read(path, Selection(names)):
        sizes = {values.size for values in batch.values() if isinstance(values, np.ndarray)}
        assert len(sizes) <= 1 or hasattr(module, "together"), f"unlike lengths: {sizes}"


# -- tables of firmware ---------------------------------------------------------------

#: Target, its options when it is written, and when it is read.
_TABLES: dict[str, tuple[str, dict[str, Any], dict[str, Any]]] = {
    "c": ("c", {"entries": 32, "bits": 10}, {}),
    "c-cubic": ("c", {"entries": 32, "bits": 10, "method": "cubic", "number": "f32"}, {}),
    "rust": ("rust", {"entries": 32, "bits": 10}, {}),
    "csv": ("csv", {"entries": 36, "bits": 10}, {}),
    "simplefoc": ("simplefoc", {"bits": 10, "variant": "minus-u16"}, {"variant": "minus-u16"}),
    "simplefoc-float": ("simplefoc", {"bits": 10}, {}),
    "moteus": ("moteus", {"bits": 10}, {}),
    "linuxcnc": ("linuxcnc", {"type": "0", "entries": 36, "bits": 10}, {"type": "0"}),
    "linuxcnc-1": ("linuxcnc", {"type": "1", "entries": 36, "bits": 10}, {"type": "1"}),
    "twincat": ("twincat", {"variant": "cnc", "entries": 36, "bits": 10}, {"variant": "cnc"}),
    "twincat-nc": ("twincat", {"variant": "nc", "entries": 36, "bits": 10}, {"variant": "nc"}),
    "klipper": ("klipper", {"existing": "printer.cfg"}, {}),
    "admt4000": ("admt4000", {"bits": 10}, {}),
    "tinymovr": ("tinymovr", {"bits": 10}, {}),
    "minicheetah": ("minicheetah", {}, {}),
    "siemens840d": ("siemens840d", {"entries": 36, "bits": 10}, {}),
    "pmac": (
        "pmac",
        {"entries": 32, "bits": 10, "counts_per_turn": 65536},
        {"counts_per_turn": 65536},
    ),
}


def _table(name: str, folder: Path) -> str:
    """A table as it is exported."""
    target, options, _ = _TABLES[name]
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1, 3], [0.1, 0.02], [0.3, 0.0])], 0.0, 360.0)
    if target == "klipper":
        places = np.arange(200) * 1.8
        reading = (places + model.error(places)) % 360.0 / 360.0 * 65536.0
        reading = np.roll(np.round(reading, 1) % 65536.0, -(int(np.argmin(reading)) & ~3))
        there = folder / "printer.cfg"
        there.write_text("[angle a]\ncalibrate = " + ", ".join(f"{v:.1f}" for v in reading) + "\n")
        options = {"existing": str(there)}
    path = folder / "exported"
    ta.export_model(model, target, path, **options)
    return path.read_text()


def _firmware(name: str) -> Loader:
    target, _, read = _TABLES[name]

    def make(folder: Path, rng: random.Random) -> Path:
        path = folder / "table.txt"
        text = seeds(f"table {name}", lambda where: _table(name, where), folder)
        path.write_bytes(mutated_words(text, rng))
        return path

    def use(path: Path) -> None:
        model = ta.import_model(path, target, **read)
        given = dict.fromkeys(model.uses_signals, 1.0)
        assert np.isfinite(model.error(np.linspace(0.0, 360.0, 33), **given)).all()
        assert np.isfinite(model.correct(np.linspace(0.0, 360.0, 33), **given)).all()

    return Loader(f"table-{name}", make, use)


def texts() -> list[Loader]:
    """Loaders of texts."""
    return [
        Loader("runs-csv", _make_csv, use_runs),
        Loader("log-csv", _make_csv, use_log),
        *(Loader(f"small-{name}", _make_small(name), _use_small) for name in _SMALL),
        *map(_firmware, _TABLES),
    ]
