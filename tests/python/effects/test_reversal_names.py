"""What a reversal error is called where each run goes one way: no more than is seen."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.effects import Backlash, PreslidingHysteresis
from trueangle.simulation import Joint, RunDesign, Simulation

#: Half of the reversal error, arcsec, under noise of 2 arcsec.
SIZE = 2.5

#: Standard errors within which a size must come out: 1 in 16 000 lies beyond 4.
WITHIN = 4.0

#: What play and a wound-up spring are called where they are not told apart.
EITHER = {"backlash", "presliding_hysteresis"}


def runs_of(effect, seed: int, speeds=(4.0, 25.0)):
    """Twelve runs, six in either direction, and the simulation that lacks the effect."""
    print(f"seed {seed}")
    designs = tuple(
        RunDesign(
            f"{speed:g} {direction:+d} {repeat}",
            direction=direction,
            speed_deg_s=speed,
            samples=200,
            spacing="jittered",
            start_deg=31.0 * repeat,
        )
        for speed in speeds
        for direction in (1, -1)
        for repeat in range(6 // len(speeds))
    )
    belief = Simulation(joint=Joint(gear_ratio=80.0), sigma_arcsec=2.0, runs=designs)
    return ta.simulate(replace(belief, effects=(effect,)), seed), belief


def told_apart(result: ta.Diagnosis) -> bool:
    """Whether the diagnosis does not say that the two cannot be told apart."""
    return not any(set(spot.causes) == EITHER for spot in result.not_identifiable)


@pytest.mark.parametrize("seed", [5311, 5312])
def test_play_is_named_by_what_is_common_to_both(seed: int) -> None:
    result = ta.diagnose(*runs_of(Backlash(SIZE), seed))
    (finding,) = result.findings
    assert (finding.cause, finding.status) == ("backlash", "confirmed")
    width = finding.parameters["half_width_arcsec"]
    assert abs(width.value - SIZE) < WITHIN * width.std
    assert not told_apart(result)
    assert finding.rivals[0][0] == "presliding_hysteresis"


@pytest.mark.parametrize("seed", [5321, 5322])
def test_a_spring_wound_up_before_the_runs_is_the_same_reversal_error(seed: int) -> None:
    result = ta.diagnose(*runs_of(PreslidingHysteresis(SIZE, 3.0, 1.0), seed))
    assert [finding.cause for finding in result.findings] == ["backlash"]
    assert not told_apart(result)


def test_a_transition_that_is_seen_is_named() -> None:
    result = ta.diagnose(*runs_of(PreslidingHysteresis(4.0 * SIZE, 4.0, 0.0), 5331))
    (finding,) = result.findings
    assert finding.cause == "presliding_hysteresis"
    length = finding.parameters["length_deg"]
    assert abs(length.value - 4.0) < WITHIN * length.std
    assert told_apart(result)


def test_at_one_speed_a_delay_is_the_same_and_nothing_is_named() -> None:
    result = ta.diagnose(*runs_of(Backlash(SIZE), 5341, speeds=(25.0,)))
    assert not result.findings
    assert any(spot.supported and "latency" in spot.causes for spot in result.not_identifiable)
