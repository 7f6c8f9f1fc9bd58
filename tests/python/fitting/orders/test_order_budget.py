"""Orders without end: refused before they are made, at every door."""

import itertools
import resource

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.joint.shafts import MOST_ORDERS

#: Bytes of a machine that is small: a thousand million orders take 28 GB.
ROOM = 4 << 30

ENDLESS = {
    "a range": lambda: range(1, 10**9),
    "a range that has no length": lambda: range(1, 10**30),
    "an iterator": lambda: itertools.count(1),
    "one too many": lambda: range(1, MOST_ORDERS + 2),
}


@pytest.fixture(autouse=True)
def little_memory():
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (ROOM, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.fixture
def runs():
    theta = np.arange(0.0, 360.0, 2.0)
    return [ta.CalibrationRun(theta, theta + 0.1 * np.sin(np.radians(theta)), 360.0)]


@pytest.fixture
def desk(runs, tmp_path, monkeypatch):
    ta.write_runs(runs, tmp_path / "r.csv")
    (tmp_path / "s.toml").write_text("[joint]\ngear_ratio = 50.0\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


COMMANDS = {
    "fit": ["fit", "r.csv", "-o", "x.json", "--orders"],
    "fit of shafts": ["fit", "r.csv", "-o", "x.json", "--gear-ratio", "50", "--orders"],
    "fit in one pass": ["fit", "r.csv", "--one-pass", "-o", "x.json", "--orders"],
    "fit beside the reference": ["fit", "r.csv", "-o", "x.json", "--reference-orders"],
    "orders": ["orders", "r.csv", "--orders"],
    "orders of the reference": ["orders", "r.csv", "--reference-orders"],
    "selfcal": ["selfcal", "r.csv", "-o", "x.json", "--orders"],
    "report": ["report", "r.csv", "-o", "x.html", "--orders"],
    "plan": ["plan", "--orders"],
}


@pytest.mark.parametrize("text", ["1-1000000000", "1-100000", "3,1-999999999999999"])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_list_without_end_is_refused_in_one_line(command, text, desk, capsys):
    if "shafts" in command:
        text = f"output:1-3;motor:{text}"
    before = set(desk.iterdir())
    assert main([*COMMANDS[command], text]) == 1
    told = capsys.readouterr().err
    assert f"{MOST_ORDERS} at a time" in told
    assert told.count("\n") == 1
    assert len(told) < 300
    assert set(desk.iterdir()) == before


@pytest.mark.parametrize("many", ENDLESS)
def test_orders_without_end_are_refused_in_python(many, runs, desk):
    made = ENDLESS[many]
    doors = {
        "fit": lambda: ta.fit(runs, orders=made()),
        "fit by shaft": lambda: ta.fit(runs, orders={"motor": made()}, gear_ratio=50.0),
        "reference": lambda: ta.fit(runs, orders=[1], reference_orders=made()),
        "select": lambda: ta.select_orders(runs, candidates=made()),
        "select reference": lambda: ta.select_orders(runs, reference_orders=made()),
        "logs": lambda: ta.fit_logs(desk / "r.csv", orders=made()),
        "moments": lambda: ta.Moments(made()),
        "plan": lambda: ta.plan_mounts(100.0, orders=made()),
        "report": lambda: ta.report(runs, orders=made()),
        "selfcal": lambda: ta.selfcal(desk / "r.csv", orders=made()),
    }
    for name, door in doors.items():
        with pytest.raises(ta.errors.ArgumentError, match="at a time") as told:
            door()
        assert len(str(told.value)) < 300, name


def test_what_the_limit_allows_is_read():
    from trueangle.cli.values import parse_orders

    assert parse_orders(f"1-{MOST_ORDERS}") == tuple(range(1, MOST_ORDERS + 1))
    assert parse_orders("1-4000,1-4000,5") == tuple(range(1, 4001))
