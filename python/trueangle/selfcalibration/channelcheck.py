"""Whether channels are fit to be used, before a model is written: faults in one line each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Unpack

import numpy as np

from ..errors import NoModelError
from ..estimation.channels import ChannelEstimate, estimate_channels
from ..estimation.tracks import Mismatch, with_second_track
from ..runs.checks.channelreadings import ChannelReadings
from ..runs.checks.fault import DataFault
from ..runs.rawchannels import Channels
from ..runs.source import OtherReadingOptions
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.layout import counted, laid_out, wrapped_lines
from ..support.plainresult import PlainResult, plain_fields
from .channelcauses import ChannelDiagnosis, channel_diagnosis
from .recording import Recording, as_recordings, track_readings


@dataclass(frozen=True)
class ChannelCheck(PlainResult):
    """Faults of two channels, and what their readings cover.

    Attributes
    ----------
    data_faults : tuple of DataFault
    readings, runs : int
    turns : float or None
        Travel, in periods of the channels.
    diagnosis : ChannelDiagnosis or None
        Causes of the angle error; None where the data are not usable.
    mismatch : Mismatch or None
        Of two tracks: how far the second is off choosing another period of the first.
    """

    data_faults: tuple[DataFault, ...]
    readings: int
    runs: int
    turns: float | None
    diagnosis: ChannelDiagnosis | None
    mismatch: Mismatch | None = None

    @property
    def usable(self) -> bool:
        """No fault forbids to use the data as they are."""
        return self.diagnosis is not None

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        keys = "data_faults usable readings runs turns diagnosis mismatch_periods=mismatch"
        return plain_fields(self, keys)

    def _brief(self) -> str:
        names = ", ".join(fault.fault for fault in self.data_faults) or "no fault"
        return f"{self.readings} readings of channels: {names}"

    def summary(self) -> str:
        """The check as text: faults first."""
        lines = []
        for fault in self.data_faults:
            lines += wrapped_lines(f"{fault.fault}: {fault.says}.", 2)
            lines += wrapped_lines(f"Remedy: {fault.mend}.", 4, 2)
        lines += [] if lines else ["No fault found in the data."]
        lines += ["", f"{self.readings} readings of two channels in {counted(self.runs, 'run')}"]
        if self.diagnosis is None:
            return laid_out([*lines, "The data must not be used as they are."])
        lines[-1] += (
            f", {self.turns:.3g} periods, {self.diagnosis.coverage_deg:.0f} deg of one covered."
        )
        if self.mismatch is not None:
            lines += wrapped_lines(f"{self.mismatch.says}.", 2)
        return laid_out([*lines, *self.diagnosis.lines()])


@told_kinds
def check_channels(logs: Any, **reading: Unpack[OtherReadingOptions]) -> ChannelCheck:
    """Check a sine and a cosine channel before anything is calibrated.

    Parameters
    ----------
    logs : path, table, or iterable of them
        With columns ``sine`` and ``cosine``.
    **reading
        As in `trueangle.read_runs`.

    Returns
    -------
    ChannelCheck
        Faults ``dead_channel``, ``wrapped_counter`` and ``short_arc`` (not usable), ``clipping``,
        ``dropouts``, ``no_centre``, ``swapped_channels``, ``resting``, ``partial_arc``; coverage
        and causes.

    Raises
    ------
    FileError, ArgumentError
        Files that cannot be read.

    Examples
    --------
    >>> phase = np.linspace(0.0, 2.0 * np.pi, 500)
    >>> log = {"sine": np.sin(phase), "cosine": np.ones(500)}
    >>> [fault.fault for fault in ta.check_channels(log).data_faults]
    ['dead_channel']
    """
    recordings = as_recordings(logs, {**reading, "period": None})
    readings = track_readings(recordings)
    sine, cosine = readings[:2]
    size, named, runs = sine.size, recordings[0].named, [r.label or "" for r in recordings]

    def refused(name: str, problem: str) -> ChannelCheck:
        says, _, mend = problem.rpartition(": ")
        fault = DataFault.of(name, runs, [], says, mend)
        return ChannelCheck((fault,), size, len(runs), None, None)

    if problem := ChannelReadings.of(sine, cosine).problem:
        name = "wrapped_counter" if "wraps" in problem else "dead_channel"
        return refused(name, problem)
    mismatch = None
    try:
        found = estimate_channels(sine, cosine, named, periods=recordings[0].periods)
        if (second := recordings[0].periods2) is not None:
            channels = with_second_track(found.channels, readings, second, named)
            mismatch = Mismatch.of(channels, readings)
    except NoModelError as error:
        return refused("short_arc", str(error).removeprefix(f"{named}: "))
    faults = channel_faults(found, recordings, sense(found.channels, recordings)[0])
    angles = [found.channels.unwrapped(*r.tracks[:2]) for r in recordings]
    period = found.channels.period / found.channels.periods_per_turn
    turns = sum(float(np.ptp(angle)) for angle in angles) / period
    diagnosis = channel_diagnosis(recordings, found)
    return ChannelCheck(tuple(faults), size, len(runs), turns, diagnosis, mismatch)


def channel_faults(
    found: ChannelEstimate, recordings: Sequence[Recording], agreement: float
) -> list[DataFault]:
    """Faults that do not forbid a fit; ``agreement`` is negative where the phase falls."""
    runs = [r.label or "" for r in recordings]
    faults = found.recorded.faults(runs, falls=agreement < 0.0)

    def add(name: str, says: str, mend: str) -> None:
        faults.append(DataFault.of(name, runs, [], says, mend))

    if found.rests:
        add(
            "resting",
            f"{counted(found.rests, 'reading')} at rest {'has' if found.rests == 1 else 'have'} "
            "less weight",
            "no action is needed: a place is known by the arc, not by the time",
        )
    if found.coverage < 355.0 and not found.recorded.clipped:
        add(
            "partial_arc",
            f"the readings cover {found.coverage:.0f} deg of the channels' period: outside it the "
            "correction is extrapolated, and harmonics are not estimated",
            "turn the shaft through a whole period",
        )
    return faults


def sense(channels: Channels, recordings: Sequence[Recording]) -> tuple[float, str]:
    """How far the phase agrees with another angle of the log less with its reverse, and which."""
    rising, by = 0.0, ""
    for recording in recordings:
        phase: Array = channels.angle(*recording.tracks[:2]) / channels.constants[-1]
        for name in ("reference", "indicated"):
            other = getattr(recording, name)
            if other is not None:
                fine = channels.periods_per_turn * other
                agree = [abs(np.exp(1j * (phase - s * fine)).mean()) for s in (1.0, -1.0)]
                rising += agree[0] - agree[1]
                by = name
                break
    return rising, by
