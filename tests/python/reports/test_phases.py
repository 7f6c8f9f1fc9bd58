"""Phases run by run: a chart for each order that several runs hold."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.reports.figures import ErrorScale, line_names, phase_figure
from trueangle.support.display_units import error_unit

SEED = 44


def fit_of(runs, orders=(1, 3)):
    rng = np.random.default_rng(SEED)
    made = []
    for k in range(runs):
        x = np.sort(rng.uniform(0.0, 360.0, 200))
        error = 0.02 * np.cos(np.radians(x) - 0.4) + 0.01 * np.cos(np.radians(3 * x) + 0.1 * k)
        made.append(
            ta.CalibrationRun(x, x + error + 1e-4 * rng.normal(size=200), 360.0, label=f"r{k}")
        )
    return ta.fit(made, list(orders))


@pytest.mark.parametrize(("runs", "orders"), [(3, (1, 3)), (2, (1,)), (1, (1, 3))])
def test_every_order_of_several_runs_has_a_chart(runs, orders):
    figure = phase_figure(fit_of(runs, orders), line_names(None), ErrorScale(error_unit("arcsec")))
    if runs == 1:
        assert figure is None
    else:
        assert figure["alt"].startswith(f"Phases of {len(orders)} order")
        assert len(figure["charts"]) == len(orders)
