"""A loop in torque: loading and unloading leave the gear at two angles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from .ambiguity import OWN_POWER, Ambiguity, share_left
from .backlash import Backlash
from .direction_dependent_pattern import DirectionalPattern
from .drawing import Drawing
from .effect import Effect, Reported
from .search import Array, Fitted, golden_maximum, is_of_one_sign, tangent_covariance
from .torsional_compliance import TorsionalCompliance, torque_of, unloaded

#: Torque in which the loop builds up, in shares of the largest torque: those searched.
SPANS = np.geomspace(0.02, 1.0, 8)

#: Elements of different spans at most, and the ratio by which trial spans keep apart from them.
MOST_ELEMENTS = 3
APART = 2.5

#: Of a span, for the derivative of a loop by it.
STEP = 0.02

#: Share of the largest torque by which it must come back to have turned: less is noise.
TURNED = 0.06


@dataclass(frozen=True)
class TorqueHysteresis(Effect):
    """Friction in the teeth in addition to the compliance: ``ε = h z(τ)``.

    ::

        z = σ - (σ - z₀) e^(-|τ - τ₀|/T)

    with ``σ`` the sign in which the torque changes and ``z₀`` the state at the
    torque ``τ₀`` where it last turned round (the loop of a gear's catalogue; Dahl).

    Parameters
    ----------
    half_width_arcsec : float
        h: half of the loop's width, loading less unloading.
    span_Nm : float
        T: change of torque in which the loop builds up.
    """

    half_width_arcsec: float
    span_Nm: float

    kind: ClassVar[str] = "torque_hysteresis"
    sentence: ClassVar[str] = (
        "Friction between teeth delays the wind-up: at one torque the gear has two "
        "angles, one for rising and one for falling load."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    form_of: ClassVar[tuple[str, ...]] = ("load", "load_sign")
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Backlash: "turn the torque round without turning the joint, or carry two loads",
        TorsionalCompliance: "load and unload at one place, to two values of one torque",
        DirectionalPattern: "two loads in both directions, or load and unload at one place",
    }
    measure: ClassVar[str] = (
        "load and unload in steps at one place, both signs, or move in both directions under "
        "two loads"
    )
    located: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = (
        "a corrector keeps no history of the torque; `simulate` reproduces it"
    )

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return self.half_width_arcsec * self.loop(signals, self.span_Nm)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        span = 0.0 if of.signals.torque is None else float(np.ptp(of.signals.torque))
        return cls(size, of.between(0.1, 0.3) * span) if span > 0.0 else None

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        torque = regression.signals.torque
        present = [t.shape["span_Nm"] for t in regression.terms if t.cause == cls.kind]
        if torque is None or not torque.any() or len(present) >= MOST_ELEMENTS:
            return None
        spans = SPANS * float(np.abs(torque).max())
        loops = regression.cache.of_motion(
            cls.kind,
            None,
            lambda: np.column_stack([cls.loop(regression.signals, float(s)) for s in spans]),
        )
        apart = [all(abs(np.log(s / p)) > np.log(APART) for p in present) for s in spans]
        gains = np.where(apart, regression.gains(loops), 0.0)
        k = int(np.argmax(gains))
        if gains[k] <= 0.0:
            return None
        span = float(spans[k])
        gain = float(gains[k])
        if not (regression.is_pruned(gain, 2) or regression.is_dominated(gain, 2)):
            step = float(np.log(SPANS[1] / SPANS[0]))
            log_span, _ = golden_maximum(
                lambda x: float(
                    regression.gains(cls.loop(regression.signals, float(np.exp(x)))[:, None])[0]
                ),
                np.log(span) - step,
                np.log(span) + step,
                8,
            )
            span = float(np.exp(log_span))
        shape = {"span_Nm": span}
        columns = cls.columns(regression.signals, regression.around, shape)
        extension = regression.propose(cls.kind, shape, columns, parameters=2)
        return extension if is_of_one_sign(regression, extension) else None

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        return cls.loop(signals, shape["span_Nm"])[:, None]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        widths = np.array([float(c[0]) for _, c, _ in terms])
        spans = np.array([t.shape["span_Nm"] for t, _, _ in terms])
        n, signals = len(terms), regression.signals
        loops = [cls.loop(signals, float(s)) for s in spans]
        slopes = [
            w * (cls.loop(signals, s * (1.0 + STEP)) - cls.loop(signals, s * (1.0 - STEP)))
            / (2.0 * STEP * s)
            for w, s in zip(widths.tolist(), spans.tolist(), strict=True)
        ]  # fmt: skip
        # Widths and spans together: a longer loop that is wider looks much the same.
        covariance = tangent_covariance(regression, terms, np.column_stack([*loops, *slopes]))
        weights = np.abs(widths) / np.abs(widths).sum()
        parameters = {
            "half_width_arcsec": quantity(
                float(widths.sum()), float(np.sqrt(covariance[:n, :n].sum()))
            ),
            "span_Nm": quantity(
                float(weights @ spans),
                float(np.sqrt(weights @ covariance[n:, n:] @ weights)),
            ),
        }
        if len(terms) > 1:
            parameters["element_spans_Nm"] = quantity(spans)
            parameters["element_half_widths_arcsec"] = quantity(widths)
        return parameters, [
            TorqueHysteresis(float(w), float(s)) for w, s in zip(widths, spans, strict=True)
        ]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        because = unloaded(signals)
        if because:
            yield cls.blind(because)
            return
        torque = torque_of(signals)[:, None]
        loop = cls.loop(signals, 0.2 * float(np.abs(torque).max()))[:, None]
        if not loop.any():
            yield cls.blind("no run loads and unloads the joint: no loop shows")
            return
        low = np.hstack([line_columns(signals.theta, k) for k in (1, 2, 3, 5)])
        if share_left(regression, loop, torque, signals.direction[:, None], low) < OWN_POWER:
            yield cls.blind(
                "the torque follows the angle: its loop looks like low orders and play",
                Backlash,
            )

    @staticmethod
    def loop(signals: Signals, span_Nm: float) -> Array:
        """State z in [-1, 1] of the loop, 0 at the start of every run."""
        history = _HISTORIES.get(signals)
        if history is None:
            history = _HISTORIES[signals] = _History.of(signals)
        return history.state(span_Nm)


@dataclass(frozen=True, eq=False)
class _History:
    """Branches of the torque between its turns, one after the other.

    Attributes
    ----------
    sign : ndarray, shape (branches,)
        Sign of change of the torque; 0 before the first turn.
    opens : ndarray of bool
        The branch is the first of its run.
    whole : ndarray
        Change of the torque over every branch, until it turned.
    branch : ndarray of int, shape (n,)
    gone : ndarray, shape (n,)
        Change of the torque since the branch began.
    """

    sign: Array
    opens: NDArray[np.bool_]
    whole: Array
    branch: NDArray[np.int64]
    gone: Array

    @classmethod
    def of(cls, signals: Signals) -> Self:
        torque = torque_of(signals)
        zone = TURNED * float(np.abs(torque).max(initial=0.0))
        bounds = signals.run_bounds()
        parts = [_branches(torque[start:stop], zone) for start, stop in bounds]
        sign, since = (np.concatenate(side) for side in zip(*parts, strict=True))
        begins = np.zeros(torque.size, dtype=bool)
        # A torque that rests first begins to change where it rested.
        begins[1:] = (np.diff(since) != 0.0) | (np.diff(sign) != 0.0)
        starts = np.array([start for start, _ in bounds])
        begins[starts] = True
        is_start = np.zeros(torque.size, dtype=bool)
        is_start[starts] = True
        first = np.flatnonzero(begins)
        return cls(
            sign[first],
            is_start[first],
            np.abs(np.diff(since[first], append=0.0)),
            np.cumsum(begins) - 1,
            np.abs(torque - since),
        )

    def state(self, span_Nm: float) -> Array:
        """State of the loop at every reading."""
        keeps, ends = (np.exp(-np.minimum(x / span_Nm, 700.0)) for x in (self.gone, self.whole))
        begun = np.zeros(self.sign.size)
        state = 0.0
        rows = zip(self.sign.tolist(), self.opens.tolist(), ends.tolist(), strict=True)
        for k, (sign, opens, keep) in enumerate(rows):
            begun[k] = state = 0.0 if opens else state
            state = sign - (sign - state) * keep
        return np.asarray(self.sign[self.branch] - (self.sign - begun)[self.branch] * keeps)


#: Branches of the torque of signals that somebody still holds: loops of every span share them.
_HISTORIES: WeakKeyDictionary[Signals, _History] = WeakKeyDictionary()


def _branches(torque: Array, zone: float) -> tuple[Array, Array]:
    """Sign of change of the torque at every reading, and the torque where that began."""
    sign, since = np.zeros(torque.size), np.full(torque.size, torque[0])
    way, extreme, at = 0.0, float(torque[0]), 0
    for k, value in enumerate(torque.tolist()):
        if way * (value - extreme) >= 0.0 and (way or value == extreme):
            extreme, at = value, k
        elif abs(value - extreme) > zone:
            # It turned where it was farthest.
            way = 1.0 if value > extreme else -1.0
            sign[at:], since[at:] = way, extreme
            extreme, at = value, k
    return sign, since
