"""What a check of data found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...support.layout import counted, laid_out, wrapped_lines
from ...support.plainresult import PlainResult
from .extent import Extent
from .fault import DataFault


@dataclass(frozen=True)
class Check(PlainResult):
    """Whether data are fit to be used, before any model.

    Attributes
    ----------
    data_faults : tuple of DataFault
    ratio : float or None
        Travel of the indicated angle per travel of the reference.
    suggests : str
        What that ratio suggests.
    extent : Extent
        Span, turns, directions, speeds, loads, temperatures and mounts.
    can : tuple of str
        What can be known from such data.
    cannot : tuple of dict
        ``what`` cannot, ``because``, and what to ``measure``.
    columns : mapping of role to (name, unit)
        The columns of files that were understood; empty for runs.
    """

    data_faults: tuple[DataFault, ...]
    ratio: float | None
    suggests: str
    extent: Extent
    can: tuple[str, ...]
    cannot: tuple[dict[str, str], ...]
    columns: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)

    @property
    def usable(self) -> bool:
        """No fault forbids to use the data as they are."""
        return not any(fault.unusable for fault in self.data_faults)

    def to_dict(self) -> dict[str, Any]:
        """What ``trueangle check`` prints as JSON."""
        e = self.extent
        return {
            "data_faults": [fault.to_dict() for fault in self.data_faults],
            "usable": self.usable,
            "ratio": self.ratio,
            "ratio_suggests": self.suggests,
            "readings": e.readings,
            "runs": e.runs,
            "span_deg": e.span_deg,
            "turns": e.turns,
            "directions": [*e.directions],
            "speeds": [*e.speeds],
            "loads": [*e.loads],
            "temperatures": [*e.temperatures],
            "mounts": [*e.mounts],
            "columns": [
                {"role": role, "name": name, "unit": unit}
                for role, (name, unit) in self.columns.items()
            ],
            "can": [*self.can],
            "cannot": [*self.cannot],
        }

    def _brief(self) -> str:
        fit = "usable" if self.usable else "not usable"
        found = ", ".join(fault.fault for fault in self.data_faults) or "no fault"
        return (
            f"{self.extent.readings} readings in {counted(self.extent.runs, 'run')}, {fit}: {found}"
        )

    def summary(self) -> str:
        """The check as readable text: faults first."""
        e = self.extent
        lines = []
        for fault in self.data_faults:
            lines += wrapped_lines(f"{fault.fault}: {fault.says}.", 2)
            lines += wrapped_lines(f"Remedy: {fault.mend}.", 4, 2)
        if not self.data_faults:
            lines.append("No fault found in the data.")
        elif not self.usable:
            lines.append("The data must not be used as they are.")
        if self.columns:
            told = [
                f"{role} is '{name}'" + (f" in {unit}" if unit else "") + _reversed(role, name)
                for role, (name, unit) in self.columns.items()
            ]
            lines += ["", *wrapped_lines(f"Understood: {'; '.join(told)}.", 2)]
        ratio = "unknown" if self.ratio is None else f"{self.ratio:.6g}"
        lines += [
            "",
            f"{e.readings} readings in {e.runs} run{'s' * (e.runs != 1)}, {e.span_deg:.4g} deg of "
            f"places, {e.turns:.4g} turns at most.",
            f"Indicated per reference: {ratio} ({self.suggests}).",
            f"Directions: {_levels(e.directions)}; speeds: {_levels(e.speeds, 'deg/s')}; "
            f"loads: {_levels(e.loads, 'Nm')}; "
            f"temperatures: {_levels(e.temperatures, 'C')}; mounts: {_levels(e.mounts, 'deg')}.",
            "",
        ]
        lines += wrapped_lines(f"Can be known: {'; '.join(self.can)}.", 2)
        for entry in self.cannot:
            lines += wrapped_lines(
                f"Cannot be known: {entry['what']} ({entry['because']}). To find out: "
                f"{entry['measure']}.",
                2,
            )
        return laid_out(lines)


def _reversed(role: str, name: str) -> str:
    """What a minus before the joint's own column means."""
    is_reversed = role == "indicated" and name.startswith("-")
    return " (a reversed sensor: models keep indicated_sign -1)" if is_reversed else ""


def _levels(values: tuple[float, ...] | tuple[int, ...], unit: str = "") -> str:
    if not values:
        return "not recorded"
    return f"{', '.join(f'{value:g}' for value in values)} {unit}".rstrip()
