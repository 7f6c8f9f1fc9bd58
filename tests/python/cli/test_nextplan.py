"""What is asked of `plan --after` is what the plan is made by, and nothing where nothing is."""

import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.rehearsal import after
from trueangle.simulation import RunDesign, Simulation, simulate

SIM = Simulation(sigma_arcsec=2.0, runs=(RunDesign(samples=40),))


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """What `plan_after` is given for some options."""
    SIM.save(tmp_path / "belief.toml")
    ta.write_runs(simulate(SIM), tmp_path / "runs.csv")
    (tmp_path / "limits.toml").write_text("[limits]\nruns = 3\n")

    found = []

    def plan_after(runs, sim, **given):
        found.append((len(runs), sim.sigma_arcsec, given))
        raise ta.errors.ArgumentError("a plan is not needed here")

    monkeypatch.setattr(after, "plan_after", plan_after)
    monkeypatch.chdir(tmp_path)

    def ask(*words):
        assert main(["plan", "--after", "runs.csv", "--simulation", "belief.toml", *words]) == 1
        runs, sigma, given = found.pop()
        assert (runs, sigma) == (1, 2.0)
        return given

    return ask


def test_without_options_it_is_the_plan_of_the_api(asked):
    assert asked() == {"between": None, "limits": None, "progress": "auto"}


@pytest.mark.parametrize(
    ("words", "name", "value"),
    [
        (("--seeds", "0"), "seeds", 0),
        (("--seeds", "25"), "seeds", 25),
        (("--within", "1min"), "within", 60.0),
        (("--between", "backlash,latency"), "between", ["backlash", "latency"]),
    ],
)
def test_an_option_is_what_it_is_made_by(words, name, value, asked):
    """Nought, too: no simulated diagnoses."""
    given = asked(*words)
    assert given.pop(name) == value
    others = asked()
    others.pop(name, None)
    assert given == others


def test_limits_are_those_of_the_file(asked):
    assert asked("--limits", "limits.toml")["limits"].runs == 3
