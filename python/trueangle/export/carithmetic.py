"""What angles and errors are in C: whole numbers with floats, or doubles."""

from __future__ import annotations

from dataclasses import dataclass

from .codetext import code_parts, filled_code, float_literal
from .table import TURN


@dataclass(frozen=True)
class CArithmetic:
    """What angles and errors are.

    Attributes
    ----------
    name : str
        Of its own parts of ``code/step.c``.
    angle, real : str
        Types.
    suffix : str
        Of a number of the type ``real``.
    near : str
        Condition under which a search ends.
    one : float
        A turn.
    from_near : str
        Ending of the name of an inverse of the series that starts at an angle nearby.
    """

    name: str
    angle: str
    real: str
    suffix: str
    near: str
    one: float
    from_near: str = ""

    def part(self, name: str, **values: object) -> str:
        """A part of ``code/step.c``: its own, or the one of both."""
        parts = code_parts("step.c")
        return filled_code(parts.get(f"{self.name} {name}") or parts[name], **values)

    def number(self, value: float) -> str:
        """A constant of the type ``real``."""
        text = float_literal(value, 9 if self.suffix else 17) + self.suffix
        return text if value >= 0.0 else f"({text})"

    def place(self, turns: float) -> str:
        """A constant angle."""
        if self.one == 1.0:
            return self.number(turns)
        whole = round(turns * self.one)
        return f"INT64_C({whole})" if whole >= 0 else f"(-INT64_C({-whole}))"


FIXED = CArithmetic("fixed", "int64_t", "float", "f", "off <= 1 && off >= -1", TURN)
DOUBLE = CArithmetic(
    "double", "double", "double", "", "fabs(off) <= 1e-13 + 4e-16 * fabs(goal)", 1.0, "_from"
)
