"""What is told of a drive's torque: every number at its name, and nothing that is in doubt."""

from __future__ import annotations

import re

import pytest

from trueangle.diagnosis.torque import TorqueAccount, TorqueFinding, number_of_quantity
from trueangle.estimation.quantity import quantity


def ripple(order: float, torque: float, phase: float, status: str = "confirmed") -> TorqueFinding:
    return TorqueFinding(
        "torque_ripple",
        {
            "order": quantity(order),
            "torque_Nm": quantity(torque, 0.012),
            "phase_deg": quantity(phase, 1.5),
        },
        status,
        "" if status == "confirmed" else "two of one column",
    )


def friction(torque: float, status: str = "confirmed") -> TorqueFinding:
    return TorqueFinding("dry_friction", {"torque_Nm": quantity(torque, 0.003)}, status, "a doubt")


def damping(value: float, status: str = "confirmed") -> TorqueFinding:
    return TorqueFinding("damping", {"Nm_s_per_rad": quantity(value, 4e-4)}, status, "a doubt")


def test_a_finding_is_told_with_its_numbers_errors_and_units() -> None:
    told = ripple(4.0, 0.31, 40.25).summary()
    assert told == "torque ripple: order 4, 0.31 +- 0.012 Nm, at 40.25 +- 1.5 deg"
    doubt = ripple(4.0, 0.31, 40.25, "not_confirmed").summary()
    assert doubt == f"{told} (NOT CONFIRMED: two of one column)"
    assert friction(-0.2).summary() == "dry friction: -0.2 +- 0.003 Nm"
    assert damping(0.05).summary() == "damping: 0.05 +- 0.0004 Nm s/rad"
    # Several numbers, text, and no error.
    other = TorqueFinding(
        "other_thing",
        {"length_deg": quantity([1.5, 2.5], [0.1, 0.2]), "follows_what": quantity("speed")},
        "confirmed",
    )
    assert other.summary() == "other thing: length deg 1.5, 2.5, follows what speed"
    assert ripple(4.0, 0.31, 40.0).confirmed
    assert not ripple(4.0, 0.31, 40.0, "not_confirmed").confirmed
    plain = ripple(4.0, 0.31, 40.25, "not_confirmed").to_dict()
    assert [*plain] == ["effect", "status", "status_reason", "parameters"]
    assert (plain["effect"], plain["status"]) == ("torque_ripple", "not_confirmed")
    assert plain["status_reason"] == "two of one column"
    assert plain["parameters"]["torque_Nm"]["value"] == 0.31
    assert plain["parameters"]["torque_Nm"]["std"] == 0.012
    assert number_of_quantity(quantity(3)) == 3.0


def test_a_simulator_is_given_confirmed_waves_of_whole_orders_alone() -> None:
    found = (
        ripple(4.0, 0.1 + 0.2, -40.25),
        ripple(6.0, 0.2, 10.0, "not_confirmed"),
        ripple(7.3, 0.2, 10.0),
        ripple(0.0, 0.2, 10.0),
        ripple(1.0, 0.05, 0.0),
        friction(0.2),
    )
    account = TorqueAccount(0.5, 0.1, False, found)
    # To the last digit: orders, Nm, degrees.
    assert account.ripple == "4:0.30000000000000004:-40.25,1:0.05:0.0"
    assert TorqueAccount(0.5, 0.1, False, found[1:4]).ripple == ""


@pytest.mark.parametrize(
    ("found", "advice"),
    [
        ((), ""),
        ((friction(0.2),), "add +0.2 to its frictionloss"),
        ((damping(-0.05), friction(0.2)), "add +0.2 to its frictionloss and -0.05 to its damping"),
        ((damping(0.05, "not_confirmed"), friction(-0.25)), "add -0.25 to its frictionloss"),
        ((friction(0.2, "not_confirmed"), ripple(4.0, 0.3, 40.0)), ""),
    ],
)
def test_it_is_said_what_is_to_be_added_to_a_joint(
    found: tuple[TorqueFinding, ...], advice: str
) -> None:
    account = TorqueAccount(0.5, 0.1, False, found)
    assert account.advice == advice
    lines = account.summary().splitlines()
    assert [line for line in lines if "MuJoCo" in line] == [
        f"- of MuJoCo's joint: {text}" for text in [advice] if text
    ]
    assert [line for line in lines if re.match("- (torque|dry|damp)", line)] == [
        f"- {one.summary()}" for one in found
    ]


@pytest.mark.parametrize("complete", [True, False])
@pytest.mark.parametrize("unexplained", [True, False])
@pytest.mark.parametrize("found", [(), (friction(0.2),)])
def test_an_account_says_how_much_is_noise_and_whether_it_is_whole(
    found: tuple[TorqueFinding, ...], unexplained: bool, complete: bool
) -> None:
    account = TorqueAccount(0.5125, 0.125, unexplained, found, complete)
    told = account.summary()
    assert told.startswith(
        "Torque of the drive, measured minus simulated: rms 0.512 Nm, including 0.125 Nm noise"
    )
    nothing = not found and not unexplained
    assert ("nothing is in it beyond the simulator's" in told) == nothing
    assert ("NOT UNDERSTOOD" in told) == unexplained
    assert ("INCOMPLETE: the time was up" in told) == (not complete)
    assert account.to_dict() == {
        "rms_Nm": 0.5125,
        "noise_Nm": 0.125,
        "unexplained": unexplained,
        "findings": [one.to_dict() for one in found],
        "complete": complete,
    }
