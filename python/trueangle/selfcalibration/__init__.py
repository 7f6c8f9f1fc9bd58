"""Calibration without a reference: patterns beside what the log does not know."""
