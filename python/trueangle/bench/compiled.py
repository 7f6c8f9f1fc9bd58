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

from ..model.model import HarmonicModel

__all__ = ["FLAGS", "compiled", "is_available"]

_Array = NDArray[np.float64]

#: With these GCC takes sines and cosines of whole vectors from glibc's libmvec.
FLAGS = ("-Ofast", "-march=native", "-fopenmp", "-fPIC")

_SOURCE = """
#include <math.h>
#include <stddef.h>

/* Every order its own cosine and sine; the loop over readings is the inner one. */
void per_order(const double *restrict x, double *restrict y, size_t n, double constant,
               const double *restrict k, const double *restrict a,
               const double *restrict b, size_t orders) {
    const size_t block = 512;
    #pragma omp parallel for
    for (size_t start = 0; start < n; start += block) {
        const size_t stop = start + block < n ? start + block : n;
        for (size_t i = start; i < stop; i++) y[i] = constant;
        for (size_t j = 0; j < orders; j++) {
            /* Apart: both of one angle in one loop GCC takes for a call that is no vector's. */
            for (size_t i = start; i < stop; i++) y[i] += a[j] * cos(k[j] * x[i]);
            for (size_t i = start; i < stop; i++) y[i] += b[j] * sin(k[j] * x[i]);
        }
    }
}

/* One cosine and sine, then Horner's rule of e^{ix} over dense orders from `orders` down. */
void horner(const double *restrict x, double *restrict y, size_t n, double constant,
            const double *restrict k, const double *restrict a,
               const double *restrict b, size_t orders) {
    const size_t block = 512;
    #pragma omp parallel for
    for (size_t start = 0; start < n; start += block) {
        const size_t size = start + block < n ? block : n - start;
        double c[512], s[512], re[512], im[512];
        for (size_t i = 0; i < size; i++) c[i] = cos(x[start + i]);
        for (size_t i = 0; i < size; i++) s[i] = sin(x[start + i]);
        for (size_t i = 0; i < size; i++) re[i] = im[i] = 0.0;
        for (size_t j = orders; j-- > 0;)
            for (size_t i = 0; i < size; i++) {
                const double p = re[i] + a[j], q = im[i] - b[j];
                re[i] = p * c[i] - q * s[i];
                im[i] = p * s[i] + q * c[i];
            }
        for (size_t i = 0; i < size; i++) y[start + i] = constant + re[i];
    }
}
"""


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
        source, made, library = (Path(name, f"loops.{end}") for end in ("c", "o", "so"))
        source.write_text(_SOURCE, encoding="utf-8")
        for command in (
            [compiler, *FLAGS, "-c", "-o", str(made), str(source)],
            # Linked without them: -Ofast would turn off subnormal numbers for all of Python.
            [compiler, "-shared", "-fopenmp", "-o", str(library), str(made), "-lm"],
        ):
            subprocess.run(command, check=True, capture_output=True)
        return ctypes.CDLL(str(library))


def compiled(name: str) -> Callable[[HarmonicModel], Callable[[_Array], _Array]]:
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
