"""Runs whose indicated angle is made of two channels, with constants by their reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import ArgumentError
from ..runs.channelangle import following
from ..runs.rawchannels import TRACKS
from ..runs.run import CalibrationRun
from ..support.arrays import Array


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
    from ..estimation.channels import referenced_channels  # few runs have channels

    first = given[0]
    kinds = {c and (c.direction, c.periods_per_turn, c.period) for c in given}
    if first is None or len(kinds) > 1:
        raise ArgumentError(
            "the runs have sine and cosine channels that differ in their sense, periods per turn "
            "or unit, or some have none: fit them apart"
        )
    signals = [(run.signals["sine"], run.signals["cosine"], run.reference) for run in runs]
    channels = referenced_channels(signals, first, _named(runs[0]))
    channels = channels.replace(excitation_deg=first.excitation_deg)
    if first.second is not None:
        others = [(run.signals["sine2"], run.signals["cosine2"], run.reference) for run in runs]
        named = f"{_named(runs[0])}, second track"
        second = referenced_channels(others, first.second, named)
        from ..estimation.tracks import joined

        channels = joined(channels, second, track_readings(runs), _named(runs[0]))
    return [
        replace(
            run,
            indicated=following(channels, sine, cosine, reference)[0],
            channels=channels,
        )
        for run, (sine, cosine, reference) in zip(runs, signals, strict=True)
    ]


def track_readings(runs: Sequence[CalibrationRun]) -> list[Array]:
    """Sine, cosine, sine2 and cosine2 of all runs."""
    return [np.concatenate([run.signals[role] for run in runs]) for role in TRACKS]


def _named(run: CalibrationRun) -> str:
    return run.source.file if run.source is not None and run.source.file else "the channels"
