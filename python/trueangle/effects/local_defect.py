"""A bump at one place of a shaft."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.place import LocalDefectTerm
from ..support.angles import from_arcsec
from ..support.deadline import current_deadline
from .ambiguity import Ambiguity
from .argument_error import ArgumentShift
from .drawing import Drawing
from .effect import Effect, Reported
from .missing_order import MissingOrder
from .search import SAME_CORRELATION, Array, Fitted, tangent_covariance
from .sidebands import Sidebands

#: Places per turn of a shaft at which a defect is searched, and its widths in degrees.
PLACES = 1440
WIDTHS = (0.35, 0.7, 1.4, 2.8, 5.6, 11.0)

#: Degrees of its shaft beyond which a bump is not local: its Fourier series is then a few
#: low orders, which have causes of their own (order 7 falls to 1/e^2 at 16 deg).
WIDEST = 16.0

#: Widths from the place beyond which a bump is below the rounding of its height.
VANISHES = 9.0

#: Peaks of the quick search that are scored exactly.
PEAKS = 2

Waves: TypeAlias = NDArray[np.complex128]

#: Times that a bump whose top was clipped is refined at most, the deviance that is no gain, and its
#: height from which on a reading is one of its own.
MOST_ROUNDS, SETTLED = 6, 0.01
ON_BUMP = 0.1

#: Readings' worth of power that a bump must rest on.
LEAST_READINGS = 4.0

#: Travel (turns) from which on lines and bumps differ for certain: over less a bump can
#: imitate several lines at once.
WHOLE_TURN = 0.9


@dataclass(frozen=True)
class LocalDefect(Effect):
    """A bump at one place of a shaft: ``a e^(-(φ - c)²/2w²)``.

    Parameters
    ----------
    place_deg : float
        c, in degrees of that shaft.
    width_deg : float
        w (one standard deviation), in degrees of that shaft.
    height_arcsec : float
        a.
    shaft : str
    """

    place_deg: float
    width_deg: float
    height_arcsec: float
    shaft: str = "output"

    kind: ClassVar[str] = LocalDefectTerm.kind
    size_name: ClassVar[str] = "height_arcsec"
    sentence: ClassVar[str] = (
        "A damaged tooth, pole or graduation line: a bump at one place of one shaft, the same "
        "in every pass."
    )
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    measure: ClassVar[str] = "a second pass over the place in steps finer than the bump"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        MissingOrder: "free angles, finer than the bump",
    }
    located: ClassVar[bool] = True
    is_separate: ClassVar[bool] = True
    flexible_below: ClassVar[float] = WHOLE_TURN

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        phase = self._degrees(signals, around, self.shaft)
        return self.height_arcsec * self.bump(phase, self.place_deg, self.width_deg)

    @staticmethod
    def bump(phase: Array, place_deg: float, width_deg: float) -> Array:
        """The bump of height 1 at shaft angles ``phase`` (degrees)."""
        away = phase - place_deg
        away -= 360.0 * np.round(away / 360.0)
        away /= width_deg
        bump = np.zeros_like(away)
        near = np.flatnonzero(np.abs(away) < VANISHES)
        bump[near] = np.exp(-0.5 * away[near] ** 2)
        return bump

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        place = float(np.mod(of.signals.degrees[of.whole(0, len(of.signals))], 360.0))
        return cls(place, of.between(3.0, 8.0), size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        e = regression.target - regression.design @ regression.coefficients
        e = e - regression.whiten.run_part(e)
        joint = regression.around.joint
        log_grid = float(np.log(len(joint.shafts) * 360.0))
        best: Extension | None = None
        grid = regression.signals.grid
        for shaft, cycles in joint.shafts.items():
            if grid is not None and 2.0 * cycles > grid.positions:
                continue  # the readings are too few a turn of it to show a place
            reached: list[tuple[float, float]] = []
            for score, place, width in cls._search(regression, shaft, cycles, e):
                if current_deadline().over:
                    return best
                # From within a bump that was found the way leads there.
                if any(abs((place - c + 180.0) % 360.0 - 180.0) < w for c, w in reached):
                    continue
                shape: dict[str, Any] = {"shaft": shaft, "place_deg": place, "width_deg": width}
                if not (
                    regression.is_pruned(score / regression.variance, 3, log_grid)
                    or cls._is_beaten(regression, shape, log_grid)
                ):
                    shape = cls._refined(regression, shaft, place, width)
                    shape = cls._settled(regression, shape)
                    place, width = shape["place_deg"], shape["width_deg"]
                    reached.append((place, width))
                columns = cls.columns(regression.signals, regression.around, shape)
                power = columns[:, 0] ** 2
                # One or two readings are outliers, not a place of the joint.
                if power.sum() < LEAST_READINGS * power.max(initial=0.0):
                    continue
                extension = regression.propose(cls.kind, shape, columns, 3, log_grid)
                if best is None or extension.deviance > best.deviance:
                    best = extension
        return best

    @classmethod
    def _is_beaten(cls, regression: Regression, shape: dict[str, Any], log_grid: float) -> bool:
        """Something else explains more than a bump of that place and width can be refined to."""
        if regression.least <= 0.0:
            return False
        columns = cls.columns(regression.signals, regression.around, shape)
        return regression.is_dominated(float(regression.gains(columns)[0]), 3, log_grid)

    @staticmethod
    def _search(
        regression: Regression, shaft: str, cycles: float, e: Array
    ) -> list[tuple[float, float, float]]:
        def seen_by() -> tuple[NDArray[np.int64], list[Array]]:
            """The bin of every reading, and the power of a bump of each width at every place."""
            phase = np.mod(regression.signals.theta * (cycles / (2.0 * np.pi)), 1.0)
            bins = np.minimum((phase * PLACES).astype(np.int64), PLACES - 1)
            count = np.fft.rfft(np.bincount(bins, minlength=PLACES))
            return bins, [
                _circular(count, square) - _circular(count, window) ** 2 / regression.n
                for window, square in _windows()
            ]

        bins, powers = regression.cache.of_motion(f"{shaft} bins", None, seen_by)
        count = np.bincount(bins, minlength=PLACES)
        total = np.bincount(bins, weights=e, minlength=PLACES)
        sums = np.fft.rfft(total - count * (total.sum() / regression.n))
        found = []
        for width, (window, _), power in zip(WIDTHS, _windows(), powers, strict=True):
            moment = _circular(sums, window)
            seen = power > 4.0
            score = np.where(seen, moment**2 / np.where(seen, power, 1.0), 0.0)
            k = int(np.argmax(score))
            found.append((float(score[k]), (k + 0.5) * 360.0 / PLACES, width))
        found.sort(reverse=True)
        return [peak for peak in found[:PEAKS] if peak[0] > 0.0]

    @classmethod
    def _refined(
        cls, regression: Regression, shaft: str, place: float, width: float
    ) -> dict[str, Any]:
        """Where a bump near some place saves most."""
        phase = cls._degrees(regression.signals, regression.around, shaft)
        place, width = regression.beside.bump(phase, place, width, WIDEST)
        return {"shaft": shaft, "place_deg": float(place % 360.0), "width_deg": float(width)}

    @classmethod
    def _settled(cls, regression: Regression, shape: dict[str, Any]) -> dict[str, Any]:
        """Refined again with a tall bump in the model, until that saves nothing more.

        Without it the clipping of outliers makes the bump look flat and wide, and
        the noise seems to be correlated over it. The readings on it are taken as they are,
        once; from then on outliers among them are distinguished from the bump.
        """
        best, least = shape, np.inf
        for k in range(MOST_ROUNDS):
            columns = cls.columns(regression.signals, regression.around, shape)
            on_bump = columns[:, 0] > ON_BUMP
            bump = regression.propose(cls.kind, shape, columns)
            full = regression.with_terms([*regression.terms, bump])
            if full.deviance > least - SETTLED:
                break
            best, least = shape, full.deviance
            is_clipped = regression.outlying[on_bump].any()
            correlated = abs(full.whiten.rho - regression.whiten.rho)
            if current_deadline().over or not (is_clipped or correlated > SAME_CORRELATION):
                break
            target = full.target if k else np.where(on_bump, full.residual, full.target)
            seen = regression.with_terms(regression.terms, full.whiten.rho).of_target(target)
            shape = cls._refined(seen, shape["shaft"], shape["place_deg"], shape["width_deg"])
        return best

    @classmethod
    def _tangents(cls, regression: Regression, shape: dict[str, Any], height: float) -> Array:
        """The bump and, for its ``height``, its derivatives by place and width."""
        step = 0.05 * shape["width_deg"]

        def bump(**change: float) -> Array:
            return cls.columns(regression.signals, regression.around, {**shape, **change})[:, 0]

        place, width = shape["place_deg"], shape["width_deg"]
        return np.column_stack(
            [
                bump(),
                height * (bump(place_deg=place + step) - bump(place_deg=place - step)) / (2 * step),
                height * (bump(width_deg=width + step) - bump(width_deg=width - step)) / (2 * step),
            ]
        )

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        phase = cls._degrees(signals, around, shape["shaft"])
        return cls.bump(phase, shape["place_deg"], shape["width_deg"])[:, None]

    @staticmethod
    def _degrees(signals: Signals, around: JointPattern, shaft: str) -> Array:
        """Angles of a shaft."""
        return np.degrees(signals.theta * around.joint.output_order(shaft, 1))

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension, (height,), _ = terms[0]
        shape = extension.shape
        # Place, width and height together.
        columns = cls._tangents(regression, shape, float(height))
        std = np.sqrt(np.diag(tangent_covariance(regression, terms[:1], columns)))
        place, width = shape["place_deg"], shape["width_deg"]
        parameters = {
            "place_deg": quantity(place, std[1]),
            "width_deg": quantity(width, std[2]),
            "height_arcsec": quantity(height, std[0]),
            "shaft": quantity(shape["shaft"]),
        }
        return parameters, [LocalDefect(place, width, float(height), shape["shaft"])]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        grid = regression.signals.grid
        if grid is None or grid.positions > 2.0 * regression.lines.orders.max():
            return
        gear = _gear_lines(regression.belief)
        folded = sorted({(grid.folded(m), m) for m in gear if grid.folded(m) != m})
        if not folded:
            return
        pairs = ", ".join(f"{m:g} as {low:g}" for low, m in folded[:8])
        spot = cls.blind(
            f"all readings lie on one uniform grid of {grid.positions} positions, where gear "
            f"orders look like low ones ({pairs}). A model of the aliases would hold at these "
            "positions and fail between them",
            MissingOrder,
            Sidebands,
            ArgumentShift,
            first=False,
            factor="grid",
        )
        yield replace(spot, measure=MissingOrder.measure)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        if self.shaft not in shafts:
            raise ArgumentError(f"{self.kind}: declare the ratio of shaft {self.shaft!r}")
        degree = period / 360.0
        return (
            LocalDefectTerm(
                self.place_deg * degree,
                self.width_deg * degree,
                from_arcsec(self.height_arcsec, period),
                shafts[self.shaft],
            ),
        )


@cache
def _windows() -> list[tuple[Waves, Waves]]:
    """Transforms of a bump of each width about the first place, and of its square."""
    away = np.arange(PLACES, dtype=np.float64) * (360.0 / PLACES)
    away = np.minimum(away, 360.0 - away)
    windows = [np.exp(-0.5 * (away / width) ** 2) for width in WIDTHS]
    return [(np.fft.rfft(window), np.fft.rfft(window**2)) for window in windows]


def _circular(x: Waves, window: Waves) -> Array:
    """Sum of values under a symmetric window put at every place of the turn, by transforms."""
    return np.asarray(np.fft.irfft(x * window, PLACES))


def _gear_lines(around: JointPattern) -> list[float]:
    joint = around.joint
    lines = {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    if "wave_generator" in joint.shafts:
        lines.add(joint.shafts["motor"] + joint.shafts["wave_generator"])
    return sorted(lines)
