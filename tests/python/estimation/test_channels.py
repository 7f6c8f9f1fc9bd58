"""Constants of two channels: at the Cramer-Rao limit, with honest errors, or one clear line."""

from __future__ import annotations

import contextlib
import math

import numpy as np
import pytest

from trueangle.errors import NoModelError
from trueangle.estimation.channels import estimate_channels, referenced_channels
from trueangle.runs.checks.channelreadings import ChannelReadings
from trueangle.runs.rawchannels import CONSTANTS, Channels

TRUE = Channels(
    offset_sine=0.015, offset_cosine=0.02, gain_ratio=1.03, phase_deg=1.5, period=2.0 * math.pi
)
#: Arc in degrees and noise relative to the amplitude: an estimator is at its limit over these.
DESIGNS = [(360, 2e-3), (360, 5e-4), (180, 2e-3), (180, 5e-4), (120, 2e-3), (120, 5e-4)]


def drawn(arc, noise, seed, n=1000, channels=TRUE, ratio=1.0):
    rng = np.random.default_rng(seed)
    phase = np.sort(rng.uniform(0.0, math.radians(arc), n))
    sine, cosine = channels.curve(phase)
    return sine + ratio * noise * rng.normal(size=n), cosine + noise * rng.normal(size=n)


def curve(p, phase):
    return np.array([p[0] + p[2] * np.cos(phase), p[1] + p[2] * p[3] * np.sin(phase + p[4])])


def limit(arc, noise, n=1000):
    """Cramer-Rao limit of the angle by numerical derivatives: the mean over the arc is removed."""
    p = np.array([0.02, 0.015, 1.0, 1.03, math.radians(1.5)])
    phase = math.radians(arc) * (np.arange(n) + 0.5) / n
    h = 1e-6
    steps = h * np.eye(5)
    slopes = np.array([(curve(p + s, phase) - curve(p - s, phase)) / (2 * h) for s in steps])
    along = (curve(p, phase + h) - curve(p, phase - h)) / (2 * h)
    normal = np.array([along[1], -along[0]]) / np.hypot(*along)
    rows = np.einsum("kdn,dn->nk", slopes, normal)
    covariance = np.linalg.inv(rows.T @ rows) * noise**2

    def angle(q):
        cosine, sine = curve(p, phase)
        x = (cosine - q[0]) / q[2]
        y = ((sine - q[1]) / (q[2] * q[3]) - x * math.sin(q[4])) / math.cos(q[4])
        return np.unwrap(np.arctan2(y, x))

    g = np.array([(angle(p + s) - angle(p - s)) / (2 * h) for s in steps]).T
    g -= g.mean(axis=0)
    return math.sqrt(np.einsum("ij,jk,ik->i", g, covariance, g).mean())


def left(found, arc):
    phase = np.linspace(0.0, math.radians(arc), 400)
    off = np.radians(found.channels.angle(*TRUE.curve(phase))) - phase
    return float(np.std(np.angle(np.exp(1j * off))))


def offs_and_pulls(arc, noise, seeds):
    """Error left, limit stated and pulls of the constants, of those that are not refused."""
    rows = []
    for seed in seeds:
        with contextlib.suppress(NoModelError):
            found = estimate_channels(*drawn(arc, noise, seed), "log")
            rows.append([left(found, arc), found.limit, *pulls_of(found.channels)])
    return np.array(rows)


def pulls_by_reference(arc, seed, runs):
    """Pulls of the constants by a reference, of runs with a zero each."""
    rng = np.random.default_rng(seed)
    channels = TRUE.replace(period=360.0, harmonics=((3, 0.01, 0.02, 0.0), (-3, 0.0, 0.01, 0.0)))
    signals = []
    for _ in range(runs):
        theta = rng.uniform(0.0, 360.0) + arc * rng.uniform(size=600 // runs) ** 1.5
        pair = channels.curve(np.radians(theta)) if arc >= 360 else TRUE.curve(np.radians(theta))
        noise = 2e-3 * rng.normal(size=(2, theta.size))
        signals.append((*(pair + noise), theta + rng.uniform(0.0, 360.0)))
    return pulls_of(referenced_channels(signals, Channels(period=360.0), "log"))


def pulls_of(found):
    off = np.array([getattr(found, name) - getattr(TRUE, name) for name in CONSTANTS])
    return off / np.sqrt(np.diag(found.covariance))


def rms(values):
    return math.sqrt(np.mean(np.square(values)))


@pytest.mark.parametrize(("arc", "noise"), DESIGNS)
def test_the_angle_is_near_its_limit_and_the_pulls_are_near_one(arc, noise):
    rows = offs_and_pulls(arc, noise, range(8))
    bound = limit(arc, noise)
    # Eight draws of five constants that hang together: the slow test below has the target.
    assert rms(rows[:, 0]) <= 1.5 * bound
    # The limit that is stated is that of the design as estimated.
    assert 0.8 < np.median(rows[:, 1]) / bound < 1.25
    assert 0.4 < rms(rows[:, 2:]) < 1.6


@pytest.mark.parametrize("arc", [150, 360, 800])
@pytest.mark.parametrize("runs", [1, 3])
def test_the_pulls_by_a_reference_are_one_though_its_zeros_are_estimated(arc, runs):
    pulls = [pulls_by_reference(arc, seed, runs) for seed in range(100)]
    for name, each in zip(CONSTANTS, np.transpose(pulls), strict=True):
        assert 0.8 < rms(each) < 1.25, name


@pytest.mark.slow
@pytest.mark.parametrize(("arc", "noise"), [*DESIGNS, (70, 5e-4)])
def test_the_angle_is_at_its_limit_and_the_pulls_are_one(arc, noise):
    rows = offs_and_pulls(arc, noise, range(1000, 1200))
    assert len(rows) == 200
    assert rms(rows[:, 0]) <= 1.15 * limit(arc, noise)
    assert 0.9 < rms(rows[:, 2:]) < 1.1


def test_seventy_degrees_are_fitted_with_little_noise_and_refused_with_more():
    assert len(offs_and_pulls(70, 5e-4, range(5))) == 5
    for seed in range(20):
        with pytest.raises(NoModelError, match="turn the shaft 120 deg or more"):
            estimate_channels(*drawn(70, 2e-3, seed), "log")
    with pytest.raises(NoModelError, match="5 readings of the channels"):
        estimate_channels(*drawn(70, 2e-3, 0, n=5), "log")


def test_unlike_noise_of_the_channels_is_found_and_weighed():
    found = estimate_channels(*drawn(360, 1e-3, 5, n=4000, ratio=4.0), "log")
    cosine, sine = found.noise
    assert sine / cosine == pytest.approx(4.0, rel=0.1)


def test_harmonics_are_those_that_the_readings_support():
    # The first one is small next to the last: it is there whatever the others leave.
    given = ((-2, 0.003, 0.0, 0.0), (-3, 0.02, -0.01, 0.0), (-5, 0.0, 0.03, 0.0))
    for seed in range(5):
        curved = TRUE.replace(harmonics=given)
        found = estimate_channels(*drawn(360, 2e-3, seed, channels=curved), "log")
        assert [h.order for h in found.channels.harmonics] == [-2, -3, -5]
        for h, (_, re, im, _) in zip(found.channels.harmonics, given, strict=True):
            assert math.hypot(h.re - re, h.im - im) < 5.0 * h.std
    plain = [estimate_channels(*drawn(360, 2e-3, seed), "log") for seed in range(20)]
    assert sum(len(found.channels.harmonics) for found in plain) <= 1


def test_rests_do_not_draw_the_curve_to_their_place():
    """A field that no ellipse fits exactly, and ten times as many readings at one place."""
    field = TRUE.replace(harmonics=((3, 0.01, 0.0, 0.0),))
    sine, cosine = drawn(360, 1e-4, 1, channels=field)
    rest = [np.full(10_000, channel[400]) for channel in (sine, cosine)]
    resting = estimate_channels(
        *(np.concatenate([c, r]) for c, r in zip((sine, cosine), rest, strict=True)), "log"
    )
    alone = estimate_channels(sine, cosine, "log")
    assert resting.rests >= 10_000
    assert abs(resting.channels.gain_ratio - alone.channels.gain_ratio) < 2e-3
    assert abs(resting.channels.offset_sine - alone.channels.offset_sine) < 2e-3


@pytest.mark.parametrize("noise", [0.0, 0.3, 2.0])
def test_clipped_readings_are_left_out_and_counted_and_no_codes_at_the_top(noise):
    for seed in range(10):
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0.0, 2.0 * math.pi, 3000)
        sine, cosine = (
            np.rint(2048.0 + 200.0 * f(phase) + noise * rng.normal(size=phase.size))
            for f in (np.sin, np.cos)
        )
        assert ChannelReadings.of(sine, cosine).clipped == {}
        clipped = np.clip(sine, 1900.0, 2180.0)
        rows = (clipped == 1900.0) | (clipped == 2180.0)
        assert ChannelReadings.of(clipped, cosine).clipped == {"sine": int(rows.sum())}
        found = estimate_channels(clipped, cosine, "log").channels
        # A rail keeps noise of one sign: up to an eighth of it is left in the gain.
        assert found.gain_ratio == pytest.approx(1.0, abs=1e-3 + noise / 200.0 / 4.0)
