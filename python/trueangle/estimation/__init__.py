"""Residuals explained by columns under some noise: the least squares behind every search."""
