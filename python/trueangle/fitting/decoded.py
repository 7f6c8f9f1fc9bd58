"""Runs whose indicated angle is made of two channels, with constants by their reference."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..errors import ArgumentError
from ..runs.channelangle import common_channels, following
from ..runs.run import CalibrationRun


def decoded(runs: Sequence[CalibrationRun]) -> list[CalibrationRun]:
    """Runs as they are; those of channels with the angle of constants that all of them share.

    Raises
    ------
    ArgumentError
        Some runs have channels and others have none, or other senses or periods.
    NoModelError
        Channels that are dead or one.
    """
    given = [run.channels for run in runs]
    if all(channels is None for channels in given):
        return list(runs)
    # Few runs have channels.
    from ..estimation.referencedchannels import referenced_channels

    first = given[0]
    kinds = {c and (c.direction, c.periods_per_turn, c.period) for c in given}
    if first is None or len(kinds) > 1:
        raise ArgumentError(
            "the runs have sine and cosine channels that differ in their sense, periods per turn "
            "or unit, or some have none: fit them apart"
        )
    signals = [(run.signals["sine"], run.signals["cosine"], run.reference) for run in runs]
    channels = referenced_channels(signals, first, _named(runs[0]))
    return [
        replace(
            run,
            indicated=following(channels, sine, cosine, reference)[0],
            channels=channels,
        )
        for run, (sine, cosine, reference) in zip(runs, signals, strict=True)
    ]


def channel_notes(runs: Sequence[CalibrationRun]) -> Iterator[str]:
    """What a reader must know about the channels of runs: clipped readings, a phase that falls."""
    if (channels := common_channels(runs)) is None:
        return
    from ..estimation.channels import clipped_rows

    for role in ("sine", "cosine"):
        values = np.concatenate([run.signals[role] for run in runs])
        if clipped := int(clipped_rows(values).sum()):
            yield (
                f"{clipped} of {values.size} readings of the {role} channel are at its rail "
                "(clipped): its constants are of the others; lower the gain of the amplifier."
            )
    if channels.direction < 0:
        yield (
            "The phase of the channels falls as the angle rises: sine and cosine are swapped, or "
            "the sensor is reversed; the model decodes them as they are."
        )


def _named(run: CalibrationRun) -> str:
    return run.source.file if run.source is not None and run.source.file else "the channels"
