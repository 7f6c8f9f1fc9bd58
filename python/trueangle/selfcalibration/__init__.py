"""Calibration without a reference: patterns together with what the log does not know."""
