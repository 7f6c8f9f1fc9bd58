"""A joint whose order 202 and backlash its simulation does not know."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.effects import Backlash
from trueangle.joint.joint import DeclaredShaft
from trueangle.reports.demo import demo_simulation
from trueangle.reports.page import find_browser
from trueangle.simulation import Harmonic, Joint, RunDesign

ORDERS = {"output": [1], "motor": [1, 2], "wave_generator": [2]}


@pytest.fixture(scope="session")
def runs() -> list[ta.CalibrationRun]:
    return ta.simulate(replace(demo_simulation(), effects=(Backlash(8.0),)), seed=0)


@pytest.fixture(scope="session")
def large():
    """One run over a part of a turn, degrees of error, several causes of one kind."""
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    believed = ta.Simulation(
        Joint(declared=(DeclaredShaft("stepper", cycles_per_turn=50.0),)),
        sigma_arcsec=10.0,
        runs=(RunDesign(label="one", samples=1200, speed_deg_s=9.0, turns=0.95),),
    )
    lines = (
        Harmonic("output", 4, 25_000.0, 30.0),
        Harmonic("stepper", 2, 400.0, 70.0),
        Harmonic("stepper", 1, 3_000.0, 200.0),
    )
    runs = ta.simulate(replace(believed, harmonics=lines), seed=7)
    return ta.report(runs, simulation=believed, title="Degrees")


@pytest.fixture(scope="module")
def browser():
    with pytest.importorskip("playwright.sync_api").sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=find_browser(), args=["--no-sandbox"])
        yield started
        started.close()


@pytest.fixture(scope="session")
def made(runs: list[ta.CalibrationRun]):
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    return ta.report(runs, orders=ORDERS, gear_ratio=100.0, title="A <joint> & its error")
