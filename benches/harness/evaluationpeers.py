"""What users evaluate harmonics with today: each is prepared for one model."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from harness.compiled import compiled_peer, is_available
from trueangle.estimation import reference
from trueangle.model.model import HarmonicModel

_Array = NDArray[np.float64]
_Evaluate = Callable[[_Array], _Array]


def _coefficients(model: HarmonicModel) -> NDArray[np.complex128]:
    """``A - iB`` of orders 0 to the highest; the model has one shaft of one cycle."""
    (shaft,) = model.shafts
    found = np.zeros(max(shaft.orders) + 1, dtype=complex)
    found[list(shaft.orders)] = np.asarray(shaft.cosine) - 1j * np.asarray(shaft.sine)
    found[0] = model.constant
    return found


def _numpy_reference(model: HarmonicModel) -> _Evaluate:
    return lambda theta: reference.error(model, theta)


def _numpy_horner(model: HarmonicModel) -> _Evaluate:
    amplitudes = _coefficients(model)[::-1]

    def evaluate(theta: _Array) -> _Array:
        unit = np.exp(1j * theta)
        total = np.full(theta.shape, amplitudes[0])
        for amplitude in amplitudes[1:]:
            total *= unit
            total += amplitude
        return total.real

    return evaluate


def _numpy_interp(model: HarmonicModel) -> _Evaluate:
    grid = np.linspace(0.0, 2 * np.pi, 65536, endpoint=False)
    values = reference.error(model, grid)
    return lambda theta: np.interp(theta, grid, values, period=2 * np.pi)


def _cubic_spline(model: HarmonicModel) -> _Evaluate:
    interpolate = importlib.import_module("scipy.interpolate")
    grid = np.linspace(0.0, 2 * np.pi, 4097)
    values = reference.error(model, grid)
    values[-1] = values[0]
    spline = interpolate.CubicSpline(grid, values, bc_type="periodic")
    return lambda theta: np.asarray(spline(theta))


def _terms(model: HarmonicModel) -> str:
    (shaft,) = model.shafts
    lines = zip(shaft.orders, shaft.cosine, shaft.sine, strict=True)
    terms = (f"{a!r} * cos({k} * x) + {b!r} * sin({k} * x)" for k, a, b in lines)
    return " + ".join([repr(model.constant), *terms])


def _numexpr(model: HarmonicModel) -> _Evaluate:
    numexpr = importlib.import_module("numexpr")
    expression = _terms(model)
    return lambda theta: np.asarray(numexpr.evaluate(expression, {"x": theta}))


def _numba(model: HarmonicModel) -> _Evaluate:
    numba = importlib.import_module("numba")
    amplitudes = _coefficients(model)
    a, b = amplitudes.real.copy(), -amplitudes.imag

    def clenshaw(theta: _Array) -> _Array:
        values = np.empty_like(theta)
        for i in numba.prange(theta.size):
            c, s = np.cos(theta[i]), np.sin(theta[i])
            a1, a2, b1, b2 = 0.0, 0.0, 0.0, 0.0
            for k in range(a.size - 1, 0, -1):
                a1, a2 = a[k] + 2 * c * a1 - a2, a1
                b1, b2 = b[k] + 2 * c * b1 - b2, b1
            values[i] = a[0] + c * a1 - a2 + s * b1
        return values

    compiled: _Evaluate = numba.njit(parallel=True)(clenshaw)
    return compiled


def _jax(model: HarmonicModel) -> _Evaluate:
    jax = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)
    amplitudes = _coefficients(model)[::-1]

    def horner(theta: Any) -> Any:
        unit = jax.numpy.exp(1j * theta)
        total: Any = 0.0
        for amplitude in amplitudes:
            total = total * unit + amplitude
        return jax.numpy.real(total)

    compiled = jax.jit(horner)
    return lambda theta: np.asarray(compiled(theta).block_until_ready())


def _finufft(model: HarmonicModel) -> _Evaluate:
    finufft = importlib.import_module("finufft")
    amplitudes = _coefficients(model)
    modes = np.concatenate([np.zeros(amplitudes.size - 1), amplitudes])

    def evaluate(theta: _Array) -> _Array:
        return np.asarray(finufft.nufft1d2(theta, modes, isign=1, eps=1e-14).real)

    return evaluate


def _polars(model: HarmonicModel) -> _Evaluate:
    polars = importlib.import_module("polars")
    (shaft,) = model.shafts
    x = polars.col("x")
    total = polars.lit(model.constant)
    for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
        total = total + a * (k * x).cos() + b * (k * x).sin()

    def evaluate(theta: _Array) -> _Array:
        return np.asarray(polars.DataFrame({"x": theta}).select(total).to_series().to_numpy())

    return evaluate


def _ducc0(model: HarmonicModel) -> _Evaluate:
    ducc0 = importlib.import_module("ducc0")
    amplitudes = _coefficients(model)
    modes = np.concatenate([np.zeros(amplitudes.size - 1), amplitudes])

    def evaluate(theta: _Array) -> _Array:
        found = ducc0.nufft.u2nu(
            grid=modes, coord=theta[:, None], forward=False, epsilon=1e-14, nthreads=0,
            periodicity=2.0 * np.pi, fft_order=False,
        )  # fmt: skip
        return np.asarray(found.real)

    return evaluate


def _duckdb(model: HarmonicModel) -> _Evaluate:
    connection = importlib.import_module("duckdb").connect()
    query = f"select {_terms(model)} as y from t"

    def evaluate(theta: _Array) -> _Array:
        t = {"x": theta}  # found by its name in the query
        return np.asarray(connection.execute(query).fetchnumpy()["y"]) if t else theta

    return evaluate


#: Ways by name: the package that has to be installed and the function that prepares it.
_PEERS: dict[str, tuple[str, Callable[[HarmonicModel], _Evaluate]]] = {
    "numpy per order (reference)": ("numpy", _numpy_reference),
    "numpy complex Horner": ("numpy", _numpy_horner),
    "numpy.interp, 65536 entries": ("numpy", _numpy_interp),
    "scipy CubicSpline, 4096 knots": ("scipy", _cubic_spline),
    "numexpr": ("numexpr", _numexpr),
    "numba Clenshaw, all threads": ("numba", _numba),
    "jax Horner": ("jax", _jax),
    "finufft type 2, eps 1e-14": ("finufft", _finufft),
    "ducc0 type 2, eps 1e-14": ("ducc0", _ducc0),
    "polars": ("polars", _polars),
    "duckdb": ("duckdb", _duckdb),
}


def evaluation_peers(model: HarmonicModel) -> tuple[dict[str, _Evaluate], list[str]]:
    """Ways that are installed, ready to evaluate the model, and the names of the others."""
    ways, missing = {}, []
    for name, (package, prepare) in _PEERS.items():
        if importlib.util.find_spec(package) is None:
            missing.append(name)
        else:
            ways[name] = prepare(model)
    for name, function in (
        ("C -Ofast, libmvec, per order", "per_order"),
        ("C -Ofast, libmvec, Horner", "horner"),
    ):
        if is_available():
            ways[name] = compiled_peer(function)(model)
        else:
            missing.append(name)
    return ways, missing
