"""What every effect is: parameters, a signal, a search and its finding, how it is corrected."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from ..errors import ArgumentError
from ..estimation.extension import Extension
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from .ambiguity import Ambiguity
from .departures import departure_columns
from .drawing import Drawing
from .parameters import TabledParameters
from .search import Array, Fitted

#: Every effect by its kind, in the order in which they are tried: a class joins by being
#: defined. Where two explain equally much the first is named.
EFFECTS: dict[str, type[Effect]] = {}

#: What a simulation can hold: every effect, and the curves that represent forms without a name.
KINDS: dict[str, type[Effect]] = {}

#: Turns of travel up to which a flexible cause can imitate others: any.
ALWAYS = math.inf

#: What a finding states: its parameters, and the effects that a simulation takes.
Reported: TypeAlias = "tuple[Parameters, list[Effect]]"
Spots: TypeAlias = Sequence[Ambiguity]


def title_of(kind: str) -> str:
    """What a first line calls a cause."""
    return (EFFECTS[kind].title if kind in EFFECTS else "") or kind.replace("_", " ")


class Effect(TabledParameters):
    """Base of the effects; each is a frozen dataclass whose fields are its parameters.

    A class with a ``kind`` joins the vocabulary by being defined. It must define its
    `signal`; with `propose`, `columns` and `report` a diagnosis looks for it, with a
    ``term`` (or lines) it is corrected, otherwise ``not_at_run_time`` states why not.

    Class attributes
    ----------------
    kind : str
        Its name in the vocabulary of causes.
    title : str
        What a first line calls it where its name in the vocabulary is not plain.
    sentence : str
        The physics in one sentence.
    needs : tuple of str
        Columns without which it cannot be detected: "time", "temperature", "torque", "mount".
    factor : str
        What has to take several values for it to show, and whose labels are shuffled in
        the negative control: "direction", "velocity", "temperature", "torque", "mount",
        "angle", "run", "time", "none".
    form_of : tuple of str
        Factors of an account without names that it is a form of; none for what has none.
    is_cause : bool
        It has a name, and a diagnosis looks for it.
    confused_with : mapping of Effect class to str
        Causes before it in the list that it can be confused with, each with the measurement
        that separates them.
    measure : str
        What to measure where the data cannot show it at all.
    contains : tuple of Effect classes
        Special cases of this one: once it is chosen they are not.
    transfers : bool
        Its model lowers the error of runs that were not used in the fit.
    located : bool
        Its search goes over a grid and is repeated inside the training part of a hold-out.
    acts_on_runs : bool
        A specific cause that acts on whole runs: direction, speed, load, temperature ...
    flexible_below : float
        Turns of travel up to which it can imitate specific causes, which are then tried
        first: `ALWAYS` for one that always can.
    is_separate : bool
        Each of its terms is a separate finding.
    draws_zeros : bool
        It gives each run its own zero; held-out runs then get one too.
    has_exact_form : bool
        Its form is exact, however large it is: steps of a zero, ratios of teeth.
    changes_lines : bool
        It takes or gives a part of the pattern's own lines on average.
    form_follows : bool
        Its form follows what else is fitted, and is proposed again when that has changed.
    is_doubted : bool
        A blind spot that names it is reason enough not to name it.
    weighs : bool
        A cause of the scatter that gives the readings weights.
    rounds : bool
        It is the rounding of readings; other causes of the scatter act before it.
    of_motion : bool
        Its columns follow from the shape and the motion alone, for any pattern.
    not_at_run_time : str
        Why no corrector can subtract it while the joint runs; empty where one can.
    size_name : str
        The parameter that is its size in a rehearsal; the first where not given.
    size_grows : bool
        It shows the more the larger that is; False where the less.
    size_most : float
        The largest size that has a meaning.
    """

    noun: ClassVar[str] = "the effect of a simulation"
    title: ClassVar[str] = ""
    sentence: ClassVar[str]
    needs: ClassVar[tuple[str, ...]] = ()
    factor: ClassVar[str] = "angle"
    form_of: ClassVar[tuple[str, ...]] = ()
    is_cause: ClassVar[bool] = True
    confused_with: ClassVar[Mapping[type[Effect], str]] = {}
    measure: ClassVar[str] = ""
    contains: ClassVar[tuple[type[Effect], ...]] = ()
    transfers: ClassVar[bool] = True
    located: ClassVar[bool] = False
    acts_on_runs: ClassVar[bool] = False
    flexible_below: ClassVar[float] = 0.0
    is_separate: ClassVar[bool] = False
    draws_zeros: ClassVar[bool] = False
    has_exact_form: ClassVar[bool] = False
    changes_lines: ClassVar[bool] = False
    form_follows: ClassVar[bool] = False
    is_doubted: ClassVar[bool] = True
    weighs: ClassVar[bool] = False
    rounds: ClassVar[bool] = False
    of_motion: ClassVar[bool] = False
    not_at_run_time: ClassVar[str] = ""
    size_name: ClassVar[str] = ""
    size_grows: ClassVar[bool] = True
    size_most: ClassVar[float] = math.inf

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if "kind" in cls.__dict__:
            KINDS[cls.kind] = cls
            if cls.is_cause:
                EFFECTS[cls.kind] = cls

    # -- simulate ------------------------------------------------------------------

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        """The effect's error at every reading, arcsec; random where its nature is random."""
        raise NotImplementedError

    def expected(self, signals: Signals, around: JointPattern) -> Array:
        """The part of `signal` that can be predicted: zeros for random effects."""
        if not self.transfers:
            return np.zeros(len(signals))
        return self.signal(signals, around, np.random.default_rng(0))

    def noise_factor(self, signals: Signals, around: JointPattern) -> Array | None:
        """Factor on the standard deviation of the noise, or None."""
        return None

    def written(self, degrees: Array) -> Array:
        """What is recorded of readings in degrees, all errors and the noise included."""
        return degrees

    # -- rehearse ------------------------------------------------------------------

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        """One of this size, all else random, to be hidden in these readings.

        None where these runs of this joint cannot have it. Here the first parameter is the size,
        and there is nothing else to draw.
        """
        return cls(size)  # type: ignore[call-arg]

    @classmethod
    def alike(cls, other: Effect, around: JointPattern) -> Self | None:
        """The same error from this cause, where one design cannot distinguish it from ``other``."""
        return None

    # -- diagnose ------------------------------------------------------------------

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        """The best extension by this cause beyond the fitted terms; None where it cannot act."""
        return None

    @classmethod
    def imitate(cls, regression: Regression) -> Extension | None:
        """What it would explain in the place of another cause, where it is not named itself.

        None where `propose` covers everything.
        """
        return None

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """Evidence of this cause in the scatter about what is known, or None."""
        return None

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        """Regressors of ``shape`` at other readings, shape (n, p); none of a random effect."""
        return np.zeros((len(signals), 0))

    @classmethod
    def form_columns(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        """Columns of its form, which is compared with free functions of its factors."""
        return np.hstack([term.columns for term, _ in terms])

    @classmethod
    def bends(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        """Columns of the departures of this cause's ``terms`` from its form.

        By its factor (`trueangle.effects.departures`); of one that has an exact form none.
        """
        signal = sum((t.columns @ c for t, c in terms if c.size), np.zeros(len(signals)))
        return departure_columns(signals, cls.factor, np.asarray(signal))

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        """Parameters of the finding and the effects to extend the simulation with.

        ``terms`` are this cause's terms with their coefficients and covariances. One of one size
        has that of its first field.
        """
        _, (size,), covariance = terms[0]
        name = fields(cls)[0].name  # type: ignore[arg-type]
        std = float(np.sqrt(covariance[0, 0]))
        return {name: quantity(size, std)}, [cls(float(size))]  # type: ignore[call-arg]

    @classmethod
    def form_limits(cls, regression: Regression, terms: Sequence[Fitted]) -> Parameters:
        """How far its error may depart from its form, as far as the readings show."""
        return {}

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        """What the design of the runs cannot show; the readings are not used.

        ``found`` are those of the effects before it in the list.
        """
        yield from ()

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        """Why this effect may be behind what another (or it) explains, or None."""
        return None

    @classmethod
    def describes_noise(cls, extension: Extension) -> bool:
        """Whether a term in this form only describes the noise, and is no cause."""
        return False

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether the readings show what the design alone does not promise to show."""
        return False

    @classmethod
    def beats(cls, rival: type[Effect], regression: Regression, by: float) -> bool:
        """Whether the terms explain more with this effect than with a rival in its place."""
        others = [t for t in regression.terms if t.cause not in (cls.kind, rival.kind)]
        rest = regression.with_terms(others, regression.whiten.rho)
        instead = rival.propose(rest)
        return instead is None or rest.bic - instead.bic_gain - regression.bic > by

    @classmethod
    def blind(
        cls,
        because: str,
        *others: type[Effect],
        first: bool = True,
        factor: str | None = None,
        common: type[Effect] | None = None,
    ) -> Ambiguity:
        """Blind spot of this effect, or of it and ``others`` which it is confused with.

        ``first=False`` names the others before it; ``factor`` is what in the design is at
        fault, where that is not the effect's own; ``common`` has the form that all share.
        """
        effects = (cls, *others) if first else (*others, cls)
        measure = cls.measure
        if others:
            measure = telling_apart(effects[0], effects[1]) or effects[0].measure
        causes = tuple(effect.kind for effect in effects)
        shared = "" if common is None else common.kind
        return Ambiguity(causes, because, measure, factor=factor or cls.factor, common=shared)

    # -- correct -------------------------------------------------------------------

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        """Terms of the correction in units of ``period``; none for lines.

        Raises
        ------
        ArgumentError
            The effect has no form that a corrector knows, and no reason why not.
        """
        if self.not_at_run_time or self.to_lines() or self.changes_argument:
            return ()
        raise ArgumentError(
            f"effect '{self.kind}' cannot be corrected: it has no term, and its class gives no "
            "reason (not_at_run_time)"
        )

    def over(self, start_deg: float, stop_deg: float) -> Self:
        """The effect with this travel, where its correction needs one and it has none."""
        return self

    def to_lines(self) -> Sequence[tuple[str, float]]:
        """(shaft, order) of the lines that a correction must include."""
        return ()

    @property
    def changes_argument(self) -> bool:
        """The pattern is one of the indicated angle."""
        return False


@dataclass(frozen=True)
class ScatterFinding:
    """A cause of the scatter with its evidence.

    Attributes
    ----------
    cause : str
    bic_gain : float
    parameters : dict
    effects : list of Effect
    weights : ndarray, shape (n,)
        Inverse variances, of mean 1 (uneven noise), or 0 for outliers.
    size : float
        Of the scatter, in standard deviations of one reading.
    blocks : tuple of str
        What uneven noise follows, of what its cause knows.
    rivals : tuple of (str, float)
        Other causes of the scatter in its place, and how much less each explains (BIC).
    alternatives : dict of str to Parameters
        What those would be.
    doubt : str
        Why it is not confirmed, with anything else there is.
    """

    cause: str
    bic_gain: float
    parameters: Parameters
    effects: list[Effect]
    weights: Array
    size: float = 1.0
    blocks: tuple[str, ...] = ()
    rivals: tuple[tuple[str, float], ...] = ()
    alternatives: Mapping[str, Parameters] = field(default_factory=dict)
    doubt: str = ""


def telling_apart(one: type[Effect], other: type[Effect]) -> str | None:
    """The measurement that separates two effects; declared by the later of them."""
    return one.confused_with.get(other) or other.confused_with.get(one)
