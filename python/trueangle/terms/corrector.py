"""The corrector, under the name it had before: see `trueangle.correction.corrector`."""

from ..correction.corrector import SIGNALS, Corrector, evaluate

__all__ = ["SIGNALS", "Corrector", "evaluate"]
