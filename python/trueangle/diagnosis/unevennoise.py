"""Forms that the noise follows: those that explain it equally well are reported together.

Noise may follow the speed as ``exp(a + b |v|)`` (friction, which has no law) or as the square
``a + b v²`` (time stamps that scatter), in addition to noise that follows the angle and the
load, which may imitate either. Neither form contains the other. So every account, with and without
what is not the speed, with either form or none, has its likelihood and its penalty. Each part of
the best account is compared with the best account in which another cause is in its place. Runs at
two speeds determine one number of either form: readings between the speeds do not select one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

from ..effects.effect import ScatterFinding
from ..effects.heteroscedastic_noise import (
    PER_SPEED,
    HeteroscedasticNoise,
    chosen_columns,
    noise_blocks,
    speed_penalty,
)
from ..effects.noiselaw import NoiseLaw, noise_law, standardised_residuals
from ..effects.timestamp_jitter import TimestampJitter, shares_of_speed
from ..estimation.regression import Regression
from .levels import levels_of_runs
from .penalty import NEW_CAUSE

UNEVEN, JITTER = HeteroscedasticNoise.kind, TimestampJitter.kind


@dataclass(frozen=True)
class _NoiseAccount:
    """Blocks that are not the speed, the cause whose form the speed has, or none; law and BIC."""

    blocks: tuple[str, ...]
    form: str
    law: NoiseLaw
    bic: float

    @property
    def is_even(self) -> bool:
        return not (self.blocks or self.form)

    @property
    def columns(self) -> tuple[str, ...]:
        return (*self.blocks, PER_SPEED) if self.form == UNEVEN else self.blocks


def uneven_noise(regression: Regression) -> list[ScatterFinding]:
    """Causes of uneven noise that the readings support, each with its rival; strongest first.

    Parameters
    ----------
    regression : Regression

    Returns
    -------
    list of ScatterFinding
        All have the weights of the best account. Empty where the noise is even.
    """
    uneven = HeteroscedasticNoise.find_scatter(regression)
    jitter = TimestampJitter.find_scatter(regression)
    blocks = () if uneven is None else uneven.blocks
    if jitter is None and PER_SPEED not in blocks:
        return [] if uneven is None else [uneven]
    accounts = _accounts(regression, tuple(name for name in blocks if name != PER_SPEED))
    best = min(accounts, key=lambda account: account.bic)
    found = [] if best.is_even else _parts(regression, best, accounts)
    return sorted(found, key=lambda item: -item.bic_gain)


def _accounts(regression: Regression, others: tuple[str, ...]) -> list[_NoiseAccount]:
    """With what is not the speed and without it, and the speed in every form."""
    square = standardised_residuals(regression) ** 2
    speed, blocks = shares_of_speed(regression), noise_blocks(regression)
    found = []
    for names in dict.fromkeys([(), others]):
        for form in ("", UNEVEN, JITTER):
            chosen = (*names, PER_SPEED) if form == UNEVEN else names
            growing = speed if form == JITTER else None
            law = noise_law(square, chosen_columns(blocks, chosen), growing)
            penalty = sum(blocks[name].penalty for name in chosen)
            penalty += speed_penalty(regression) if form == JITTER else 0.0
            found.append(_NoiseAccount(names, form, law, penalty - 2.0 * law.log_likelihood))
    return found


def _parts(
    regression: Regression, best: _NoiseAccount, accounts: Sequence[_NoiseAccount]
) -> Iterator[ScatterFinding]:
    """What the noise follows in the best account, each part with what else it may be."""

    def gain_over(asked: Callable[[_NoiseAccount], bool]) -> tuple[float, _NoiseAccount]:
        other = min(filter(asked, accounts), key=lambda account: account.bic)
        return other.bic - best.bic, other

    is_jitter = best.form == JITTER

    def is_instead(one: _NoiseAccount) -> bool:
        if one.is_even or (one.form == JITTER) == is_jitter:
            return False
        # With the same angles the speed would be added, not exchanged for anything.
        return bool(best.form) or one.blocks != best.blocks

    gap, rival = gain_over(is_instead)
    levels = levels_of_runs(regression.signals, "velocity")
    if best.form and rival.form and rival.blocks == best.blocks and levels and len(levels[1]) == 2:
        gap = 0.0
    other = UNEVEN if is_jitter else JITTER
    instead = _jitter(regression, rival) if rival.form == JITTER else _uneven(rival)
    assert instead is not None
    rivals, alternatives = ((other, gap),), {other: instead.parameters}
    from_even, _ = gain_over(lambda one: one.is_even)
    in_doubt = best.form == UNEVEN and gap < NEW_CAUSE and rival.blocks == best.blocks != ()
    if not (is_jitter or in_doubt):
        whole = _uneven(best)
        assert whole is not None
        yield replace(whole, bic_gain=from_even, rivals=rivals, alternatives=alternatives)
        return
    by_speed, _ = gain_over(lambda one: not one.form and one.blocks == best.blocks)
    speed = _jitter(regression, best) if is_jitter else _uneven(best)
    assert speed is not None
    if in_doubt:
        speed = replace(speed, parameters={PER_SPEED: speed.parameters[PER_SPEED]})
    yield replace(speed, bic_gain=by_speed, rivals=rivals, alternatives=alternatives)
    # What follows the angle or the load is there whatever form the speed has.
    beside = HeteroscedasticNoise.finding_of(best.law, best.blocks)
    if beside is not None:
        by_others, _ = gain_over(lambda one: not one.blocks and one.form == best.form)
        yield replace(beside, bic_gain=by_others)


def _uneven(account: _NoiseAccount) -> ScatterFinding | None:
    return HeteroscedasticNoise.finding_of(account.law, account.columns)


def _jitter(regression: Regression, account: _NoiseAccount) -> ScatterFinding:
    return TimestampJitter.finding_of(account.law, regression)
