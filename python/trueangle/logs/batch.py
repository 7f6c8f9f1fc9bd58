"""Correcting many logs: one after the other or on a cluster, resumed where it stopped."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from ..errors import TrueAngleError, UnitWarning
from ..model.model import HarmonicModel
from ..support.argumentkinds import told_kinds
from ..support.files import remove_leftovers
from .correction import CorrectionTask, correct_log, is_disk_full, states_after
from .joints import JointState, LogSettings, logged_joints
from .manifest import Manifest, stamp
from .report import BatchReport, LogReport, Progress, done_before
from .sources import LogTarget, output_places

__all__ = ["BatchReport", "LogReport", "correct_logs"]

_Error = TypeVar("_Error", bound=BaseException)


@told_kinds
def correct_logs(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    model: HarmonicModel | str | PathLike[str] | Mapping[str, Any],
    output: str | PathLike[str] | None = None,
    *,
    in_place: bool = False,
    column: str | Mapping[str, str] | None = None,
    signals: Mapping[str, Any] | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    topic: str | None = None,
    output_topic: str | None = None,
    scheduler: str | None = None,
    threads: int | None = None,
    progress: str = "none",
    report: Callable[[LogReport], None] = lambda log: None,
) -> BatchReport:
    r"""Correct log files, in constant memory and without ever losing a row.

    Every output is written in a hidden folder, read back and compared, synced, and only then named.
    A log that fails does not stop the others (a full disk does). Running again skips what
    is done: the output folder's manifest knows.

    Parameters
    ----------
    logs : path or iterable of paths
        Files or folders of Parquet, Arrow, CSV, HDF5, MATLAB v7.3, ROS bags, MCAP, MDF4.
    model : HarmonicModel, Robot, path of either, or mapping of joint names to models
    output : path, optional
        A file for one log, a folder for several.
    in_place : bool
        Replace every log by its corrected copy once that is verified.
    column : str or mapping of joint names to str, optional
        The indicated angle; by default the column named so.
    signals : mapping, optional
        Columns of signals that terms of the model need: ``{"temperature": "T_motor"}``, or
        such a mapping by joint name.
    unit : {"deg", "rad", "turn", "count"}, optional
    counts_per_turn : float, optional
    topic, output_topic : str, optional
        Of ROS bags: the JointState topic, and the one that takes the corrected positions.
    scheduler : str, optional
        Address of a Dask scheduler whose workers share the file system.
    threads : int, optional
        Most threads for the correction itself.
    progress : {"auto", "text", "json", "none"}
        On stderr; see `Progress`.
    report : callable
        Is given the `LogReport` of every log as it is finished.

    Returns
    -------
    BatchReport
        What is done and what is not, in the order of the logs.

    Raises
    ------
    ArgumentError
        Nothing has been done yet: no such log, an output that is an input.

    Examples
    --------
    >>> import tempfile
    >>> from trueangle import HarmonicModel, Shaft
    >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> folder = Path(tempfile.mkdtemp())
    >>> _ = (folder / "a.csv").write_text("indicated_deg\n90.5\n")
    >>> done = correct_logs(folder / "a.csv", model, folder / "b.csv")
    >>> (folder / "b.csv").read_text().split()
    ['indicated_deg,corrected_deg', '90.5,90']
    """
    start = time.monotonic()
    settings = LogSettings(
        logged_joints(model, column, signals), unit, counts_per_turn, topic, output_topic, threads
    )
    paths = [logs] if isinstance(logs, (str, PathLike)) else list(logs)
    found = output_places(paths, output, in_place, _files_of(model))
    result = BatchReport(
        [LogReport(place.source, place.target, stamp(place.source)[0]) for place in found]
    )
    shown = Progress(len(found), sum(log.size for log in result.logs), progress)

    def finished(log: LogReport) -> None:
        shown.clear()
        shown.finish_file(log.size, skipped=log.status == "done before")
        report(log)

    with ExitStack() as stack:
        folders = dict.fromkeys(place.manifest for place in found if place.manifest is not None)
        manifests = {f: stack.enter_context(Manifest(f).opened()) for f in folders}
        remove_leftovers(place.target for place in found)
        try:
            if scheduler is None:
                _one_by_one(found, result.logs, settings, manifests, shown, finished)
            else:
                from .cluster import on_cluster

                on_cluster(scheduler, found, result.logs, settings, manifests, shown, finished)
        except KeyboardInterrupt as interruption:
            result.interrupted = _without_locals(interruption)
        finally:
            shown.clear()
            # Ctrl-C may have come while the place of a finished log was cleared, and a worker
            # of a cluster may have been killed.
            remove_leftovers(place.target for place in found)
    result.seconds = time.monotonic() - start
    _warn_of_units(result.logs)
    return result


def _warn_of_units(logs: Sequence[LogReport]) -> None:
    """Warn once for each column whose readings look like another unit, with the number of logs."""
    told: dict[str, list[str]] = {}
    for log in logs:
        for joint in (log.result or {}).get("joints", ()):
            if log.is_done and joint.get("unit_note"):
                told.setdefault(joint["column"], []).append(f"{log.log}: {joint['unit_note']}")
    for notes in told.values():
        more = f"; so in {len(notes)} logs" if len(notes) > 1 else ""
        warnings.warn(f"{notes[0]}{more}", UnitWarning, stacklevel=3)


def _without_locals(error: _Error) -> _Error:
    """``error``, to be kept: what the frames of its traceback held (arrays, open files) is freed.

    HDF5 ends the process with a fault where a virtual data set is open to its end.
    """
    import traceback  # brings the tokenizer with it

    cause: BaseException | None = error
    while cause is not None:
        traceback.clear_frames(cause.__traceback__)
        cause = cause.__context__
    return error


def _files_of(model: Any) -> list[str | PathLike[str]]:
    """The model files among what was given as model."""
    given = model.values() if isinstance(model, Mapping) else [model]
    return [entry for entry in given if isinstance(entry, (str, PathLike))]


def _one_by_one(
    found: Sequence[LogTarget],
    logs: Sequence[LogReport],
    settings: LogSettings,
    manifests: Mapping[Path, Manifest],
    shown: Progress,
    finished: Callable[[LogReport], None],
) -> None:
    before: Mapping[str, JointState] = {}
    for place, log in zip(found, logs, strict=True):
        if not done_before(place, log, settings, manifests):
            shown.start_file(log.size)
            task = CorrectionTask(place.source, place.target, settings, before, place.manifest)
            try:
                log.result = correct_log(task, shown.advance)
                log.status = "done"
            except (TrueAngleError, OSError) as error:
                log.status, log.error = "failed", _without_locals(error)
        finished(log)
        # Without the turns of this log, those of the logs after it cannot be determined.
        if log.error is not None and (is_disk_full(log.error) or settings.counts_turns):
            return
        before = states_after(log.result)
