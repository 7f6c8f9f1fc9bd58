"""Models of a term each, and their correction as a loop in C that a user might write.

Horner's rule for the 17 orders, three steps of the fixed point, sines and exponentials of whole
vectors from glibc's libmvec: what the arithmetic of such a model needs by other means.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

from harness.compiled import FLAGS
from harness.evaluation import evaluated_model
from trueangle import terms

TURN = 360.0
SERIES = evaluated_model(range(1, 18), TURN).shafts[0]
LINES = {"orders": (1, 2, 50), "cosine": (1e-4, 2e-5, 1e-5), "sine": (0.0, 0.0, 0.0)}
BROKEN = {**LINES, "orders": (1, 2, 50.5)}


def lines(last: str) -> str:
    """The three lines of `LINES` in C; sines only, which GCC takes several of at once."""
    place = "sin(u + Q) * 1e-4 + sin(2 * u + Q) * 2e-5 + sin({} * u + Q) * 1e-5"
    return place.format(last)


class Case(NamedTuple):
    """A term, the signal it follows, and its arithmetic in C.

    `before` takes what does not depend on the angle off the goal `g`; `term` is the error `t` at
    the angle `u` (radians; `x` in degrees, `e` the harmonics); both see the signal `v`. Where
    `sides`, both edges of the play are solved and gone through in order.
    """

    model: tuple[terms.Term, ...]
    signal: str = ""
    before: str = ""
    term: str = ""
    after: str = ""
    sides: bool = False


CASES = {
    "no term": Case(()),
    "latency": Case((terms.Latency(1e-3),), "velocity", after="1e-3 * v"),
    "torsional compliance": Case((terms.TorsionalCompliance(1e-3),), "torque", "1e-3 * v"),
    "the same, 3 lines": Case(
        (terms.TorsionalCompliance(1e-3, **LINES),), "torque", "1e-3 * v", f"v * ({lines('50')})"
    ),
    "the same, broken order": Case(
        (terms.TorsionalCompliance(1e-3, **BROKEN),), "torque", "1e-3 * v", f"v * ({lines('50.5')})"
    ),
    "channel skew": Case(
        (terms.ChannelSkew(1e-6, 8.0),), "velocity", "5e-7 * v", "5e-7 * v * sin(8 * u)"
    ),
    "current coupling": Case((terms.CurrentCoupling(1e-3),), "current", "1e-3 * v"),
    "load dependent gear error": Case(
        (terms.LoadDependentGearError(**LINES, torque="absolute"),),
        "torque",
        term=f"fabs(v) * ({lines('50')})",
    ),
    "stiffening compliance": Case(
        (terms.StiffeningCompliance(1e-3, 1e-6, 1e-4, 2.0),),
        "torque",
        "1e-3 * v + 1e-6 * v * v * v + 1e-4 * copysign(fmax(fabs(v) - 2, 0), v)",
    ),
    "the same, gravity": Case(
        (terms.StiffeningCompliance(1e-3, 1e-6, 0.0, 0.0, 30.0),),
        "torque",
        term="v * sin(u - Q / 3) * (1e-3 + 1e-6 * v * v * sin(u - Q / 3) * sin(u - Q / 3))",
    ),
    "thermal drift": Case((terms.ThermalDrift(1e-3),), "temperature", "1e-3 * (v - 20)"),
    "the same, pattern and 3 lines": Case(
        (terms.ThermalDrift(1e-3, 1e-3, **LINES),),
        "temperature",
        "1e-3 * (v - 20)",
        f"(v - 20) * (1e-3 * e + {lines('50')})",
    ),
    "varying line": Case((terms.VaryingLine(**LINES),), "velocity", term=f"v * ({lines('50')})"),
    "local defect": Case(
        (terms.LocalDefect(100.0, 3.0, 0.01),),
        term="0.01 * exp(-0.5 * SQUARE((x - 100 - 360 * rint((x - 100) / 360)) / 3))",
    ),
    "scale error": Case(
        (terms.ScaleError(1e-4, -170.0, 170.0),), term="1e-4 * fmin(fmax(x, -170), 170)"
    ),
    "filter lag": Case((terms.FilterLag(200.0),), "velocity", term="FILTER"),
    "backlash, velocity": Case((terms.Backlash(0.02),), "velocity", "0.02 * copysign(1, v)"),
    "backlash": Case((terms.Backlash(0.02),), "", "0.02 * side", sides=True),
    "backlash, 3 lines": Case(
        (terms.Backlash(0.02, **LINES),), "", "0.02 * side", f"side * ({lines('50')})", sides=True
    ),
    "direction dependent pattern": Case(
        (terms.DirectionalPattern(**LINES),),
        "velocity",
        term=f"copysign(1, v) * ({lines('50')})",
    ),
    "presliding hysteresis, velocity": Case(
        (terms.PreslidingHysteresis(0.01, 2.0, 1.0),), "velocity", term="WOUND"
    ),
}

SOURCE = """
#include <math.h>
#include <stddef.h>
#define RAD (M_PI / 180)
#define Q (M_PI / 2)
#define SQUARE(z) ((z) * (z))
#define BLOCK 512
#define EACH for (size_t i = 0; i < m; i++)
static const double A[] = {%(cosine)s}, B[] = {%(sine)s};

static void series(const double *restrict th, double *restrict e, size_t m) {
    double c[BLOCK], s[BLOCK], re[BLOCK], im[BLOCK];
    EACH c[i] = cos(RAD * th[i]);
    EACH s[i] = sin(RAD * th[i]);
    EACH re[i] = im[i] = 0;
    for (size_t j = 17; j-- > 0;) EACH {
        const double p = re[i] + A[j], q = im[i] - B[j];
        re[i] = p * c[i] - q * s[i];
        im[i] = p * s[i] + q * c[i];
    }
    EACH e[i] = re[i];
}

static void behind_filter(const double *restrict th, const double *restrict velocity,
                          double *restrict t, size_t m) {
    double c[BLOCK], s[BLOCK], kc[BLOCK], ks[BLOCK];
    EACH c[i] = kc[i] = cos(RAD * th[i]);
    EACH s[i] = ks[i] = sin(RAD * th[i]);
    EACH t[i] = 0;
    for (size_t j = 0; j < 17; j++) EACH {
        const double w = (j + 1) * velocity[i] / 360 / 200, h = 1 / (1 + w * w);
        const double p = -h * w * (A[j] * w + B[j]), q = -h * w * (B[j] * w - A[j]);
        const double next = kc[i] * c[i] - ks[i] * s[i];
        t[i] += p * kc[i] + q * ks[i];
        ks[i] = ks[i] * c[i] + kc[i] * s[i];
        kc[i] = next;
    }
}
"""

FUNCTION = """
static void %(name)s_solve(const double *restrict given, const double *restrict signal,
                           double *restrict y, size_t m, double side) {
    double g[BLOCK], e[BLOCK], t[BLOCK] = {0};
    EACH { const double v = signal[i]; (void)v; y[i] = g[i] = given[i] - (%(before)s); }
    for (int step = 0; step < 3; step++) {
        series(y, e, m);
        %(term)s
        EACH y[i] = g[i] - e[i] - t[i];
    }
    EACH { const double v = signal[i]; (void)v; y[i] += %(after)s; }
}
void %(name)s(const double *x, const double *signal, double *y, size_t n) {
    double back[BLOCK], last = 0;
    for (size_t start = 0; start < n; start += BLOCK) {
        const size_t m = start + BLOCK < n ? BLOCK : n - start;
        %(name)s_solve(x + start, signal + start, y + start, m, 1);
        if (%(sides)d) {
            %(name)s_solve(x + start, signal + start, back, m, -1);
            EACH {
                if (start + i == 0) last = 0.5 * (y[0] + back[0]);
                last = y[start + i] = fmax(y[start + i], fmin(back[i], last));
            }
        }
    }
}
"""

#: Presliding hysteresis goes reading by reading: the state after one is that before the next.
WOUND = """
void %(name)s(const double *x, const double *signal, double *y, size_t n) {
    double z = 0, last = 0;
    for (size_t i = 0; i < n; i++) {
        const double d = copysign(1, signal[i]);
        double now = x[i], next = d;
        for (int step = 0; step < 4; step++) {
            const double u = RAD * now, c = cos(u), s = sin(u), way = (now - last) * d;
            double re = 0, im = 0;
            for (size_t j = 17; j-- > 0;) {
                const double p = re + A[j], q = im - B[j];
                re = p * c - q * s;
                im = p * s + q * c;
            }
            next = i == 0 ? d : way > 0 ? d - (d - z) * exp(-way / 2) : z;
            now = x[i] - re - 0.01 * next;
        }
        y[i] = now;
        if (i == 0 || (now - last) * d > 0) last = now;
        z = next;
    }
}
"""


def library(folder: str) -> ctypes.CDLL:
    """All cases, compiled; without -Ofast where they are linked, as `bench.compiled` explains."""
    values = {"cosine": SERIES.cosine, "sine": SERIES.sine}
    source = SOURCE % {name: ", ".join(map(repr, column)) for name, column in values.items()}
    for i, case in enumerate(CASES.values()):
        seen = "const double v = signal[i], x = y[i], u = RAD * x; (void)v; (void)u;"
        term = case.term.replace(" e ", " e[i] ")
        if case.term == "FILTER":
            term = "behind_filter(y, signal, t, m);"
        elif term:
            term = f"EACH {{ {seen} t[i] = {term}; }}"
        source += (WOUND if case.term == "WOUND" else FUNCTION) % {
            "name": f"case_{i}",
            "before": case.before or "0",
            "term": term,
            "after": case.after or "0",
            "sides": case.sides,
        }
    path, made, shared = (Path(folder, f"terms.{end}") for end in ("c", "o", "so"))
    path.write_text(source, encoding="utf-8")
    compiler = shutil.which("gcc") or "gcc"
    for command in (
        [compiler, *FLAGS, "-c", "-o", str(made), str(path)],
        [compiler, "-shared", "-fopenmp", "-o", str(shared), str(made), "-lm"],
    ):
        subprocess.run(command, check=True)
    return ctypes.CDLL(str(shared))
