"""What searches have worked out, kept: thrown away, it is worked out again, to the same figures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias, TypeVar

from .extension import Extension

T = TypeVar("T")

#: Numbers of the fits that are kept: 32 MiB, some twenty fits of 5000 readings, one of many.
MOST_KEPT = 2**22

#: A cause, and the terms in addition to which it was proposed.
ProposalKey: TypeAlias = "tuple[str, tuple[tuple[str, str], ...]]"


class CachedProposal(NamedTuple):
    """What a cause proposed in addition to some terms, searched as far as ``least`` required."""

    extension: Extension | None
    least: float


class Cache:
    """Results by what they depend on: the motion, the readings, or one fit of them.

    Regressions of the same readings share one for the motion, the proposals and the latest fits;
    each has its own results.
    """

    def __init__(
        self,
        motion: dict[str, tuple[object, Any]] | None = None,
        proposals: dict[ProposalKey, CachedProposal] | None = None,
        fits: dict[object, tuple[Any, int]] | None = None,
    ) -> None:
        self._motion = {} if motion is None else motion
        self._proposals = {} if proposals is None else proposals
        self._fits = {} if fits is None else fits
        self._answers: dict[object, Any] = {}

    def of_motion(self, name: str, key: object, build: Callable[[], T]) -> T:
        """What follows from the motion alone; of every name the one of the last key is kept."""
        kept = self._motion.get(name)
        if kept is None or kept[0] != key:
            kept = self._motion[name] = (key, build())
        made: T = kept[1]
        return made

    def of_fit(self, key: object, build: Callable[[], T]) -> T:
        """What follows from one fit."""
        if key not in self._answers:
            self._answers[key] = build()
        answer: T = self._answers[key]
        return answer

    def fit(self, key: object, build: Callable[[], tuple[T, int]]) -> T:
        """A fit of the same readings and its size; some of the latest are kept.

        It must not hold this cache: what holds itself is not let go of.
        """
        kept = self._fits.pop(key) if key in self._fits else build()
        self._fits[key] = kept  # the last one now
        excess = sum(size for _, size in self._fits.values()) - MOST_KEPT
        for old in list(self._fits):
            if excess <= 0:
                break
            excess -= self._fits.pop(old)[1]
        found: T = kept[0]
        return found

    def proposed(self, key: ProposalKey, least: float) -> CachedProposal | None:
        """A proposal that was searched at least as far as ``least`` requires."""
        kept = self._proposals.get(key)
        return kept if kept is not None and kept.least <= least else None

    def propose(self, key: ProposalKey, proposal: CachedProposal) -> CachedProposal:
        """Keep a proposal."""
        self._proposals[key] = proposal
        return proposal

    def for_other_terms(self) -> Cache:
        """That of the same readings with other terms."""
        return Cache(self._motion, self._proposals, self._fits)

    def for_other_errors(self) -> Cache:
        """That of other errors along the same motion."""
        return Cache(self._motion)
