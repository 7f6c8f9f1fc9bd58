"""Constants of a sine and a cosine channel against their formulas, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle.errors import ArgumentError, FileError
from trueangle.runs.files import read_runs
from trueangle.runs.rawchannels import Channels


def drawn(rng, harmonics=()):
    return Channels(
        offset_sine=rng.normal(),
        offset_cosine=rng.normal(),
        amplitude=rng.uniform(0.2, 5.0),
        gain_ratio=rng.uniform(0.7, 1.4),
        phase_deg=rng.uniform(-25.0, 25.0),
        direction=int(rng.choice([-1, 1])),
        periods_per_turn=int(rng.integers(1, 6)),
        period=float(rng.choice([360.0, 1.0, 2.0 * math.pi])),
        harmonics=harmonics,
    )


def wrapped(channels, off):
    step = channels.period / channels.periods_per_turn
    return off - step * np.round(off / step)


def test_the_angle_inverts_the_curve_and_harmonics_are_corrected_to_all_orders():
    rng = np.random.default_rng(17)
    for _ in range(50):
        rows = [(k, *rng.normal(size=2) * 0.01, 1e-9) for k in (-4, -3, -2, 2, 3)]
        channels = drawn(rng, rows)
        phase = rng.uniform(-math.pi, math.pi, 100)
        true = channels.direction * phase * channels.period
        true /= 2.0 * math.pi * channels.periods_per_turn
        plain = channels.replace(harmonics=())
        off = wrapped(channels, plain.angle(*plain.curve(phase)) - true)
        assert np.abs(off).max() < 1e-13 * channels.period
        off = wrapped(channels, channels.correct(*channels.curve(phase)) - true)
        # Without the zero, which no curve shows.
        assert np.ptp(off) < 1e-7 * channels.period
        sine, cosine = channels.curve(phase)
        assert channels.correct(sine[0], cosine[0]) == channels.correct(sine, cosine)[0]


def test_angle_errors_are_the_difference_of_two_coefficients():
    """To first order: order k is ``z_(1+k) - conj(z_(1-k))`` (Kuntz, arXiv 2205.08472)."""
    rng = np.random.default_rng(4)
    phase = 2.0 * math.pi * np.arange(256) / 256.0
    for _ in range(30):
        coefficients = {k: complex(*rng.normal(size=2)) * 1e-4 for k in (-3, -2, -1, 0, 2, 3, 4)}
        z = np.exp(1j * phase)
        z = z + sum(c * np.exp(1j * k * phase) for k, c in coefficients.items())
        error = np.unwrap(np.angle(z)) - phase
        found = 2.0 * np.fft.rfft(error) / phase.size
        for k in (1, 2, 3, 4):
            wanted = coefficients.get(1 + k, 0.0) - np.conj(coefficients.get(1 - k, 0.0))
            assert abs(1j * found[k] - wanted) < 1e-6


def test_relative_coefficients_are_those_of_a_fourier_series():
    rng = np.random.default_rng(8)
    phase = 2.0 * math.pi * np.arange(64) / 64.0
    for _ in range(20):
        channels = drawn(rng)
        sine, cosine = channels.curve(phase)
        found = np.fft.fft(cosine + 1j * sine) / phase.size
        size, turn = abs(found[1]), found[1] / abs(found[1])
        assert abs(channels.fundamental - found[1]) < 1e-12
        assert abs(channels.offset - found[0] / size) < 1e-12
        assert abs(channels.image - found[-1] * turn / size) < 1e-12


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"amplitude": 0.0}, "amplitude must be positive"),
        ({"gain_ratio": -1.0}, "gain_ratio must be positive"),
        ({"phase_deg": 90.0}, "between -90 and 90"),
        ({"offset_sine": math.nan}, "offset_sine must be finite"),
        ({"periods_per_turn": 1.5}, "periods_per_turn must be a whole number"),
        ({"harmonics": ((1, 0.0, 0.0, 0.0),)}, "a harmonic has an order"),
        ({"covariance": np.eye(4)}, "covariance must be 5 x 5"),
    ],
)
def test_constants_that_decode_nothing_are_refused(fields, words):
    with pytest.raises(ArgumentError, match=words):
        Channels(**fields)


def test_angles_are_made_in_the_sense_and_turns_of_the_reference():
    theta = np.linspace(0.0, 1400.0, 1600)
    for periods, end in ((1, 1e9), (3, 1e9), (16, 360.0)):
        for sign in (1.0, -1.0):
            phase = sign * periods * np.radians(theta) + 0.4
            columns = {"sine": np.sin(phase), "cosine": np.cos(phase)}
            table = {"reference_deg": theta % end, **columns}
            (run,) = read_runs(table, periods_per_turn=periods)
            assert run.channels.direction == sign
            assert np.ptp(run.centred_error) < 1e-9


def test_an_unsigned_converter_is_taken_about_its_middle():
    theta = np.linspace(0.0, 360.0, 100)
    phase = np.radians(theta)
    table = {
        "reference_deg": theta,
        "sine": 2048 + 1000 * np.sin(phase),
        "cosine": 2048 + 1000 * np.cos(phase),
    }
    (run,) = read_runs(table)
    assert np.abs(run.error).max() < 1.0


def test_an_angle_of_the_file_stays_unless_the_channels_are_asked_for():
    theta = np.linspace(0.0, 350.0, 50)
    table = {
        "reference_deg": theta,
        "indicated_deg": theta + 1.0,
        "sine": np.sin(np.radians(theta)),
        "cosine": np.cos(np.radians(theta)),
    }
    (run,) = read_runs(table)
    assert run.channels is None
    assert run.zero == pytest.approx(1.0)
    (run,) = read_runs(table, periods_per_turn=1)
    assert run.zero == pytest.approx(0.0, abs=1e-9)


def test_channels_without_a_reference_are_sent_to_their_method():
    theta = np.linspace(0.0, 6.0, 50)
    with pytest.raises(FileError, match=r"selfcal .* --method channels"):
        read_runs({"sine": np.sin(theta), "cosine": np.cos(theta)})


def test_a_missing_or_dead_channel_is_named():
    theta = np.linspace(0.0, 350.0, 50)
    table = {"reference_deg": theta, "sine": np.sin(np.radians(theta))}
    with pytest.raises(FileError, match="no column cosine"):
        read_runs(table, periods_per_turn=1)
    with pytest.raises(FileError, match="the cosine channel is constant"):
        read_runs({**table, "cosine": np.ones(50)})
