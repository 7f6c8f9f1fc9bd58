"""Motions of other joints: what a share of them is, and which of them cannot show."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.drawing import Drawing
from trueangle.effects.joint_coupling import JointCoupling, _about_means
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Simulation

Array = np.ndarray
SEED = 76_000


def signals_of(**coupled: list[Array]) -> Signals:
    """Runs there and back of unlike lengths, with the angles of other joints, degrees."""
    runs = []
    for k in range(len(next(iter(coupled.values())))):
        count = len(next(iter(coupled.values()))[k])
        theta = 180.0 + 170.0 * np.sin(np.linspace(0.0, 6.0 + k, count))
        others = {f"coupled_{name}": values[k] for name, values in coupled.items()}
        runs.append(ta.CalibrationRun(theta, theta, 360.0, signals=others, label=f"{k}"))
    return join_runs(runs)


def regression_of(signals: Signals, error: Array | float = 0.0) -> Regression:
    print(f"seed {SEED}")
    noise = np.random.default_rng(SEED).standard_normal(len(signals))
    return Regression.of(signals, noise + error, Simulation().surroundings, rho=0.0)


def spots_of(signals: Signals) -> list[str]:
    return [spot.because for spot in JointCoupling.blind_spots(regression_of(signals), [])]


@pytest.mark.parametrize("place", [0.1, -77.7, 123.456, 1.0 / 3.0, 359.99])
def test_a_joint_at_rest_stands_still_wherever_it_stands(place: float) -> None:
    """A mean of equal angles is that angle but for rounding, which is no motion."""
    at_rest = [np.full(count, place + 10.0 * k) for k, count in enumerate((49, 97, 193, 301))]
    signals = signals_of(a=at_rest)
    assert not _about_means(signals, signals.coupled["a"]).any()
    (told,) = spots_of(signals)
    assert told == "joint a is at rest in every run: its share is in the zeros of the runs"
    assert JointCoupling.propose(regression_of(signals)) is None
    # The least that is no rounding is a motion; less than that is none.
    for size, seen in ((1e-9, True), (1e-14, False)):
        moved = [x + size * abs(place) * np.sin(np.arange(x.size)) for x in at_rest]
        given = signals_of(a=moved)
        centred = _about_means(given, given.coupled["a"])
        assert centred.any() == seen
        if seen:
            most = 1.1e-12 * float(np.abs(given.coupled["a"]).max())
            for start, stop in given.run_bounds():
                part = given.coupled["a"][start:stop]
                np.testing.assert_allclose(centred[start:stop], part - part.mean(), atol=most)


def motions(count: int, seed: int) -> list[Array]:
    """A way of its own in each of four runs."""
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-60.0, 60.0, (4, 6))
    return [np.interp(np.linspace(0.0, 5.0, count), np.arange(6.0), way) for way in corners]


def test_motions_that_are_sums_of_others_are_told_by_name() -> None:
    """All of them, each with what it is made of; a share beyond that of another shows it."""
    a, b, c = (motions(120, SEED + k) for k in range(3))
    both = [x + 2.0 * y for x, y in zip(a, b, strict=True)]
    assert spots_of(signals_of(a=a, b=b, c=c)) == []
    alike = "move in proportion: a share of either is the same"
    twice = [5.0 - 2.0 * x for x in a]
    told = spots_of(signals_of(a=a, b=twice, c=c))
    assert told == [f"joints a and b {alike}", f"joints b and a {alike}"]
    told = spots_of(signals_of(a=a, b=b, d=both))
    assert told == [
        f"the motion of joint {name} is made up of those of {', '.join(others)}"
        for name, others in (("a", "bd"), ("b", "ad"), ("d", "ab"))
    ]
    # A seventh of the motion is its own: 2 % of its power.
    for own, seen in ((0.10, False), (0.20, True)):
        power = [np.std(np.concatenate([x - x.mean() for x in way])) for way in (a, c)]
        near = [x + own * power[0] / power[1] * y for x, y in zip(a, c, strict=True)]
        assert (spots_of(signals_of(a=a, b=near)) == []) == seen
    # This joint's own angle, and that about the mean of each run.
    base = signals_of(a=a)
    angle = np.degrees(base.theta)
    follows = [3.0 * angle[start:stop] + 7.0 for start, stop in base.run_bounds()]
    (told_own,) = spots_of(signals_of(b=b, a=follows))
    assert told_own.startswith("joint a moves in proportion to this joint")


@pytest.mark.parametrize("factor", [2e-4, -3e-4])
def test_a_share_is_found_and_told_with_its_error(factor: float) -> None:
    """Of one joint after the other; each pays for the joints it was looked for among."""
    a, b, c = (motions(120, SEED + k) for k in range(3))
    signals = signals_of(a=a, rest=[np.full(120, 30.0)] * 4, b=b, c=c)
    hidden = JointCoupling("b", factor), JointCoupling("c", 3.0 * factor)
    around = Simulation().surroundings
    assert (
        not JointCoupling("elsewhere", 1.0).signal(signals, around, np.random.default_rng()).any()
    )
    error = sum(effect.signal(signals, around, np.random.default_rng(0)) for effect in hidden)
    # A share of degrees is 3600 times as many arcsec.
    np.testing.assert_allclose(
        error, 3600.0 * factor * (signals.coupled["b"] + 3.0 * signals.coupled["c"])
    )
    regression = regression_of(signals, error)
    for name, among in (("c", 3), ("b", 2)):
        found = JointCoupling.propose(regression)
        assert found is not None
        assert found.shape == {"joint": name}
        assert found.parameters == 1
        assert found.log_grid == pytest.approx(np.log(among))
        regression = regression.with_terms([*regression.terms, found])
    k = len(regression.terms) - 1
    fits = [(term, c, regression.covariance(i)) for i, (term, c) in enumerate(regression.fitted())]
    told, effects = JointCoupling.report(regression, fits[k:])
    shares = [3600.0 * signals.coupled[name] for name in "bc"]
    beside = np.column_stack([np.ones(len(signals)), *shares])
    std = np.sqrt(np.linalg.inv(beside.T @ beside)[1, 1])
    assert told["joint"].value == "b"
    assert abs(told["factor"].value - factor) < 4.0 * told["factor"].std
    assert told["factor"].std == pytest.approx(std, rel=0.1)
    assert effects == [JointCoupling("b", told["factor"].value)]
    # Both are gone: of the third there is no evidence.
    last = JointCoupling.propose(regression)
    assert last is not None
    assert last.shape == {"joint": "a"}
    assert last.bic_gain < 0.0


def test_a_coupling_is_drawn_of_a_joint_that_moves() -> None:
    a = motions(60, SEED)
    signals = signals_of(a=a, rest=[np.full(60, 30.0)] * 4)
    around, rng = Simulation().surroundings, np.random.default_rng(0)
    drawn = {JointCoupling.drawn(0.01, Drawing(signals, around, rng)) for _ in range(20)}
    assert drawn == {JointCoupling("a", 0.01)}
    still = signals_of(rest=[np.full(60, 30.0)] * 4)
    assert JointCoupling.drawn(0.01, Drawing(still, around, rng)) is None
