"""Names of lines as the joint declares its shafts: motor 1, not output 100."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from ..joint.joint import Joint

#: What a line of an output order is called.
LineNames: TypeAlias = Callable[[float], str]


def line_names(joint: Joint | None) -> LineNames:
    """Names by output order: of the shaft of ``joint`` that it is a whole order of.

    Without a joint, and for orders that are none of its shafts', the output's own.

    Examples
    --------
    >>> from trueangle.simulation import Joint
    >>> name = line_names(Joint(100.0, "circular_spline", "motor"))
    >>> name(100.0), name(202.0), name(5.0), line_names(None)(100.0)
    ('motor 1', 'wave generator 2', 'output 5', 'output 100')
    """

    def name(order: float) -> str:
        found = None if joint is None else joint.name_order(order)
        if found is None:
            return f"output {order:g}"
        shaft, k = found
        return f"{shaft.replace('_', ' ')} {k}"

    return name
