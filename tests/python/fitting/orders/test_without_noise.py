"""Readings without noise: copies of a run, and a reference that is the reading itself."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main


def copies(count):
    """The same run several times, order 1 of 36 arcsec."""
    theta = np.arange(200) * 1.8
    said = theta + 0.01 * np.sin(np.radians(theta))
    return [ta.CalibrationRun(theta, said, period=360.0, label=str(k)) for k in range(count)]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_copies_of_a_run_have_its_order_and_no_other(count):
    found = ta.select_orders(copies(count))
    assert found.orders == (1,)
    assert ta.fit(copies(count)).model.orders == (1.0,)


def test_every_command_answers(tmp_path, capsys):
    same = [f"{k * 0.9},{k * 0.9}" for k in range(400)]
    (tmp_path / "same.csv").write_text("\n".join(["reference_deg,indicated_deg", *same]) + "\n")
    ta.write_runs(copies(3), tmp_path / "copies.csv")
    page = str(tmp_path / "page.html")
    for path in ("same.csv", "copies.csv"):
        log = str(tmp_path / path)
        for command in (["orders", log], ["report", log, "-o", page]):
            status = main(command)
            assert "unexpected" not in capsys.readouterr().err
            assert status == 0, command


@pytest.mark.parametrize("period", [360.0, 2.0 * np.pi, 1.0, 4096.0])
@pytest.mark.parametrize(("part", "orders"), [(0.9e-12, ()), (1.1e-12, (3,))])
def test_less_than_a_millionth_of_a_millionth_of_a_turn_is_rounding(
    part: float, orders: tuple[int, ...], period: float
) -> None:
    turns = np.arange(120) / 60.0
    wave = part * np.sin(2.0 * np.pi * 3.0 * turns)
    run = ta.CalibrationRun(turns * period, (turns + wave) * period, period)
    assert ta.select_orders(run).orders == orders
