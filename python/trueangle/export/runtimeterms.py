"""Terms that a program computes at run time: the forms of a model, in turns.

A table holds what follows the angle; what follows travel, speed, heat and load is added up at
every reading, by the same forms as in the compiled core. With the table's inverse G of the series,

::

    x = G(goal - e(x)),    goal = raw - e₀

is solved by secants for the angle x that the encoder saw.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ..errors import ArgumentError
from ..model import forms
from ..model.forms import Form
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.terms import LocalDefect
from ..support.signals import coupled_joint

#: Sources of the direction of travel.
DIRECTIONS = ("auto", "angle", "velocity", "signal")


#: Power of two up to which signals are numbers: products of a few of them are finite floats.
_LARGEST = 40


class RunTimeWaves(NamedTuple):
    """Lines ``C sin(2 pi (m x + phase))`` of output orders m, all in turns."""

    orders: tuple[float, ...]
    amplitudes: tuple[float, ...]
    phases: tuple[float, ...]

    @classmethod
    def of(cls, lines: Sequence[tuple[float, float, float]]) -> RunTimeWaves:
        """Of ``(order, cosine, sine)``."""
        found = [
            (m, math.hypot(a, b), math.atan2(a, b) / (2.0 * math.pi) % 1.0)
            for m, a, b in lines
            if a or b
        ]
        return cls(*(tuple(row[i] for row in found) for i in range(3)))

    @property
    def whole(self) -> bool:
        """Whether one turn of the output holds them."""
        return all(order == int(order) for order in self.orders)

    @property
    def slope(self) -> float:
        """Bound of the slope."""
        pairs = zip(self.orders, self.amplitudes, strict=True)
        return 2.0 * math.pi * sum(abs(m) * c for m, c in pairs)


def is_own_signal(term: Term) -> bool:
    """Whether a term needs the joint's own signals only: a program has no angles of others."""
    return not any(coupled_joint(name) for name in term.needs)


@dataclass(frozen=True)
class RunTimeTerms:
    """Terms of a model in turns, velocities in turns per second.

    Attributes
    ----------
    kinds : tuple of str
        What they are, by name.
    signals : tuple of str
        Those they need, and the direction where it is requested.
    limits : dict of str to float
        Of the numbers among them, either way: a power of two at which the terms are below half a
        turn, or the range on record where that is larger. Signals beyond it are faults.
    way : str
        Source of the direction of travel: "angle", "velocity" or "direction"; empty where no
        term follows it.
    delay : float
        Seconds.
    play : float
    places : Waves
        How the play varies.
    springs : tuple of Friction
    smooth : tuple of Form
        The others.
    waves : tuple of Waves
        Lines of each of ``smooth``; those of a filter are the series.
    series : Waves
    """

    kinds: tuple[str, ...]
    signals: tuple[str, ...]
    limits: Mapping[str, float]
    way: str
    delay: float
    play: float
    places: RunTimeWaves
    springs: tuple[forms.Friction, ...]
    smooth: tuple[Form, ...]
    waves: tuple[RunTimeWaves, ...]
    series: RunTimeWaves

    @classmethod
    def of(cls, model: HarmonicModel, terms: Sequence[Term], direction: str) -> RunTimeTerms:
        """Of some of a model's terms.

        Raises
        ------
        ArgumentError
            The direction was to be taken from the angle, which does not determine it.
        """
        period = model.period
        lines = [
            (k * shaft.cycles_per_turn, a / period, b / period)
            for shaft in model.shafts
            for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True)
        ]
        delay, play, places = 0.0, 0.0, []
        springs: list[forms.Friction] = []
        smooth, waves = [], []
        for form in (form for term in terms for form in term.forms()):
            match form:
                case forms.Lag(seconds):
                    delay += seconds
                case forms.Play(half_width, own):
                    play += half_width / period
                    places += [(m, a / period, b / period) for m, a, b in own]
                case forms.Friction(amplitude, length, start):
                    springs.append(forms.Friction(amplitude / period, length / period, start))
                case _:
                    turned, summed = _in_turns(form, period, lines)
                    smooth.append(turned)
                    waves.append(RunTimeWaves.of(summed))
        needs = {signal for term in terms for signal in term.needs}
        travels = any(term.follows_travel for term in terms)
        way = _way(direction, needs, travels)
        if way == "velocity":
            needs.add("velocity")
        needs -= {"direction"}
        order = ("velocity", "temperature", "torque", "current")
        signals = [
            *(name for name in order if name in needs),
            *["direction"] * (way == "direction"),
        ]
        kinds = tuple(term.kind for term in terms if not isinstance(term, LocalDefect))
        recorded = {s: max(-low, high) for s, low, high in (model.fit.signals if model.fit else ())}
        limits = {
            name: max(
                _limit(name, delay, smooth, waves),
                recorded.get(name, 0.0) / (period if name == "velocity" else 1.0),
            )
            for name in signals
            if name != "direction"
        }
        return cls(
            kinds, tuple(signals), limits, way, delay, play, RunTimeWaves.of(places),
            tuple(springs), tuple(smooth), tuple(waves), RunTimeWaves.of(lines),
        )  # fmt: skip

    @property
    def travels(self) -> bool:
        """Whether there is a state."""
        return bool(self.way)

    @property
    def whole(self) -> bool:
        """Whether the terms are periodic in one turn of the output."""
        ramps = any(isinstance(form, forms.Ramp) for form in self.smooth)
        return not ramps and all(w.whole for w in (*self.waves, self.places))

    @property
    def shaped(self) -> bool:
        """Whether some term depends on the angle, so that a search is needed."""
        return bool(self.springs or self.places.orders) or any(
            bool(w.orders) or _is_shaped(form)
            for form, w in zip(self.smooth, self.waves, strict=True)
        )

    def use(self, function: str, state: str, fresh: str) -> str:
        """A line on how it is called."""
        told = {
            "angle": "The direction of travel is taken from the angle itself.",
            "velocity": "The direction of travel is the sign of the velocity.",
            "direction": "The direction of travel is a signal: 1, -1, or 0 as before.",
        }
        way = told.get(self.way, "They need no past.")
        return (
            f"With {', '.join(self.kinds)}: {function}({state}, raw, &signals), or "
            f"{function}_unwrapped({state}, turns, raw, &signals), of every reading in the order "
            f"they are taken; the state is {fresh} before the first. {way} In float: 2^-20 of "
            "their sum and 4 units of 2^-32 turns at most. A signal that is no number or beyond "
            "its limit counts as its last good value, 0 before the first."
        )

    def steepness(self, ranges: Mapping[str, tuple[float, float]]) -> float:
        """Bound of the slope over ranges of the signals (velocities in turns per second)."""
        total = self.places.slope
        total += sum(2.0 * abs(s.amplitude) / s.length for s in self.springs)
        for form, waves in zip(self.smooth, self.waves, strict=True):
            match form:
                case forms.Scaled():
                    low, high = ranges.get(form.signal, (0.0, 0.0))
                    most = max(abs(low - form.origin), abs(high - form.origin))
                    total += most * waves.slope
                case forms.Spring() if form.gravity is not None:
                    m = max(map(abs, ranges.get(form.signal, (0.0, 0.0))))
                    rate = abs(form.linear) + 3.0 * abs(form.cubic) * m * m + abs(form.beyond)
                    total += 2.0 * math.pi * rate * m
                case forms.Filter(_, damping):
                    gain = 1.0
                    if damping is not None and damping < math.sqrt(0.5):
                        gain = 0.5 / (damping * math.sqrt(1.0 - damping * damping))
                    total += (1.0 + gain) * waves.slope
                case forms.Bump():
                    total += abs(form.height / form.width * form.cycles) * math.exp(-0.5)
                case forms.Ramp():
                    total += abs(form.slope)
        return total

    def rounding(self, largest: float) -> float:
        """Turns that float arithmetic adds to terms of a sum of ``largest`` turns, at most."""
        # Units of 2^-32 turns by which rounding moves an angle, and the share of its sum by which
        # float arithmetic changes an error: a sine and some ten products and sums.
        return 4.0 / 2.0**32 + (2.0**-20) * largest


def _way(direction: str, needs: set[str], travels: bool) -> str:
    if not travels:
        return ""
    if direction == "auto":
        direction = "velocity" if needs & {"velocity", "direction"} else "angle"
    if direction == "angle" and "direction" in needs:
        raise ArgumentError(
            "`direction='angle'`: play that is negative somewhere does not show in the angle; use "
            '`direction="velocity"` or "signal"'
        )
    return "direction" if direction == "signal" else direction


def _limit(
    signal: str, delay: float, smooth: Sequence[Form], waves: Sequence[RunTimeWaves]
) -> float:
    """Power of two at which the terms of a signal are below half a turn."""

    def size(value: float) -> float:
        total = abs(delay) * value if signal == "velocity" else 0.0
        for form, lines in zip(smooth, waves, strict=True):
            match form:
                case forms.Scaled() if form.signal == signal:
                    slope = abs(form.level) + sum(lines.amplitudes)
                    total += slope * (value + abs(form.origin))
                case forms.Spring() if form.signal == signal:
                    linear = abs(form.linear) + abs(form.beyond)
                    total += linear * value + abs(form.cubic) * value**3
        return total

    return next((2.0**k for k in range(_LARGEST, -_LARGEST, -1) if size(2.0**k) < 0.5), 0.0)


def _is_shaped(form: Form) -> bool:
    if isinstance(form, forms.Spring):
        return form.gravity is not None
    return isinstance(form, forms.Bump | forms.Ramp)


def _in_turns(
    form: Form, period: float, series: Sequence[tuple[float, float, float]]
) -> tuple[Form, Sequence[tuple[float, float, float]]]:
    """A form with angles in turns, and its lines."""

    def unit(signal: str) -> float:
        return period if signal == "velocity" else 1.0

    match form:
        case forms.Scaled():
            c = unit(form.signal)
            lines = [(m, a * c / period, b * c / period) for m, a, b in form.lines]
            lines += [(m, form.relative * c * a, form.relative * c * b) for m, a, b in series]
            return form._replace(
                level=form.level * c / period, lines=(), relative=0.0, origin=form.origin / c
            ), lines
        case forms.Spring():
            c = unit(form.signal)
            gravity = None if form.gravity is None else form.gravity / period
            return form._replace(
                linear=form.linear * c / period,
                cubic=form.cubic * c**3 / period,
                beyond=form.beyond * c / period,
                knee=form.knee / c,
                gravity=gravity,
            ), []
        case forms.Filter():
            return form, series
        case forms.Bump():
            return form._replace(
                place=form.place / period,
                width=form.width / period,
                height=form.height / period,
            ), []
        case forms.Ramp():
            return form._replace(start=form.start / period, stop=form.stop / period), []
    raise AssertionError(f"a form without code: {type(form).__name__}")
