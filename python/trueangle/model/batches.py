"""Readings of a log in the order they were taken, batch by batch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import FileError
from ..formats.columns import find_columns
from ..formats.format import Labels, Selection
from ..formats.formats import find_format
from ..runs.angles import RunAngles, find_run_angles
from ..runs.files import Conversion
from ..runs.source import ReadingOptions, checked_reading_options
from ..support.arrays import Array
from ..support.roles import RoleColumn, wanted_columns
from .model import HarmonicModel


class ReadingBatch(NamedTuple):
    """Angle that the model's error is a function of, error in the model's unit, and seconds."""

    angle: Array
    error: Array
    time: Array | None


def read_batches(
    path: Path, model: HarmonicModel, reading: ReadingOptions
) -> Iterator[ReadingBatch]:
    """Batches of a log of any format, in constant memory.

    Raises
    ------
    FileError
        A column is missing or holds no numbers, or the file is damaged.
    """
    kind = find_format(path)
    given = Conversion.of(checked_reading_options(reading))
    topic = reading.get("topic")
    with kind.at_header(path):
        header = kind.module.columns(path, topic)
        columns = WatchedColumns.of(path, header, reading, given, kind.unit)
    for stretch in kind.stretches(path):
        for batch in kind.module.read(path, Selection(columns.names, topic, stretch)):
            yield columns.batch(lambda name, b=batch: _numbers(path, name, b[name]), model)


def _numbers(path: Path, name: str, values: Array | Labels) -> Array:
    if isinstance(values, Labels):
        raise FileError(path, "labels, where a number is needed in every row", column=name)
    return np.asarray(values, dtype=float)


class WatchedColumns(NamedTuple):
    """Where a log has its angles and times."""

    angles: RunAngles
    time: RoleColumn | None

    @classmethod
    def of(
        cls,
        path: object,
        header: Sequence[str],
        reading: ReadingOptions,
        given: Conversion,
        unit: str | None,
    ) -> WatchedColumns:
        """Columns of a header; ``unit`` is that of angles whose columns state none.

        Raises
        ------
        FileError
            A column is missing, or its unit is not known.
        """
        roles = find_columns(path, header, wanted_columns(reading.get("signals")))
        angles = find_run_angles(
            path,
            header,
            roles,
            unit=unit,
            counts_per_turn=given.counts,
            counts_per_turn_reference=given.reference_counts,
            facets=given.facets,
        )
        return cls(angles, roles.get("time"))

    @property
    def names(self) -> list[str]:
        """Columns that are read."""
        time = [] if self.time is None else [self.time.name]
        return list(dict.fromkeys([*self.angles.names, *time]))

    def batch(self, get: Any, model: HarmonicModel) -> ReadingBatch:
        """The readings of some rows in the model's unit."""
        reference, indicated = self.angles.values(get)
        scale = model.period / self.angles.period
        angle = reference if model.argument == "reference" else indicated
        time = None
        if self.time is not None:
            time = self.time.values(np.asarray(get(self.time.name)), self.angles.period)
        return ReadingBatch(scale * angle, scale * (indicated - reference), time)
