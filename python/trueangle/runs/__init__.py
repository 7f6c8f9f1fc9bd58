"""What a rig read: runs and their readings, files and tables of them, checks, joins, aliases."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    # `trueangle.runs` was one module.
    from ..support.renamed import renamed_attribute

    return renamed_attribute(__name__, f"{__name__}.run", name)
