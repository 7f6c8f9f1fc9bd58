"""The corrector, under the name it had before: see `trueangle.correction.corrector`."""

from ..correction.corrector import Corrector
from ..signals import AT_RUN_TIME as SIGNALS

__all__ = ["SIGNALS", "Corrector"]
