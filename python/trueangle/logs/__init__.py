"""Encoder logs: read, correct and write them in constant memory."""
