"""The two angles of a run: their columns and units, what is added to them, those in other rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import FileError
from ..formats.columns import channels_code, find_columns, listed_columns
from ..support.angles import UNIT_PERIODS
from ..support.arrays import Array
from ..support.roles import (
    ANGLE_UNITS,
    RoleColumn,
    offsets_of,
    role_code,
    unit_in_name,
    wanted_columns,
)
from ..support.suggestions import did_you_mean
from .readings import named_source, readings_of


class Facets(NamedTuple):
    """Facets of a polygon.

    Attributes
    ----------
    file : str
    places : tuple of float
        Nominal angles in turns, within [0, 1), ascending.
    deviations : tuple of float
        True less nominal angle, in turns.
    """

    file: str
    places: tuple[float, ...]
    deviations: tuple[float, ...]

    def deviation(self, nominal: Array, period: float, path: object, column: str) -> Array:
        """The deviation at every nominal angle, in the unit of ``period``; NaN stays NaN.

        Raises
        ------
        FileError
            An angle is that of no facet.
        """
        turns = nominal / period
        places = np.array([*self.places, self.places[0] + 1.0]) - self.places[0]
        here = np.mod(turns - self.places[0], 1.0)
        nearest = np.searchsorted((places[1:] + places[:-1]) / 2.0, here)
        off = np.abs(places[np.minimum(nearest, places.size - 1)] - here)
        # How far a nominal angle may be off its facet, as a share of the closest two facets'
        # distance.
        far = np.flatnonzero(off > 0.01 * np.diff(places).min())
        if far.size:
            row = int(far[0])
            facet = self.places[int(nearest[row]) % len(self.places)]
            raise FileError(
                path,
                f"reading {row + 1} is at {360.0 * (turns[row] % 1.0):g} deg, which is not a facet "
                f"of {self.file}: the nearest is at {360.0 * facet:g} deg",
                column=column,
            )
        found = np.array(self.deviations)[nearest % len(self.places)] * period
        return np.asarray(np.where(np.isnan(here), np.nan, found))


def read_facets(path: str | PathLike[str]) -> Facets:
    """Facets of a file with the columns ``reference_deg`` and ``deviation_arcsec``.

    The names may end with other units of angles. The true angle of a facet is its nominal angle
    plus the deviation.

    Raises
    ------
    FileError
        A column is missing, a cell is empty, a facet is listed twice.
    """
    table = named_source(Path(path), lambda file: readings_of(file, wanted_columns(None), None))
    roles = find_columns(path, list(table.columns), {})
    reference = roles.get("reference")
    name = next((n for n in table.columns if n.lower().startswith("deviation")), None)
    unit = None if name is None else unit_in_name(name, "reference")
    if reference is None or name is None or unit not in ANGLE_UNITS:
        raise FileError(
            path,
            "the columns reference_deg and deviation_arcsec are needed, and there are "
            f"{', '.join(table.columns)}",
            line=1,
        )
    deviation = reference._replace(name=name, unit=unit)
    values = np.array([c.values(table.raw(c), 1.0) for c in (reference, deviation)])
    empty = np.flatnonzero(np.isnan(values).any(axis=0))
    if empty.size:
        raise table.error("a facet lacks its angle or its deviation", name, int(empty[0]))
    places = np.mod(values[0], 1.0)
    order = np.argsort(places, kind="stable")
    steps = np.diff(places[order], append=places[order[:1]] + 1.0)
    if not places.size or (steps < 1e-9).any():
        row = int(order[int(np.argmin(steps)) - places.size + 1]) if places.size else 0
        raise table.error("facets must be listed once each", reference.name, row)
    return Facets(Path(path).name, tuple(places[order].tolist()), tuple(values[1][order].tolist()))


if TYPE_CHECKING:
    from .readings import FileReadings

#: Unit of the run's angles where the reference has none that a run may be in.
PERIOD = 360.0


class _Part(NamedTuple):
    """A column and the factor that leads to the unit of the run."""

    name: str
    factor: float

    def of(self, get: Callable[[str], Array]) -> Array:
        values = get(self.name)
        return values if self.factor == 1.0 else values * self.factor


class RunAngles(NamedTuple):
    """Columns of the reference with what is added to it, of the indicated angle, or of the error.

    ::

        r = r₀ + δ(r₀ + m) + Σ_i o_i,    y = r + e

    with the offsets o, the deviation of the facet at the nominal angle and the mount m; where
    there is an error e, either r or y is made of the other one.
    """

    path: object
    period: float
    reference: _Part | None
    indicated: _Part | None
    error: _Part | None
    offsets: tuple[_Part, ...] = ()
    mount: _Part | None = None
    facets: Facets | None = None
    #: -1 where the indicated angle is minus what the sensor reads.
    indicated_sign: int = 1

    @property
    def names(self) -> list[str]:
        """The columns, each once."""
        parts = (self.reference, self.indicated, self.error, *self.offsets, self.mount)
        return list(dict.fromkeys(part.name for part in parts if part is not None))

    def values(self, get: Callable[[str], Array]) -> tuple[Array, Array]:
        """Reference and indicated angle of rows, from their columns.

        Raises
        ------
        FileError
            A nominal angle is that of no facet.
        """
        indicated = None if self.indicated is None else self.indicated.of(get)
        if self.reference is None:
            assert indicated is not None
            assert self.error is not None
            return indicated - self.error.of(get), indicated
        reference = nominal = self.reference.of(get)
        if self.facets is not None:
            place = nominal if self.mount is None else nominal + self.mount.of(get)
            reference = reference + self.facets.deviation(
                place, self.period, self.path, self.reference.name
            )
        for offset in self.offsets:
            reference = reference + offset.of(get)
        if indicated is None:
            assert self.error is not None
            indicated = reference + self.error.of(get)
        return reference, indicated


def find_run_angles(
    path: object,
    header: Sequence[str],
    roles: Mapping[str, RoleColumn],
    *,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    counts_per_turn_reference: float | None = None,
    facets: Facets | None = None,
) -> RunAngles:
    """What the angles of a table are made of, and their period.

    ``unit`` is that of angles whose columns state none; messages name ``path``.

    Raises
    ------
    FileError
        A column is missing, or its unit is not known; units are mixed.
    """

    def error(problem: str, name: str) -> FileError:
        return FileError(path, problem, line=1, column=name)

    counts = {"reference": counts_per_turn_reference, "indicated": counts_per_turn}
    found = {
        role: roles[role]._replace(unit=roles[role].unit or ("count" if counts.get(role) else unit))
        for role in ("reference", "indicated", "error")
        if role in roles
    }
    for role in ("reference", "indicated"):
        if role not in found and ("error" not in found or len(found) < 2):
            _refuse_missing(path, header, role)
    if len(found) == 3:
        raise error(
            "an error is given with one of the two angles: leave one of the three out",
            found["error"].name,
        )
    first = found.get("reference") or found["indicated"]
    if first.role == "reference" and "indicated" in found:
        indicated = found["indicated"]
        found["indicated"] = indicated._replace(unit=indicated.unit or first.unit)
    for role, column in found.items():
        if column.unit is None:
            wanted = role_code(role, column.name, "arcsec" if role == "error" else "deg")
            raise error(f"its unit is not known; give it: {wanted}", column.name)
        if column.unit == "count" and counts.get(role, counts_per_turn) is None:
            raise error(
                "a reference in counts needs their number per turn: give "
                "`counts_per_turn_reference=`"
                if role == "reference"
                else "counts need their number per output turn: give `counts_per_turn=`",
                column.name,
            )
    _check_alike(error, found)
    if first.role != "reference" and (facets is not None or offsets_of(roles)):
        name = facets.file if facets is not None else offsets_of(roles)[0].name
        raise error(f"{name} is added to a reference, and the file has only the error", first.name)
    period = UNIT_PERIODS.get(first.unit or "", PERIOD)

    def part(column: RoleColumn | None) -> _Part | None:
        if column is None:
            return None
        turn = counts.get(column.role, counts_per_turn)
        return _Part(column.name, column.scale(period, turn)[0])

    offsets = []
    for column in offsets_of(roles):
        if column.unit is None:
            raise error(
                "its unit is not known; give it: "
                f"{role_code('reference_offset', column.name, 'arcsec')}",
                column.name,
            )
        offsets.append(_Part(column.name, column.scale(period, counts_per_turn_reference)[0]))
    mount = part(roles.get("mount")) if facets is not None else None
    return RunAngles(
        path,
        period,
        part(found.get("reference")),
        part(found.get("indicated")),
        part(found.get("error")),
        tuple(offsets),
        mount,
        facets,
        found["indicated"].sign if "indicated" in found else 1,
    )


def _check_alike(error: Callable[[str, str], FileError], found: Mapping[str, RoleColumn]) -> None:
    """Refuse two angles that were found by their names and have different units."""
    if not {"reference", "indicated"} <= found.keys():
        return
    reference, indicated = found["reference"], found["indicated"]
    by_name = not (reference.is_asked or indicated.is_asked)
    suffixes = [c.name == f"{c.role}_{c.unit}" for c in (reference, indicated)]
    differ = reference.unit != indicated.unit and "count" not in (reference.unit, indicated.unit)
    if differ and by_name and all(suffixes):
        told = ", ".join(f'"{c.role}": ("{c.name}", "{c.unit}")' for c in (reference, indicated))
        raise error(
            f"units are mixed: the columns' names state {reference.unit} and {indicated.unit}; if "
            f"both are right, add `signals={{{told}}}`; if not, add it with the true units",
            indicated.name,
        )


def _refuse_missing(path: object, header: Sequence[str], role: str) -> None:
    units = (*UNIT_PERIODS, "count") if role == "indicated" else tuple(UNIT_PERIODS)
    names = ", ".join(f"{role}_{unit}" for unit in units)
    guess = next(filter(None, (did_you_mean(f"{role}_{unit}", header) for unit in units)), "")
    if not guess and (code := channels_code(header)):
        guess = f"; channels are named with {code}"
    raise FileError(
        path,
        f"no column {role}_deg (one of {names} is needed, or another named with "
        f"{role_code(role)}); {listed_columns(header)}{guess}",
        line=1,
    )


def two_channels(
    table: FileReadings, counts: Mapping[str, float | None], reference: Array, indicated: Array
) -> str:
    """The command that joins two angles in separate rows; empty for others.

    ``counts`` are those of a turn, by the option that states them.
    """
    both = np.isfinite(reference) & np.isfinite(indicated)
    roles = table.roles
    if both.any() or not {"reference", "indicated", "time"} <= roles.keys():
        return ""
    import shlex

    words = ["trueangle", "join", str(table.path), str(table.path), "-o", "joined.csv"]
    for role, log in (("indicated", "a."), ("reference", "b."), ("time", "")):
        if log or roles[role].is_asked:
            words += ["--signal", f"{log}{role}={_typed(roles[role])}"]
    for option, count in counts.items():
        if count is not None:
            words += [option, f"{count:.17g}"]
    return f": the two angles are in separate rows; run: {shlex.join(words)}"


def _typed(column: RoleColumn) -> str:
    """A column as the option --signal has it."""
    unit = f":{column.unit}" if column.unit else ""
    return f"{'-' if column.is_reversed else ''}{column.name}{unit}"
