"""One fault of the data, reported with what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from ...support.plainresult import plain_fields

#: Faults with which nothing may be fitted: the angles are not what they seem.
UNUSABLE = (
    "unsorted_time",
    "mixed_units",
    "wrong_sign",
    "wrong_gear_ratio",
    "wrapped_reference",
    "unrelated_angles",
    "dead_channel",
    "wrapped_counter",
    "short_arc",
)

#: Rows that are listed; more are counted.
LISTED = 100


#: Faults whose rows are right, but there twice or out of order.
REPEATS = ("duplicate_runs", "duplicate_rows", "unsorted_time")


class DataFault(NamedTuple):
    """What is wrong with readings or runs, before any model.

    Attributes
    ----------
    fault : str
        Of the fixed vocabulary: duplicate_runs, duplicate_rows, stale_samples,
        unsorted_time, mixed_units, wrong_sign, unrelated_angles, swapped_channels,
        wrong_gear_ratio, saturated_travel, wrapped_reference, missed_counts, outliers; of raw
        channels dead_channel, wrapped_counter, short_arc, partial_arc, clipping, dropouts, resting,
        no_centre.
    runs : tuple of str
        Labels of the runs that have it.
    rows : tuple of int
        Counted from 1 within each file (the header not counted), or within the run where there
        is none, and in the texts; empty where whole runs are meant.
    says : str
    mend : str
        What to do.
    """

    fault: str
    runs: tuple[str, ...]
    rows: tuple[int, ...]
    says: str
    mend: str

    @classmethod
    def of(
        cls, fault: str, runs: Iterable[str], rows: Sequence[int], says: str, mend: str
    ) -> DataFault:
        """A fault of plain values."""
        return cls(fault, tuple(dict.fromkeys(runs)), tuple(int(k) for k in rows), says, mend)

    @property
    def spoils_readings(self) -> bool:
        """Whether its rows hold other angles than were there: they scatter for that reason."""
        return bool(self.rows) and self.fault not in REPEATS

    @property
    def unusable(self) -> bool:
        """The data must not be used as they are."""
        return self.fault in UNUSABLE

    def __str__(self) -> str:
        return f"{self.fault}: {self.says}; {self.mend}"

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``data_faults``."""
        return {
            "fault": self.fault,
            "rows": [*self.rows[:LISTED]],
            "rows_total": len(self.rows),
            **plain_fields(self, "runs says mend unusable"),
        }
