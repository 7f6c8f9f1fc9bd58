"""Tables of a plan, noise factors and places, and its plain values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..support.plainresult import finite_or_none


def place_table(places_deg: Sequence[float], counts: Sequence[int]) -> list[str]:
    """Readings at each place, a line a place under their heads."""
    rows = zip(places_deg, counts, strict=True)
    return ["  place/deg  readings", *(f"  {place:9.3f}  {count:8d}" for place, count in rows)]


def factor_table(factors: dict[float, float]) -> list[str]:
    """Noise factors by order, six on a line."""
    entries = [f"{m:>5g} {f:5.2f}" for m, f in factors.items()]
    return ["  " + "  ".join(entries[i : i + 6]) for i in range(0, len(entries), 6)]


def plain_arc_plan(plan: Any, kind: str) -> dict[str, Any]:
    """The JSON object of a plan of readings at places: lists, and orders as the keys of objects."""
    return {"kind": kind, **plain_plan(vars(plan)), "readings": plan.readings}


def plain_plan(value: Any) -> Any:
    """Orders as keys of an object, tuples as lists; what is not finite is None."""
    if isinstance(value, dict):
        return {
            (f"{k:g}" if isinstance(k, (int, float)) else k): plain_plan(v)
            for k, v in value.items()
        }
    if isinstance(value, list | tuple):
        return [plain_plan(entry) for entry in value]
    return finite_or_none(value) if isinstance(value, float) else value
