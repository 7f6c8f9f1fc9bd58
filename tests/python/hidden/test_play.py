"""Play is told from either side: which angle turns first, with its sign and half width."""

from __future__ import annotations

import os

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.curve import Curve
from trueangle.simulation import Simulation

from .sweeps import measured

#: Seeds that nothing was chosen on; `make exam` asks more.
LARGE = os.environ.get("TRUEANGLE_EXAM_SEEDS")
SEEDS = range(9300, 9300 + int(LARGE)) if LARGE else range(9300, 9302)

#: Standard errors within which a half width must come out, beside a share of its own: how far a
#: joint has moved between two readings is not known better.
WITHIN, SHARE = 4.0, 0.03

#: Degrees per second.
SPEED = 20.0


def follower(drive, half_width):
    """What is driven through a play: it stands until the play is crossed."""
    found, at = np.empty_like(drive), drive[0]
    for k, angle in enumerate(drive):
        at = min(max(at, angle - half_width), angle + half_width)
        found[k] = at
    return found


def driven(rng, half_width, sigma, first):
    """Sweeps of a drive and what follows it, of which ``first`` is the angle that turns first."""
    runs = []
    for k in range(int(rng.integers(1, 4))):
        sweeps = rng.uniform(30.0, 80.0, int(rng.integers(4, 8)))
        sweeps *= rng.choice([-1.0, 1.0]) * np.resize([1.0, -1.0], sweeps.size)
        turns = rng.uniform(0.0, 100.0) + np.concatenate([[0.0], np.cumsum(sweeps)])
        path = np.concatenate([[0.0], np.cumsum(np.abs(sweeps))])
        travel = np.linspace(0.0, path[-1], 1200)
        drive = np.interp(travel, path, turns)
        angles = {"drive": drive, "behind": follower(drive, half_width)}
        reference = angles["behind" if first == "indicated" else "drive"]
        indicated = angles["drive" if first == "indicated" else "behind"]
        error = indicated - reference + rng.normal(0.0, sigma, travel.size)
        runs.append(measured(reference, travel / SPEED, 3600.0 * error, f"run {k}"))
    return runs


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("first", ["indicated", "reference"])
def test_play_is_told_from_either_side(first, seed):
    print(f"seed {seed}")
    rng = np.random.default_rng([seed, len(first)])
    half_width = float(rng.uniform(0.8, 2.0))
    sigma = half_width * float(rng.uniform(0.08, 0.25))
    runs = driven(rng, half_width, sigma, first)
    result = ta.diagnose(runs, Simulation())
    sure = [finding for finding in result.findings if finding.confirmed]
    assert [finding.cause for finding in sure] == ["backlash"], result.summary()
    found = sure[0].parameters
    assert found["turns_first"].value == first
    width = found["half_width_arcsec"]
    wanted = 3600.0 * half_width * (1.0 if first == "indicated" else -1.0)
    assert abs(width.value - wanted) < WITHIN * width.std + SHARE * abs(wanted)
    assert result.gain["rms_after_arcsec"] < 1.2 * 3600.0 * sigma
    # What is written back says the same of these readings.
    effect, *curves = result.extended.effects
    assert all(isinstance(curve, Curve) for curve in curves)  # of what follows something besides
    assert (effect.turns_first, effect.half_width_arcsec) == (first, width.value)
    beyond = np.concatenate([3600.0 * np.degrees(run.error) for run in runs])
    beyond = beyond - result.extended.predict(runs)
    assert float(np.std(beyond)) < 1.2 * 3600.0 * sigma


def test_friction_that_winds_up_against_the_travel_is_none():
    """The other sign is play of the reference: never a hysteresis of negative amplitude."""
    rng = np.random.default_rng(9400)
    result = ta.diagnose(driven(rng, 0.05, 0.02, "reference"), Simulation(), gain=False)
    assert [finding.cause for finding in result.findings] in (["backlash"], [])
    assert all(spot.causes != ("presliding_hysteresis",) for spot in result.not_identifiable)
