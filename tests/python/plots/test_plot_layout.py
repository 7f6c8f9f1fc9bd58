"""Texts of pictures stand apart, and an envelope is drawn where a model fills its picture."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle import plots

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")


@pytest.fixture(scope="module")
def stepper() -> list[ta.CalibrationRun]:
    """Steps of a motor: order 4 of degrees, and many small ones that few positions confuse."""
    theta = np.arange(0.0, 360.0, 1.8)
    rng = np.random.default_rng(20261122)
    angle = np.radians(theta)
    error = 7.4 * np.sin(4.0 * angle)
    for order in (1, 2, 3, 5, 6, 8, 12, 16, 20, 41, 43, 44, 45, 46):
        error += rng.uniform(0.02, 0.2) * np.sin(order * angle + rng.uniform(0.0, 6.0))
    return [
        ta.CalibrationRun(theta, theta + error + rng.normal(0.0, 1e-3, theta.size), 360.0)
        for _ in range(4)
    ]


def test_aliases_of_neighbours_do_not_stand_on_each_other(stepper) -> None:
    ax = ta.select_orders(stepper).plot()
    ax.figure.canvas.draw()
    boxes = [text.get_window_extent() for text in ax.texts]
    assert len(boxes) >= 4
    for number, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[number + 1 :])
    matplotlib.pyplot.close(ax.figure)


def test_small_orders_of_a_gear_do_not_widen_the_model_to_a_ribbon(stepper) -> None:
    """Where low orders are steep, an envelope is as wide as they rise within its places."""
    fit = ta.fit(stepper, [1, 2, 3, 4, 5, 6, 8, 12, 16, 20, 41, 43])
    ax = plots.error_curves(fit)
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert "model" in names
    assert "envelope of the model" not in names
    matplotlib.pyplot.close(ax.figure)


def test_long_names_leave_room_for_the_picture() -> None:
    """Five names of some length once made a legend of one line that left no axes."""
    theta = np.arange(20.0, 80.0, 1.5)
    noise = np.random.default_rng(3).normal(0.0, 0.002, (5, theta.size))
    runs = [
        ta.CalibrationRun(theta, theta + e, 360.0, label=f"{'a rather long label ' * 4}{i}")
        for i, e in enumerate(noise)
    ]
    ax = ta.fit(runs, [3]).plot("residuals")
    figure = ax.figure
    figure.canvas.draw()
    assert ax.bbox.width > 0.8 * figure.bbox.width
    box = ax.get_legend().get_window_extent()
    assert figure.bbox.x0 <= box.x0
    assert box.x1 <= figure.bbox.x1
    names = [text.get_text() for text in ax.get_legend().get_texts()]
    assert len(set(names)) == 5  # what is left out is in the middle
    matplotlib.pyplot.close(figure)
