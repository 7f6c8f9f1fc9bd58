"""Benchmarks against the libraries a user would otherwise take, one subject a module."""
