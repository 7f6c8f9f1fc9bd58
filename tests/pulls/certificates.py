"""Certificates: the combined standard uncertainty of each position, as its freedom has it.

The share of positions inside of U is kept beside (`tests/python/certificate`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from asked import Case, Pull, Told, generator, scored
from certificate.joints import RIGS, Rig, judged


def rig(rig: Rig) -> Case:
    """Joints of one rig."""

    def case(seed: int) -> Told:
        for away, row in zip(
            *judged(rig, int(generator(seed, rig.name).integers(2**31))), strict=True
        ):
            freedom = row["degrees_of_freedom"]
            pull = float(away) / row["standard_arcsec"]
            yield Pull("positions", scored(pull, math.inf if freedom is None else freedom))

    return case


def cases() -> Mapping[str, Case]:
    """Every rig."""
    return {each.name: rig(each) for each in RIGS}
