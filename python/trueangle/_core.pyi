from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Literal, Unpack, final, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .support.signals import GivenSignals

__version__: str

_Corrected = float | NDArray[Any]  # or labelled data, where that went in
_Path = str  # "table", "cubics", "exact", "direct", "counts"; "-avx2" and the like force a set

@final
class Series:
    """Harmonic series made ready for evaluation, correction and control loops."""

    def __new__(
        cls,
        period: float,
        constant: float,
        cycles: Sequence[float],
        orders: Sequence[Sequence[int]],
        cosine: Sequence[Sequence[float]],
        sine: Sequence[Sequence[float]],
        argument: Literal["reference", "indicated"] = "reference",
        tolerance: float = ...,
    ) -> Series: ...
    @overload
    def error(
        self,
        theta: float,
        out: None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> float: ...
    @overload
    def error(
        self,
        theta: ArrayLike,
        out: NDArray[np.floating[Any]] | None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> NDArray[np.floating[Any]]: ...
    @overload
    def slope(
        self,
        theta: float,
        out: None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> float: ...
    @overload
    def slope(
        self,
        theta: ArrayLike,
        out: NDArray[np.floating[Any]] | None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> NDArray[np.floating[Any]]: ...
    @overload
    def correct(
        self,
        indicated: float,
        out: None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> float: ...
    @overload
    def correct(
        self,
        indicated: ArrayLike,
        out: NDArray[np.floating[Any]] | None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> NDArray[np.floating[Any]]: ...
    def correct_within(
        self,
        indicated: ArrayLike,
        stretch: tuple[float, float, bool],
        out: NDArray[np.floating[Any]] | None = None,
        threads: int | None = None,
        path: _Path | None = None,
    ) -> tuple[_Corrected, int]: ...
    @property
    def path(self) -> str: ...
    @property
    def counts_path(self) -> str: ...
    @property
    def float32_path(self) -> str: ...
    @property
    def float32_bound(self) -> float: ...
    @property
    def segments(self) -> int: ...
    @property
    def error_bound(self) -> float: ...
    @property
    def slope_bound(self) -> float: ...
    @property
    def amplitude_sum(self) -> float: ...
    @property
    def is_periodic(self) -> bool: ...

@final
class Compensator:
    """Correction of one sample at a time."""

    def __new__(cls, series: Series) -> Compensator: ...
    @property
    def step(self) -> Any: ...
    def step_with(self, swap: Callable[[Any], None]) -> Any: ...
    def swap(self, series: Series) -> None: ...
    def _empty_step(self, indicated: float, /) -> float: ...

_Array = NDArray[np.float64]

@final
class Corrector:
    """Correction by a series and its terms, in the order the samples were taken."""

    def __new__(cls, series: Series, terms: Sequence[Any]) -> Corrector: ...
    def step(
        self,
        indicated: float,
        /,
        velocity: float | None = None,
        temperature: float | None = None,
        torque: float | None = None,
        direction: float | None = None,
        current: float | None = None,
        **others: float | None,
    ) -> float: ...
    def fresh(self) -> Corrector: ...
    def swap(self, other: Corrector) -> None: ...
    def store(self) -> list[float]: ...
    def restore(self, numbers: Sequence[float]) -> None: ...
    def reset(self) -> None: ...
    def correct(
        self,
        indicated: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: _Path | None = None,
        stretch: tuple[float, float, bool] | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> tuple[_Corrected, int]: ...
    def error(
        self,
        theta: ArrayLike,
        out: NDArray[Any] | None = None,
        *,
        threads: int | None = None,
        path: _Path | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> _Corrected: ...

@final
class Alike:
    """Joints of the same terms, each with a past of its own."""

    def __new__(cls, corrector: Corrector, count: int) -> Alike: ...
    def __len__(self) -> int: ...
    def copy(self) -> Alike: ...
    def reset(self, joints: Sequence[int]) -> None: ...
    def error(
        self, angles: ArrayLike, /, **signals: Unpack[GivenSignals[ArrayLike]]
    ) -> NDArray[np.float64]: ...

@final
class RobotStep:
    """Correction of one sample of every joint at a time."""

    def __new__(cls, names: Sequence[str], parts: Sequence[Series | Corrector]) -> RobotStep: ...
    @property
    def step(self) -> Callable[..., NDArray[np.float64]]: ...
    def swap(self, other: RobotStep) -> None: ...
    def _step(
        self,
        positions: ArrayLike,
        /,
        out: NDArray[np.float64] | None = None,
        **signals: Unpack[GivenSignals[ArrayLike]],
    ) -> NDArray[np.float64]: ...
    def reset(self) -> None: ...
    def __setstate__(self, past: Sequence[Sequence[float]]) -> None: ...

@final
class Banded:
    @staticmethod
    def factor(bands: NDArray[np.float64]) -> Banded | None: ...
    @property
    def log_determinant(self) -> float: ...
    def solve(self, right: NDArray[np.float64]) -> None: ...

@final
class Evidence:
    """Readings of runs, and the orders that are tested."""

    CORRELATION_TIMES: ClassVar[list[float]]
    def __new__(
        cls,
        runs: Sequence[tuple[NDArray[np.float64] | None, ...]],
        orders: Sequence[float],
    ) -> Evidence: ...
    def posterior(
        self, noise: Sequence[float], tau: Sequence[float], omega: Sequence[float]
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]: ...
    def noise(
        self, tau: Sequence[float], omega: Sequence[float], scale: float
    ) -> NDArray[np.float64]: ...
    def under(
        self,
        noise: Sequence[float],
        probabilities: Sequence[float],
        tau: Sequence[float],
        omega: Sequence[float],
    ) -> tuple[
        list[tuple[float, list[float], list[float]]], NDArray[np.float64], NDArray[np.float64]
    ]: ...
    def estimate(
        self, probabilities: Sequence[float]
    ) -> tuple[
        NDArray[np.float64],
        list[int],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        NDArray[np.float64],
        list[tuple[float, list[float], list[float]]],
        NDArray[np.float64],
        list[tuple[float, float, float, float] | None],
    ]: ...

@final
class Groups:
    """Readings of runs, and groups of columns."""

    def __new__(
        cls,
        runs: Sequence[tuple[NDArray[np.float64] | None, ...]],
        widths: Sequence[int],
    ) -> Groups: ...
    def noise(
        self, tau: Sequence[float], scale: float, start: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]: ...
    def sums(self, noise: Sequence[float] | NDArray[np.float64], total: float) -> GroupSums: ...

@final
class GroupSums:
    """What models of groups need of readings under a noise."""

    def search(
        self, given: Sequence[float], probabilities: Sequence[float], start: Sequence[float]
    ) -> tuple[float, list[float]]: ...
    def information(self) -> NDArray[np.float64]: ...
    def posterior(
        self, tau: Sequence[float]
    ) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]: ...
    def changes(
        self, tau: Sequence[float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...

@final
class LinearModel:
    @staticmethod
    def of_rows(
        design: NDArray[np.float64],
        targets: NDArray[np.float64],
        weights: NDArray[np.float64] | None = None,
    ) -> LinearModel: ...
    @staticmethod
    def of_sums(
        gram: NDArray[np.float64],
        moments: NDArray[np.float64],
        squares: Sequence[float],
        lengths: Sequence[float] | None = None,
        floor: float | None = None,
    ) -> LinearModel: ...
    @property
    def rank(self) -> int: ...
    @property
    def log_determinant(self) -> float: ...
    @property
    def squares(self) -> _Array: ...
    @property
    def coefficients(self) -> _Array: ...
    @property
    def root(self) -> _Array: ...
    @property
    def unseen(self) -> _Array: ...
    @property
    def inverse(self) -> _Array: ...

@final
class Decoder:
    def __new__(
        cls,
        constants: Sequence[float],
        series: Series | None = None,
    ) -> Decoder: ...
    def angles(self, sine: _Array, cosine: _Array) -> _Array: ...
    def off(self, sine: _Array, cosine: _Array) -> tuple[list[float], int | None]: ...
    @property
    def step(self) -> Callable[..., float]: ...

def channel_faults(
    sine: _Array, cosine: _Array
) -> tuple[NDArray[np.uint8], list[float | None], list[float] | None]: ...
def demodulate(
    excitation: _Array, sine: _Array, cosine: _Array, phase: float | None = None
) -> tuple[NDArray[np.uint64], _Array, _Array, float] | None: ...
def fit_curve(
    sine: _Array,
    cosine: _Array,
    weights: _Array,
    variances: Sequence[float],
    orders: Sequence[int],
    start: tuple[list[int], list[float]] | None = None,
) -> tuple[_Array, _Array, _Array, _Array, _Array] | None: ...
def curve_slopes(orders: Sequence[int], parameters: Sequence[float], phases: _Array) -> _Array: ...

@final
class RunEffect:
    """An error whose size is drawn anew in every run (random effect).

    Coefficients of its columns, shape (n, k), are independent from run to run, of variance
    ``ratio`` times that of one reading.
    """

    def __new__(cls, columns: _Array, ratio: float = 1.0) -> RunEffect: ...
    @property
    def columns(self) -> _Array: ...
    @property
    def ratio(self) -> float: ...

@final
class Whitener:
    """Linear map that makes the noise of every reading independent and equal.

    Within a run the noise is ``n + Σ_k Z_k u_k`` with n of first-order correlation rho and run
    effects u: the map is ``(I + A Aᵀ)^(-1/2) F``, F the filter ``x_t - ρ x_{t-1}`` and
    ``A = F Z √(ratio)``. `log_determinant` is -2 ln|map|, to be added to the log-likelihood's
    ``n ln RSS``.
    """

    def __new__(
        cls,
        bounds: Sequence[tuple[int, int]],
        rho: float = 0.0,
        effects: Sequence[RunEffect] | None = None,
        weights: _Array | None = None,
    ) -> Whitener: ...
    @property
    def bounds(self) -> list[tuple[int, int]]: ...
    @property
    def effects(self) -> tuple[RunEffect, ...]: ...
    @property
    def weights(self) -> _Array | None: ...
    @property
    def root_weights(self) -> _Array | None: ...
    @property
    def rho(self) -> float: ...
    @property
    def log_determinant(self) -> float: ...
    @property
    def is_identity(self) -> bool: ...
    def log_determinant_of(self, run: int) -> float: ...
    def has(self, rho: float, effects: Sequence[RunEffect], weights: _Array | None) -> bool: ...
    def __call__(self, x: _Array) -> _Array: ...
    def run_part(self, residual: _Array, chosen: Sequence[bool] | None = None) -> _Array: ...
    def taken(self) -> tuple[_Array, _Array]: ...
    def beside(self, q: _Array, r: _Array, squares: float, excited: float) -> Beside: ...

@final
class LagCorrelation:
    """Correlation between neighbours within runs, after drift is taken out.

    At least 0, and 0 below 0.05 or within four standard errors of it, so that white noise stays
    exactly white.
    """

    def __new__(cls, clock: _Array, bounds: Sequence[tuple[int, int]]) -> LagCorrelation: ...
    def __call__(self, residual: _Array) -> float: ...

@final
class Factor:
    """Columns X under a noise: ``Q = M X B`` with orthonormal columns; nobody changes them."""

    def __new__(cls, whiten: Whitener, design: _Array) -> Factor: ...
    @property
    def whiten(self) -> Whitener: ...
    @property
    def design(self) -> _Array: ...
    @property
    def rank(self) -> int: ...
    @property
    def back(self) -> _Array: ...
    @property
    def q(self) -> _Array: ...
    def coefficients(self, target: _Array) -> _Array: ...
    def project(self, target: _Array) -> tuple[_Array, _Array, float]: ...
    def without(
        self,
        held: Sequence[int],
        readings: _Array,
        roots: _Array,
        rounding: float,
        neighbours: LagCorrelation,
    ) -> _Array: ...

def settled(
    design: _Array,
    readings: _Array,
    roots: _Array,
    rounding: float,
    neighbours: LagCorrelation,
    whiten: Whitener,
    rho: float | None,
    before: Sequence[Factor],
) -> tuple[list[Factor], tuple[_Array, _Array, float], _Array, NDArray[np.bool_]]: ...
def short_stretches(
    flags: NDArray[np.bool_], bounds: Sequence[tuple[int, int]]
) -> NDArray[np.bool_]: ...

@final
class Beside:
    """A fit as columns see it that are not whitened."""

    @property
    def seen(self) -> _Array: ...
    def gain(self, columns: NDArray[np.float64]) -> tuple[float, _Array]: ...
    def powers(self, columns: NDArray[np.float64]) -> tuple[_Array, _Array, _Array]: ...
    def bump(
        self, phase: NDArray[np.float64], place: float, width: float, widest: float
    ) -> tuple[float, float]: ...
    def ratio(self, columns: NDArray[np.float64]) -> tuple[float, float]: ...
    def line(
        self, angles: _Array, low: float, high: float, steps: int, vanishing: float
    ) -> tuple[float, float]: ...

def clipped(
    readings: NDArray[np.float64],
    left: NDArray[np.float64],
    roots: NDArray[np.float64],
    most: float,
    least: float = 0.0,
) -> tuple[_Array, _Array, NDArray[np.bool_]]: ...
def rounded(
    left: NDArray[np.float64], step: float, sigma: float
) -> tuple[_Array, float, float]: ...
def rounded_drawn(
    left: NDArray[np.float64], step: float, sigma: float, shares: NDArray[np.float64]
) -> _Array: ...
def median(values: NDArray[np.float64]) -> float: ...
def block_products(
    columns: NDArray[Any],
    width: int,
    bounds: Sequence[tuple[int, int]],
    roots: NDArray[np.float64] | None = None,
) -> tuple[_Array, _Array, _Array]: ...
def two_normals(
    values: NDArray[np.float64], start: float, steps: int, narrowest: float
) -> tuple[float, float, float, float]: ...
def left_out(
    grams: NDArray[np.float64],
    moments: NDArray[np.float64],
    squares: Sequence[float],
    ridge: float = 0.0,
) -> tuple[_Array, _Array]: ...
def cluster_covariance(
    grams: NDArray[np.float64], scores: NDArray[np.float64], penalty: float = 0.0
) -> tuple[_Array, _Array]: ...
def ridge_path(
    folds: Sequence[tuple[NDArray[np.float64], float]],
    own_zeros: bool,
    penalties: Sequence[float],
) -> tuple[_Array, _Array]: ...

@final
class Solution:
    @property
    def offsets(self) -> _Array: ...
    @property
    def offset_std(self) -> _Array: ...
    @property
    def constant(self) -> float: ...
    @property
    def cosine(self) -> list[list[float]]: ...
    @property
    def sine(self) -> list[list[float]]: ...
    @property
    def covariance(self) -> _Array: ...
    @property
    def residual_variance(self) -> float: ...
    @property
    def residual_bound(self) -> float: ...
    @property
    def degrees_of_freedom(self) -> float: ...
    @property
    def rank(self) -> int: ...
    @property
    def condition_number(self) -> float: ...
    @property
    def method(self) -> Literal["plain", "moments", "qr", "counts"]: ...
    def penalised(self, ridge: Sequence[float]) -> Solution: ...
    def is_conditioned_below(self, limit: float) -> bool: ...
    def series(self) -> Series: ...

def fit(
    runs: Sequence[tuple[_Array, _Array, _Array | None]],
    period: float,
    cycles: Sequence[float],
    orders: Sequence[Sequence[int]],
    argument: str = "reference",
    method: str | None = None,
    ridge: Sequence[float] | None = None,
    threads: int | None = None,
    watch: bool = False,
) -> Solution: ...
def band(
    theta: _Array,
    period: float,
    cycles: Sequence[float],
    orders: Sequence[Sequence[int]],
    covariance: _Array,
) -> _Array: ...
def harmonic_rows(
    theta: NDArray[np.float64],
    orders: Sequence[int],
    out: NDArray[np.float64],
    factor: NDArray[np.float64] | None = None,
    lead: NDArray[np.float64] | None = None,
) -> None: ...
def harmonic_sum(
    theta: NDArray[np.float64],
    orders: Sequence[int],
    coefficients: NDArray[np.float64],
    out: NDArray[np.float64],
    factor: NDArray[np.float64] | None = None,
    lead: NDArray[np.float64] | None = None,
) -> None: ...
def resultant(
    indicated: NDArray[np.float64], reference: NDArray[np.float64], period: float
) -> float: ...
def following(
    indicated: NDArray[np.float64],
    reference: NDArray[np.float64],
    period: float,
    stride: int,
    long: float,
) -> tuple[float, int, float, float, float, float, float]: ...
def triangle(
    run: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None],
    period: float,
    cycles: Sequence[float],
    orders: Sequence[Sequence[int]],
    argument: str,
    zero: float,
    threads: int | None = None,
) -> NDArray[np.float64]: ...
def folds(
    run: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None],
    period: float,
    cycles: Sequence[float],
    orders: Sequence[Sequence[int]],
    argument: str,
    ends: Sequence[float],
    zero: float,
    threads: int | None = None,
) -> list[tuple[NDArray[np.float64], float]]: ...
def scan_residuals(
    series: Series,
    run: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None],
    argument: str,
    offset: float,
    stride: int,
    threads: int | None = None,
) -> tuple[NDArray[np.float64], float]: ...
def sample_residuals(
    series: Series,
    run: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None],
    argument: str,
    offset: float,
    stride: int,
    threads: int | None = None,
) -> NDArray[np.float64]: ...
def median_magnitude(values: NDArray[np.float64], most: int) -> float: ...
def outliers(
    error: NDArray[np.float64],
    angle: NDArray[np.float64],
    indicated: NDArray[np.float64],
    period: float,
    *,
    wild: float,
    share: float,
    fewest: int,
    sample: int,
) -> list[tuple[int, float]]: ...
def sensor_count(
    error: NDArray[np.float64], indicated: NDArray[np.float64], period: float
) -> float: ...
def residuals(
    indicated: NDArray[np.float64],
    reference: NDArray[np.float64],
    offset: float,
    period: float,
    fitted: NDArray[np.float64],
) -> None: ...
@overload
def line_columns(
    theta: NDArray[np.float64],
    orders: NDArray[np.float64],
    single: Literal[False] = False,
    vanishing: float = 0.0,
) -> NDArray[np.float64]: ...
@overload
def line_columns(
    theta: NDArray[np.float64],
    orders: NDArray[np.float64],
    single: Literal[True],
    vanishing: float = 0.0,
) -> NDArray[np.float32]: ...
def lagged(
    waves: NDArray[np.float64],
    frequency: NDArray[np.float64],
    cutoff: float,
    damping: float | None = None,
) -> _Array: ...
def line_sum(
    theta: NDArray[np.float64],
    orders: NDArray[np.float64],
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def line_sum_and_slope(
    theta: NDArray[np.float64],
    orders: NDArray[np.float64],
    cosine: NDArray[np.float64],
    sine: NDArray[np.float64],
) -> NDArray[np.float64]: ...
def unit_sums(
    theta: NDArray[np.float64],
    values: NDArray[np.float64],
    starts: Sequence[int],
    first: float,
    step: float,
    count: int,
) -> NDArray[np.float64]: ...
def add_relative_power(
    power: NDArray[np.float64],
    cuts: NDArray[np.int64],
    boxes: Sequence[tuple[int, float]],
    totals: NDArray[np.float64],
) -> None: ...
def covered_span(
    angles: Sequence[NDArray[np.float64]], period: float, most: int
) -> tuple[float, float, bool]: ...

@final
class Moments:
    def __new__(
        cls, period: float, cycles: Sequence[float], orders: Sequence[Sequence[int]]
    ) -> Moments: ...
    @property
    def cycles(self) -> float: ...
    @property
    def count(self) -> int: ...
    def update(
        self,
        theta: _Array,
        error: _Array,
        weights: _Array | None = None,
        threads: int | None = None,
    ) -> None: ...
    def update_known(
        self,
        reference: _Array,
        indicated: _Array,
        of_indicated: bool,
    ) -> int: ...
    def copy(self) -> Moments: ...
    def merge(self, other: Moments) -> None: ...
    def scale(self, factor: float) -> None: ...
    def subtract(self, other: Moments) -> None: ...
    def extremes(self) -> _Array: ...
    def spectrum(
        self, highest: int | None = None
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], float, int, float]: ...
    def store(self) -> _Array | None: ...
    def restore(self, numbers: _Array) -> None: ...

def fit_moments(
    runs: Sequence[Moments],
    period: float,
    cycles: Sequence[float],
    orders: Sequence[Sequence[int]],
) -> Solution: ...
def thread_count(threads: int | None = None) -> int: ...
def table_correction(
    method: str,
    knots: NDArray[np.int16] | NDArray[np.int32] | NDArray[np.float32],
    bits: int,
    shift: int,
    angles: NDArray[np.uint32],
) -> NDArray[np.int32] | NDArray[np.float32]: ...
def table_source(method: str) -> str: ...

@final
class ClosedWindow:
    @property
    def reading(self) -> int: ...
    @property
    def window(self) -> int: ...
    @property
    def readings(self) -> float: ...
    @property
    def coefficients(self) -> list[float]: ...
    @property
    def statistics(self) -> list[float]: ...
    @property
    def moved(self) -> list[tuple[int, float, float, float]]: ...
    @property
    def unlike(self) -> list[tuple[int, float, float, float]]: ...

@final
class Monitor:
    """A running joint against its model."""

    BASELINE: int

    def __new__(
        cls,
        period: float,
        orders: Sequence[int],
        cosine: Sequence[float],
        sine: Sequence[float],
        known: Sequence[float],
        every: float,
        limits: tuple[float, float, float, float],
    ) -> Monitor: ...
    def update(self, angle: _Array, error: _Array, alarms: bool) -> list[ClosedWindow]: ...
    @property
    def windows(self) -> int: ...
    @property
    def bytes(self) -> int: ...
    @property
    def state(self) -> list[list[float]]: ...
