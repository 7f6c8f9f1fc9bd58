"""Clampings of two encoders, or of an encoder and a polygon: readings, shifts, facets."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from ..errors import NoModelError
from ..support.angles import wrap
from ..support.arrays import Array
from .recording import Recording

#: Shifts that differ by less (radians) are one shift.
_APART: Final = math.radians(0.5)

#: Readings of a polygon stand within this share of the pitch of its facets.
_ON_FACET: Final = 0.1
_MOST_FACETS: Final = 720


@dataclass(frozen=True)
class Clampings:
    """Readings of all mounts, radians: joint, other scale, shift of each run."""

    joint: list[Array]
    other: list[Array]
    shift: Array
    facets: int  # 0 for an encoder
    notes: tuple[str, ...]


def clampings_of(recordings: Sequence[Recording]) -> Clampings:
    """Readings on both scales, one run a clamping.

    Raises
    ------
    NoModelError
        One reading only, or clampings that are all at one shift.
    """
    first = recordings[0]
    for r in recordings:
        if r.indicated is None or r.reference is None:
            raise NoModelError(
                f"{r.named}: two readings are needed, indicated_deg and reference_deg (the other "
                "encoder, or the polygon's nominal angles)"
            )
    if len(recordings) < 2:
        raise NoModelError(
            f"{first.named}: one clamping shows the sum of both patterns only; record at least two "
            "(three are better), each as a run of its own with its shift_deg"
        )
    joint = [np.asarray(r.indicated) for r in recordings]
    other = [np.asarray(r.reference) for r in recordings]
    told = [r.shift if r.shift is not None else r.mount for r in recordings]
    gap = np.array(
        [float(np.angle(np.exp(1j * (b - a)).mean())) for a, b in zip(joint, other, strict=True)]
    )
    gap = np.asarray(wrap(gap - gap[0]))
    notes: list[str] = []
    if any(t is None for t in told):
        shift = gap
        if np.abs(wrap(gap)).max() < _APART:
            raise NoModelError(
                f"{first.named}: all clampings are at one angle, which shows the sum of both "
                "patterns only; turn one of the two between runs and record by how much (shift_deg)"
            )
        notes.append("the shifts are estimated from the mean differences of the two readings")
        return Clampings(joint, other, shift, _facets(other), tuple(notes))
    given = np.array([float(np.angle(np.exp(1j * np.asarray(t)).mean())) for t in told])
    given = np.asarray(wrap(given - given[0]))
    if np.abs(given).max() < _APART and np.abs(gap).max() < _APART:
        raise NoModelError(
            f"{first.named}: all clampings have one shift, which shows the sum of both patterns "
            "only; turn one of the two between runs"
        )
    follows = min(float(np.abs(wrap(gap - s * given)).max()) for s in (1.0, -1.0))
    still = float(np.abs(gap).max())
    if still < follows:
        # Both readings were set to one zero at every clamping: the place on the other scale
        # is its reading and the shift.
        raw = np.array([float(np.asarray(t).mean()) for t in told])
        other = [b + s for b, s in zip(other, raw, strict=True)]
        shift = given
    else:
        shift = gap
        if follows > math.radians(2.0):
            notes.append(
                f"the readings' differences are off shift_deg by up to "
                f"{math.degrees(follows):.3g} deg: the differences are taken"
            )
    return Clampings(joint, other, shift, _facets(other), tuple(notes))


def _facets(other: Sequence[Array]) -> int:
    """Facets of a polygon: readings that stand at a few equal steps of the turn; else 0."""
    places = np.mod(np.concatenate(list(other)), 2.0 * math.pi)
    offset = float(np.angle(np.exp(1j * places[:1]).mean()))
    x = np.mod(places - offset, 2.0 * math.pi) / (2.0 * math.pi)
    steps = np.unique(np.round(x * 36_000.0) % 36_000)
    if steps.size > min(_MOST_FACETS, x.size // 2):
        return 0
    for n in range(max(2, steps.size), _MOST_FACETS + 1):
        if (
            float(np.abs(x * n - np.round(x * n)).max()) < _ON_FACET
            and np.unique(np.round(x * n) % n).size >= 0.8 * n
        ):
            return n
    return 0
