"""Calibration without a reference: patterns jointly with the unknowns of the log."""
