"""The rooms that state errors or p values: a room is a module with `cases`, and a line here."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import cast

from asked import Case

#: Room, and the modules that have its cases.
ROOMS = {
    "effects": ("findings", "spreads"),
    "fit": ("fits",),
    "selfcalibration": ("selfcals",),
    "fleets": ("fleetunits",),
    "joining": ("joins",),
    "certificate": ("certificates",),
    "goodness": ("remainders",),
    "comparison": ("comparisons",),
}


def of_room(room: str) -> Mapping[str, Case]:
    """The cases of a room."""
    found: dict[str, Case] = {}
    for name in ROOMS[room]:
        found |= cast("Mapping[str, Case]", import_module(name).cases())
    return found
