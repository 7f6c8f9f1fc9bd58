"""Sums over rows: shares, columns, penalties and scatter, each by its identity."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.estimation.linear import NormalEquations, total


def rows(seed: int, n: int = 30) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rng.normal(size=n)


def test_a_share_and_its_rest_are_the_whole() -> None:
    one = NormalEquations.of_rows(*rows(1))
    again = total([one.share(0.25), one.share(0.75)])
    for a, b in ((again.gram, one.gram), (again.moment, one.moment)):
        np.testing.assert_allclose(a, b, rtol=1e-12)
    assert (again.squares, again.readings) == pytest.approx((one.squares, 30.0))
    assert one.share(0.25).readings == 7.5


def test_some_columns_and_a_penalty() -> None:
    x, y = rows(2)
    one = NormalEquations.of_rows(x, y)
    for columns in (np.array([0, 2]), np.array([True, False, True])):
        part = one.among(columns)
        direct = NormalEquations.of_rows(x[:, [0, 2]], y)
        np.testing.assert_allclose(part.gram, direct.gram)
        np.testing.assert_allclose(part.moment, direct.moment)
        assert (part.squares, part.readings) == (one.squares, 30)
    held = one.held(0.1)
    mean = np.trace(x.T @ x) / 3.0
    np.testing.assert_allclose(held.gram, x.T @ x + 0.1 * mean * np.eye(3))
    expected = np.linalg.solve(x.T @ x + 0.1 * mean * np.eye(3), x.T @ y)
    np.testing.assert_allclose(held.solved().coefficients[:, 0], expected, rtol=1e-9)


def test_products_about_a_given_mean() -> None:
    x, y = rows(3)
    z = np.column_stack([np.ones(30), x, y])
    mean = np.array([1.0, 0.3, -0.2, 0.1, 0.7])
    found = NormalEquations.of_products(z.T @ z, mean)
    direct = NormalEquations.of_rows(x - mean[1:4], y - mean[4])
    np.testing.assert_allclose(found.gram, direct.gram, atol=1e-12)
    np.testing.assert_allclose(found.moment, direct.moment, atol=1e-12)
    assert (found.squares, found.readings) == pytest.approx((direct.squares, 30.0))
