"""The strongest thing a user could write: loops in C, by the compiler's fastest mathematics."""

from __future__ import annotations

import ctypes
import functools
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trueangle.model.model import HarmonicModel

_Array = NDArray[np.float64]

#: With these GCC takes sines and cosines of whole vectors from glibc's libmvec.
FLAGS = ("-Ofast", "-march=native", "-fopenmp", "-fPIC")

#: Every order by itself, and Horner's rule.
_SOURCE = Path(__file__).with_name("loops.c")


def is_available() -> bool:
    """Whether there is a GCC here, and it compiles the loops."""
    try:
        _library()
    except (OSError, subprocess.SubprocessError):
        return False
    return True


@functools.cache
def _library() -> ctypes.CDLL:
    compiler = shutil.which("gcc")
    if compiler is None:
        raise FileNotFoundError("gcc")
    with tempfile.TemporaryDirectory() as name:
        made, library = (Path(name, f"loops.{end}") for end in ("o", "so"))
        for command in (
            [compiler, *FLAGS, "-c", "-o", str(made), str(_SOURCE)],
            # Linked without them: -Ofast would turn off subnormal numbers for all of Python.
            [compiler, "-shared", "-fopenmp", "-o", str(library), str(made), "-lm"],
        ):
            subprocess.run(command, check=True, capture_output=True)
        return ctypes.CDLL(str(library))


def compiled_peer(name: str) -> Callable[[HarmonicModel], Callable[[_Array], _Array]]:
    """The peer of a function of the source, ready to be prepared for a model of dense orders."""

    def prepare(model: HarmonicModel) -> Callable[[_Array], _Array]:
        (shaft,) = model.shafts
        function = getattr(_library(), name)
        function.restype = None
        columns = [
            np.ascontiguousarray(values, dtype=np.float64)
            for values in (shaft.orders, shaft.cosine, shaft.sine)
        ]
        pointers = [ctypes.c_void_p(column.ctypes.data) for column in columns]

        def evaluate(theta: _Array) -> _Array:
            values = np.empty_like(theta)
            function(
                ctypes.c_void_p(theta.ctypes.data),
                ctypes.c_void_p(values.ctypes.data),
                ctypes.c_size_t(theta.size),
                ctypes.c_double(model.constant),
                *pointers,
                ctypes.c_size_t(len(columns[0])),
            )
            return values

        return evaluate

    return prepare
