"""What each part of the noise is held against, by every account written out."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from trueangle.diagnosis.penalty import NEW_CAUSE
from trueangle.diagnosis.unevennoise import uneven_noise
from trueangle.effects.noiselaw import NoiseLaw, noise_law, standardised_residuals
from trueangle.estimation.quantity import Parameters
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals
from trueangle.simulation import Simulation

from .test_unevennoise import JITTER, UNEVEN, signals_of

Array = np.ndarray

#: Blocks of orders, and the speed in one form or none: what an account is.
Account = tuple[tuple[int, ...], str]


@pytest.fixture(scope="module")
def signals() -> Signals:
    return signals_of((1.0, 6.0, 13.0, 24.0, 41.0, 66.0, 90.0) * 2)


def regression_of(signals: Signals, angle: float, form: str, size: float, seed: int) -> Regression:
    """Noise that follows the angle, and the speed in one of its forms."""
    print(f"seed {seed}")
    share = np.abs(signals.velocity) / np.abs(signals.velocity).max()
    variance = np.exp(angle * np.cos(signals.theta))
    variance = variance + (size * share) ** 2 if form == JITTER else variance * size ** (2 * share)
    noise = np.random.default_rng(seed).normal(0.0, np.sqrt(variance))
    return Regression.of(signals, noise, Simulation().surroundings, rho=0.0)


def accounts(regression: Regression, orders: tuple[int, ...]) -> dict[Account, float]:
    """BIC of every account, by its likelihood and what it pays: `law` of each."""
    found = {}
    for account in itertools.product(dict.fromkeys([(), orders]), ("", UNEVEN, JITTER)):
        blocks, form = account
        # Half of what a mean tells of a parameter; one of so many low orders, of four factors.
        each = regression.log_n - np.log(2.0)
        paid = sum(2.0 * each + 2.0 * np.log(2.0 * k) for k in blocks)
        paid += (each + 2.0 * np.log(4.0)) * (form != "")
        found[account] = float(paid - 2.0 * law(regression, account).log_likelihood)
    return found


def law(regression: Regression, account: Account) -> NoiseLaw:
    blocks, form = account
    theta, speed = regression.signals.theta, np.abs(regression.signals.velocity)
    columns = [np.ones(regression.n), *(f(k * theta) for k in blocks for f in (np.cos, np.sin))]
    columns += [speed] * (form == UNEVEN)
    growing = speed / speed.max() if form == JITTER else None
    return noise_law(standardised_residuals(regression) ** 2, np.column_stack(columns), growing)


def expected_parameters(regression: Regression, account: Account, cause: str) -> dict[str, float]:
    """What a law says of its cause; of time stamps what scatters as the residual does."""
    found, (blocks, form) = law(regression, account), account
    if cause == JITTER:
        left = regression.residual - regression.design @ regression.coefficients
        top = 3600.0 * np.abs(regression.signals.velocity).max()
        unit = 1.4826 * float(np.median(np.abs(left))) / top
        return {"sigma_s": float(np.exp(0.5 * found.log_growth)) * unit}
    names = [name + (f"_{k}" if k > 1 else "") for k in blocks for name in ("cosine", "sine")]
    names += ["per_deg_s"] * (form == UNEVEN)
    return dict(zip(names, found.coefficients[1:].tolist(), strict=True))


#: Growth with the angle, form and size of what follows the speed, seed; what is expected: orders
#: of the blocks, form of the best account, and whether the speed's form is in doubt.
CASES = [
    (0.0, JITTER, 9.0, 90_361, (), JITTER, False),
    (0.0, UNEVEN, 9.0, 90_361, (), UNEVEN, False),
    (0.9, JITTER, 4.0, 90_361, (1,), JITTER, False),
    (0.9, UNEVEN, 9.0, 90_361, (1,), UNEVEN, False),
    (0.9, UNEVEN, 1.0, 90_361, (1,), "", False),
    (0.9, UNEVEN, 1.15, 90_361, (1, 2), UNEVEN, False),
    (0.9, UNEVEN, 1.15, 90_371, (1, 2), UNEVEN, True),
    # So little of the speed that even noise is the next best, and beside which no form is clear.
    (0.0, JITTER, 0.4, 90_412, (), JITTER, True),
    (0.9, JITTER, 0.4, 90_403, (1, 2), JITTER, True),
]


@pytest.mark.parametrize(("angle", "form", "size", "seed", "orders", "best", "doubt"), CASES)
def test_each_part_is_held_against_the_best_account_with_another_in_its_place(
    signals: Signals, angle: float, form: str, size: float, seed: int,
    orders: tuple[int, ...], best: str, doubt: bool,
) -> None:  # fmt: skip
    regression = regression_of(signals, angle, form, size, seed)
    bic = accounts(regression, orders)
    chosen = min(bic, key=lambda account: bic[account])
    assert chosen == (orders, best)

    def gap_of(*asked: Account) -> tuple[float, Account]:
        other = min(asked, key=lambda account: bic[account])
        return bic[other] - bic[chosen], other

    rivals = [(blocks, JITTER) for blocks in dict.fromkeys([(), orders])]
    if best == JITTER:
        rivals = [account for account in bic if account[1] != JITTER and account != ((), "")]
    elif not best:
        rivals = [((), JITTER)]  # time stamps in the place of the angle, not beside it
    gap, rival = gap_of(*rivals)
    apart = best == JITTER or doubt  # the speed is told by itself, and what follows the angle
    of_speed = JITTER if best == JITTER else UNEVEN
    wanted = {(of_speed, True): gap_of((orders, "") if apart else ((), ""))[0]}
    if apart and orders:
        wanted[UNEVEN, False] = gap_of(((), best))[0]
    found = uneven_noise(regression)
    assert [item.bic_gain for item in found] == sorted((i.bic_gain for i in found), reverse=True)
    assert {(item.cause, bool(item.rivals)) for item in found} == wanted.keys()
    other = UNEVEN if best == JITTER else JITTER
    for item in found:
        assert item.bic_gain == pytest.approx(wanted[item.cause, bool(item.rivals)], abs=1e-6)
        np.testing.assert_allclose(item.weights, law(regression, chosen).weights, rtol=1e-9)
        own = expected_parameters(regression, chosen, item.cause)
        if apart:
            own = {
                n: v for n, v in own.items() if (n in ("per_deg_s", "sigma_s")) == bool(item.rivals)
            }
        assert values(item.parameters) == pytest.approx(own, rel=1e-9)
        if not item.rivals:
            assert not item.alternatives
            continue
        assert item.rivals == ((other, pytest.approx(gap, abs=1e-6)),)
        assert (gap < NEW_CAUSE) == doubt
        instead = expected_parameters(regression, rival, other)
        assert item.alternatives.keys() == {other}
        assert values(item.alternatives[other]) == pytest.approx(instead, rel=1e-9)


def values(parameters: Parameters) -> dict[str, object]:
    return {name: entry.value for name, entry in parameters.items()}


def test_noise_that_follows_the_angle_is_named_where_a_little_of_the_speed_may_come_on_top(
    signals: Signals,
) -> None:
    """No scatter of time stamps is as good as the angle, whether or not there is some beside it."""
    for seed in range(90_381, 90_393):
        found = uneven_noise(regression_of(signals, 0.9, JITTER, 0.35, seed))
        angle = [item for item in found if "cosine" in item.parameters]
        assert len(angle) == 1
        assert angle[0].bic_gain > 400.0
        assert all(gap > 400.0 for _, gap in angle[0].rivals)
