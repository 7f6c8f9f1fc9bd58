"""``python -m trueangle.cli``."""

from . import process

process()
