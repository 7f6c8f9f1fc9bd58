"""Noise whose deviation grows in proportion to speed beside its own, at two speeds."""

from __future__ import annotations

import pytest

from .answer import judge
from .case import hide
from .faults import draw_speed_noise


@pytest.mark.parametrize("seed", range(50, 60))
@pytest.mark.parametrize("share", [0.7, 1.2])
def test_two_speeds_do_not_tell_friction_from_stamps(share, seed):
    """Neither law is the hidden one, and either fits two speeds."""
    print(f"seed {seed}")
    answer = judge(hide(draw_speed_noise, share, seed))
    assert answer.found == (), answer
    assert [{*causes} for causes in answer.untold] == [
        {"heteroscedastic_noise", "timestamp_jitter"}
    ], answer
