"""Functions of a program that decode one track of two channels, or two tracks."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np

from ..errors import ArgumentError
from ..runs.rawchannels import Channels
from .codetext import filled_code, float_literal

#: Periods that harmonics may move the choice of one, which is wrong from 0.5 on.
_MOST: Final = 0.25


def decoding(
    channels: Channels, parts: Mapping[str, str], turn: float, named: Callable[[str], str]
) -> str:
    """The functions, from ``decode`` and ``tracks`` of ``parts``; a turn is ``turn``.

    ``named`` makes the name of each: of the one that takes all readings from "decode". Of two
    tracks ``lift`` makes the sum that is rounded positive, by a multiple of the first periods.
    """
    if channels.second is None:
        return _of_one(channels, parts["decode"], turn, named("decode"))
    first, second = channels, channels.second
    p, q = first.periods_per_turn, second.periods_per_turn
    names = {"one": named("first_decode"), "two": named("second_decode")}
    tracks = filled_code(
        parts["tracks"],
        decode=named("decode"),
        **names,
        product=p * q,
        lift=p * (3 + q // p) * 2**32 + 2**31 - round(p * first.second_zero_deg / 360.0 * 2**32),
        first=p,
        half=p // 2,
        inverse=pow(q, -1, p),
    )
    each = zip((first, second), names.values(), strict=True)
    return "\n".join([*(_of_one(track, parts["decode"], turn, n) for track, n in each), tracks])


def _of_one(channels: Channels, part: str, turn: float, name: str) -> str:
    *numbers, factor = channels.constants
    names = ("offset_cosine", "offset_sine", "per_cosine", "per_sine", "slope")
    values = dict(zip(names, numbers, strict=True), factor=factor / channels.period * turn)
    return filled_code(part, decode=name, **{n: float_literal(v, 17) for n, v in values.items()})


def check_choice(channels: Channels) -> None:
    """Check that a program, which decodes tracks without their harmonics, chooses their period.

    Raises
    ------
    ArgumentError
        Harmonics that take half of the margin and more.
    """
    if channels.second is None:
        return
    first, second = (float(np.abs(t.error_series()).sum()) for t in (channels, channels.second))
    p, q = channels.periods_per_turn, channels.second.periods_per_turn
    moved = (q * first + p * second) / (2.0 * math.pi)
    if moved > _MOST:
        raise ArgumentError(
            f"the harmonics of the two tracks move the choice of a period by up to {moved:.2g} "
            f"periods, and a program decodes without them: {_MOST:g} are allowed; calibrate the "
            f"first track alone, `periods_per_turn={p}`"
        )
