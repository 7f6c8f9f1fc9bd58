"""Logs corrected side by side by the workers of a Dask cluster, a log on each."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import ArgumentError, FileError, MissingExtraError, TrueAngleError
from ..runs.files import read_runs
from ..runs.run import CalibrationRun
from .accumulation import Accumulated, LogFitSettings, log_moments, merged_moments
from .correction import CorrectionTask, correct_log, count_turns, is_disk_full, states_after
from .joints import JointState, LogSettings
from .manifest import Manifest
from .report import LogReport, Progress, done_before
from .sources import LogTarget
from .turns import TurnSpan, TurnState

#: Seconds to wait for the scheduler.
_TIMEOUT = 20


@contextmanager
def connected_client(scheduler: str) -> Iterator[Any]:
    """A client of the Dask scheduler at this address.

    Raises
    ------
    MissingExtraError
        Dask is not installed.
    ArgumentError
        Nobody answers there.
    """
    distributed: Any = _distributed()
    try:
        client = distributed.Client(scheduler, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as cause:
        raise ArgumentError(
            f"`scheduler={str(scheduler)!r}`: no Dask scheduler answers ({cause}); start one"
        ) from (None)
    with client:
        yield client


def _distributed() -> Any:
    try:
        import distributed
    except ModuleNotFoundError:
        raise MissingExtraError(
            "a cluster needs distributed: pip install 'trueangle[dask]'"
        ) from None
    return distributed


def on_cluster(
    scheduler: str,
    found: Sequence[LogTarget],
    logs: Sequence[LogReport],
    settings: LogSettings,
    manifests: Mapping[Path, Manifest],
    shown: Progress,
    finished: Callable[[LogReport], None],
) -> None:
    """Fill the reports of all logs; Dask does a lost worker's log again on another.

    Every worker corrects with one thread, so that the numbers of workers and of their
    threads decide how much runs at once. Paths are made absolute: all machines must see
    the files under the same names.
    """
    distributed: Any = _distributed()
    settings = replace(settings, threads=settings.threads or 1)
    for place, log in zip(found, logs, strict=True):
        if done_before(place, log, settings, manifests):
            finished(log)
    with connected_client(scheduler) as client:
        futures = _submitted(client, found, logs, settings)
        try:
            for future in distributed.as_completed(futures, loop=client.loop):
                log = futures[future]
                if future.status == "cancelled":
                    continue
                log.status, log.result, log.error = _outcome(future, log)
                shown.advance(log.result.get("rows", 0), 1.0)
                finished(log)
                if log.error is not None and is_disk_full(log.error):
                    client.cancel(list(futures))
        except KeyboardInterrupt:
            client.cancel(list(futures))
            raise


def accumulated_on_cluster(
    scheduler: str, paths: Sequence[Path], settings: LogFitSettings
) -> Accumulated:
    """Moments of all logs: a log on each worker, merged there in a tree."""
    settings = replace(settings, threads=settings.threads or 1)
    with connected_client(scheduler) as client:
        parts = [client.submit(log_moments, path.resolve(), settings) for path in paths]
        while len(parts) > 1:
            parts = [
                client.submit(merged_moments, parts[i : i + 2]) for i in range(0, len(parts), 2)
            ]
        found: Accumulated = parts[0].result()
    return found


def read_on_cluster(
    scheduler: str, paths: Sequence[Path], files: Mapping[str, Any]
) -> list[CalibrationRun]:
    """The runs of all logs, a log read by each worker."""
    with connected_client(scheduler) as client:
        parts = [client.submit(read_runs, path.resolve(), **files) for path in paths]
        return [run for part in client.gather(parts) for run in part]


def _submitted(
    client: Any, found: Sequence[LogTarget], logs: Sequence[LogReport], settings: LogSettings
) -> dict[Any, LogReport]:
    """The report to fill by the future of every log that is not done.

    Logs of a model whose terms follow the travel wait for the log before.
    """
    begins = {} if settings.follows_travel else _turns(client, found, settings)
    futures: dict[Any, LogReport] = {}
    before: Any = None
    for place, log in zip(found, logs, strict=True):
        if log.is_done:
            before = _LogOutcome(log.result)
            continue
        # Not resolved: links are followed where files are written, and the manifest's names stay.
        manifest = None if place.manifest is None else place.manifest.absolute()
        begin = begins.get(place.source)
        task = CorrectionTask(
            place.source.absolute(), place.target.absolute(), settings, begin, manifest
        )
        before = client.submit(
            _correct, task, before if settings.follows_travel else None, pure=False
        )
        futures[before] = log
    return futures


class _LogOutcome(NamedTuple):
    """What became of a log: an error does not keep the log after it from being corrected."""

    result: Mapping[str, Any]
    error: Exception | None = None


def _correct(task: CorrectionTask, before: _LogOutcome | None) -> _LogOutcome:
    """On a worker. A log that a lost worker had finished is not done twice."""
    if before is not None:
        task = replace(task, before=states_after(before.result))
    try:
        return _LogOutcome(_known(task) or correct_log(task))
    except (TrueAngleError, OSError) as error:
        # A worker thought lost may have finished it in the meantime.
        known = _known(task)
        return _LogOutcome({}, error) if known is None else _LogOutcome(known)


def _known(task: CorrectionTask) -> dict[str, Any] | None:
    if task.manifest is None:
        return None
    manifest = Manifest(task.manifest)
    manifest.read()
    known = manifest.done(task.source, task.target, task.settings.digest)
    return None if known is None else dict(known)


def _outcome(future: Any, log: LogReport) -> tuple[str, Mapping[str, Any], Exception | None]:
    distributed: Any = _distributed()
    try:
        result, error = future.result()
    except distributed.scheduler.KilledWorker as cause:
        return "failed", {}, FileError(log.log, f"every worker that took it died: {cause}")
    return "done" if error is None else "failed", result, error


def _turns(
    client: Any, found: Sequence[LogTarget], settings: LogSettings
) -> dict[Path, dict[str, JointState]]:
    """Where every log begins, for models that count turns: one more pass, side by side."""
    if not settings.counts_turns:
        return {}
    spans: list[dict[str, TurnSpan]] = client.gather(
        [client.submit(count_turns, place.source.resolve(), settings) for place in found]
    )
    begins: dict[Path, dict[str, JointState]] = {}
    state: dict[str, TurnState] = {}
    for place, span in zip(found, spans, strict=True):
        begins[place.source] = {joint: JointState(one) for joint, one in state.items()}
        state = {joint: one.after(state.get(joint, TurnState())) for joint, one in span.items()}
    return begins
