"""Each figure of an account and of a finding under its own key of JSON."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import Discrepancy
from trueangle.diagnosis.finding import Finding
from trueangle.effects import EFFECTS
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.quantity import quantity
from trueangle.simulation import Harmonic, RunDesign, Simulation, simulate

SIM = Simulation(
    harmonics=(Harmonic("output", 1, 20.0, 30.0),),
    sigma_arcsec=1.3,
    runs=tuple(RunDesign(samples=n, reversals=(0.4,)) for n in (90, 140)),
)


def test_every_figure_of_an_account_has_its_own_key():
    result = ta.diagnose(simulate(SIM, 2), SIM, gain=False)
    sizes = {f"{n}_{w}_arcsec": float(10 * k + j) for k, n in enumerate(("rms", "max_abs"), 2)
             for j, w in enumerate(("before", "after"))}  # fmt: skip
    spot = Ambiguity(("backlash", "latency"), "why", "what", True, 9.5, common="backlash")
    made = replace(
        result,
        discrepancy=Discrepancy(1.5, 2.5, 3.5, 4.5, 5.5),
        structure={"backlash": 0.25},
        noise=6.5,
        correlation=0.375,
        readings=701,
        readings_used=650,
        gain=sizes,
        not_identifiable=[spot],
        notes=["a note"],
        complete=False,
        unexplained=replace(result.unexplained, found=True, rms=7.5, share=0.125),
        unexplained_before=replace(result.unexplained, found=False, rms=8.5, share=0.625),
    )
    told = json.loads(made.to_json("joint.toml"))
    assert told["simulation"] == {
        "rms_arcsec": 1.5, "peak_to_peak_arcsec": 2.5, "max_abs_arcsec": 3.5,
        "closure_arcsec": 4.5, "zero_spread_arcsec": 5.5,
    }  # fmt: skip
    names = ("structure", "noise_arcsec", "noise_correlation", "readings", "readings_used", "gain")
    assert [told[name] for name in names] == [{"backlash": 0.25}, 6.5, 0.375, 701, 650, sizes]
    assert (told["complete"], told["notes"]) == (False, ["a note"])
    assert told["extended_simulation"] == "joint.toml"
    rest, before = told["unexplained"], told["unexplained"]["before"]
    assert (rest["found"], rest["rms_arcsec"], rest["share"]) == (True, 7.5, 0.125)
    assert (before["found"], before["rms_arcsec"], before["share"]) == (False, 8.5, 0.625)
    assert told["not_identifiable"] == [
        {"causes": ["backlash", "latency"], "because": "why", "measure": "what",
         "supported": True, "bic_gain": 9.5, "estimates": {}}
    ]  # fmt: skip
    for item, entry in zip(made.unexplained.evidence, rest["evidence"], strict=True):
        assert (entry["test"], entry["p"], entry["decides"]) == (item.test, item.p, item.decides)
        assert entry["statistic"] == item.statistic


@pytest.mark.parametrize(("cause", "correctable"), [("backlash", True), ("zero_slip", False)])
def test_every_figure_of_a_finding_has_its_own_key(cause, correctable):
    finding = Finding(
        cause,
        {"size": quantity(1.5, 0.25)},
        {"bic_gain": 2.5, "deviance": 3.5},
        None,
        [("latency", 4.5), ("sidebands", -5.5)],
        status="not_confirmed",
        reason="why",
    )
    told = finding.to_dict()
    assert told["parameters"] == {"size": {"value": 1.5, "std": 0.25}}
    assert told["evidence"] == {"bic_gain": 2.5, "deviance": 3.5}
    assert told["rivals"] == [{"cause": "latency", "bic_gap": 4.5},
                              {"cause": "sidebands", "bic_gap": -5.5}]  # fmt: skip
    assert (told["status"], told["status_reason"], told["gain"]) == ("not_confirmed", "why", None)
    assert told["physics"] == EFFECTS[cause].sentence
    assert told["correctable"] is correctable
