"""Lists of things of one type refuse others at the door, and say what is meant instead."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

import trueangle as ta
from trueangle import simulation, terms
from trueangle.effects import KINDS
from trueangle.errors import ArgumentError, KindError
from trueangle.model.term import TERMS
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

THETA = np.arange(0.0, 360.0, 5.0)
RUN = ta.CalibrationRun(THETA, THETA, 360.0)
SHAFT = ta.Shaft("output", 1.0, [1], [0.0], [0.1])

#: What is refused, and words of the message: what was got, and what is wanted.
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "a term as an effect": (
        lambda: Simulation().with_effects([ta.Backlash(3.0)]),
        r"effects\[0\].*term of a correction model.*trueangle\.simulation\.Backlash",
    ),
    "one effect, no list": (
        lambda: Simulation().with_effects(simulation.Backlash(3.0)),  # type: ignore[arg-type]
        "effects must be a list",
    ),
    "effects at once": (
        lambda: Simulation(effects=[simulation.Latency(1e-3), ta.Latency(1e-3)]),  # type: ignore[arg-type]
        r"effects\[1\].*trueangle\.simulation\.Latency",
    ),
    "a table as an effect": (lambda: Simulation(effects=({"kind": "backlash"},)), "got dict"),  # type: ignore[arg-type]
    "a shaft as a line": (lambda: Simulation(harmonics=[SHAFT]), "simulation.Harmonic, got Shaft"),  # type: ignore[list-item,arg-type]
    "readings as a design": (lambda: Simulation(runs=(RUN,)), "RunDesign, got CalibrationRun"),  # type: ignore[arg-type]
    "a number as a joint": (lambda: Simulation(joint=100.0), "Joint, got float 100.0"),  # type: ignore[arg-type]
    "an effect as a term": (
        lambda: ta.HarmonicModel((), terms=[simulation.ThermalDrift(1.0)]),  # type: ignore[list-item,arg-type]
        r"terms\[0\].*effect of a simulation.*trueangle\.terms\.ThermalDrift",
    ),
    "an effect put in later": (
        lambda: ta.HarmonicModel(()).replace(terms=(simulation.Backlash(3.0),)),
        r"trueangle\.terms\.Backlash",
    ),
    "one term, no list": (lambda: ta.HarmonicModel((), terms=ta.Backlash(3.0)), "must be a list"),  # type: ignore[arg-type]
    "numbers as shafts": (lambda: ta.HarmonicModel([1.0]), r"shafts\[0\].*got float 1.0"),  # type: ignore[list-item,arg-type]
    "a line as a shaft": (
        lambda: ta.HarmonicModel([Harmonic("output", 1, 3.0)]),  # type: ignore[list-item,arg-type]
        "trueangle.Shaft, got Harmonic",
    ),
    "a shaft that is not declared": (
        lambda: Joint(declared=(SHAFT,)),  # type: ignore[arg-type]
        r"declared\[0\] must be a DeclaredShaft",
    ),
    "simulate": (lambda: ta.simulate(3), "load_simulation"),  # type: ignore[arg-type]
    "simulate readings": (lambda: ta.simulate(Simulation(), runs=[RUN]), r"runs\[0\]"),  # type: ignore[list-item]
    "diagnose against a path": (lambda: ta.diagnose(RUN, "joint.toml"), "load_simulation"),  # type: ignore[arg-type]
    "rehearse": (lambda: ta.rehearse("joint.toml"), "load_simulation"),  # type: ignore[arg-type]
    "report": (lambda: ta.report(RUN, simulation="joint.toml"), "load_simulation"),  # type: ignore[call-overload]
    "no runs at all": (lambda: ta.fit(3), "runs must be paths, runs, or tables"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("what", REFUSED)
def test_wrong_kinds_are_refused_at_the_door(what: str) -> None:
    call, words = REFUSED[what]
    with pytest.raises(KindError, match=words) as refused:
        call()
    assert isinstance(refused.value, ArgumentError)
    assert isinstance(refused.value, TypeError)


@pytest.mark.parametrize("kind", TERMS)
def test_every_term_and_effect_of_one_kind_names_the_other(kind: str) -> None:
    """The names that messages give can be imported."""
    effect = KINDS[kind].__name__
    assert getattr(simulation, effect) is KINDS[kind]
    assert getattr(terms, TERMS[kind].__name__.removesuffix("Term")) is TERMS[kind]


def test_lists_and_iterators_of_the_right_kind_stay() -> None:
    made = Simulation(
        harmonics=[Harmonic("output", 1, 3.0)],  # type: ignore[arg-type]
        effects=iter([simulation.Backlash(3.0)]),  # type: ignore[arg-type]
        runs=[RunDesign()],  # type: ignore[arg-type]
    )
    assert made == Simulation(
        harmonics=(Harmonic("output", 1, 3.0),),
        effects=(simulation.Backlash(3.0),),
        runs=(RunDesign(),),
    )
    assert ta.HarmonicModel(iter([SHAFT])).shafts == (SHAFT,)
