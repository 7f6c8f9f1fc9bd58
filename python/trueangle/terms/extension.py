"""Corrections from effects, under the name they had before: `trueangle.diagnosis.correction`."""

from ..diagnosis.correction import (
    NOT_AT_RUN_TIME,
    extend_model,
    terms_from_effects,
    without_terms,
)

__all__ = ["NOT_AT_RUN_TIME", "extend_model", "terms_from_effects", "without_terms"]
