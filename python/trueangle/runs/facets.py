"""Calibrated deviations of a polygon's facets, added to its nominal angles."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import FileError
from ..formats.columns import find_columns
from ..support.arrays import Array
from ..support.roles import ANGLE_UNITS, unit_in_name, wanted_columns
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
