"""What a model corrects beyond harmonics: forms, terms, and the corrector that holds state."""

from __future__ import annotations

from typing import Any


def __getattr__(name: str) -> Any:
    # `trueangle.model` was one module.
    from ..support.renamed import renamed_attribute

    return renamed_attribute(__name__, f"{__name__}.model", name)
