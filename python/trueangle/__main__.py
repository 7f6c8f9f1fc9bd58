"""``python -m trueangle``."""

from .cli import process

process()
