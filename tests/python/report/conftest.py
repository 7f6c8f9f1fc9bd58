"""A joint whose order 202 and backlash its simulation does not know."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.effects import Backlash
from trueangle.reports.demo import demo_simulation

ORDERS = {"output": [1], "motor": [1, 2], "wave_generator": [2]}


@pytest.fixture(scope="session")
def runs() -> list[ta.CalibrationRun]:
    return ta.simulate(replace(demo_simulation(), effects=(Backlash(8.0),)), seed=0)


@pytest.fixture(scope="session")
def made(runs: list[ta.CalibrationRun]):
    pytest.importorskip("jinja2")
    pytest.importorskip("bokeh")
    return ta.report(runs, orders=ORDERS, gear_ratio=100.0, title="A <joint> & its error")
