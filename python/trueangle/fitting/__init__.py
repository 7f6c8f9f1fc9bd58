"""Least-squares fits of harmonic models to calibration runs."""
